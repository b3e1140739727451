"""The search for coloured balls, the same for every camera: blobs of the ball's colour, each judged by its evidence."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls import blobs as kernel
from robocup_vision.kernels.balls.cut_ball import fit_cut_ball
from robocup_vision.kernels.balls.evidence import find_and_weigh
from robocup_vision.kernels.balls.upright import count_upright
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.balls.ball import FORWARD_BALLS, MIRROR_BALLS, Ball, BallSettings
from robocup_vision.perception.balls.projection import PinholeBallProjection, ball_projection
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.floor_color import PaintColor
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView

# a ball whose logarithms of R/G and B/G change by less cannot be distinguished from one with red and blue swapped
_MIN_SWAP_DISTANCE = 0.5
# a ball's shadow lies within this many half sizes of it, and what hides behind it within this many above its middle
_SHADOW_RATIO, _BEHIND_RATIO = 1.5, 1.15
# a polar sample is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# beyond it the logarithm of 1 + exp(x) is x, and the exponential may overflow
_MAX_EXPONENT = 50.0


def ball_colors(colors: Colors, settings: BallSettings) -> tuple[kernel.BallColor, ...]:
    """Return what is of the ball's colour, from each way from white on; noise may make several the same."""
    found = [_ball_color(colors, settings, ratio) for ratio in settings.white_ratios]
    return tuple(one for n, one in enumerate(found) if n == 0 or one.plane_ratio < found[n - 1].plane_ratio)


def _ball_color(colors: Colors, settings: BallSettings, min_ratio: float) -> kernel.BallColor:
    """Return planes that part the ball's colour from white and from the floor, and how bright and clear it must be."""
    ball, floor, white = (_direction(color) for color in (colors.ball, colors.floor.lit, colors.line))
    raw_noise = _RAW_NOISE * colors.floor.noise
    # a small ball is mixed with floor all over: the plane lies as near to the floor's colour as its noise allows
    floor_counts = 4 * colors.floor.level / float(floor @ [1.0, 2.0, 1.0])
    apart = math.acos(min(1.0, float(ball @ floor)))
    noise_ratio = settings.floor_stds * raw_noise / floor_counts / max(apart, 1e-3)
    ratio = min(0.5, max(1 / 3, noise_ratio))
    from_floor = _plane(ball, floor, ratio)
    white_ratio = min(0.5, max(min_ratio, noise_ratio))
    min_level = settings.min_level * colors.floor.level
    on_dark_ball = min_level * float(np.dot(from_floor, ball) / ball.sum())
    beside_white = np.log(ball / white)
    weak, middle, _ = (int(channel) for channel in np.argsort(beside_white, kind="stable"))
    fall = settings.clipped_ratio * float(beside_white[weak] - beside_white[middle])
    return kernel.BallColor(
        from_white=_plane(ball, white, white_ratio),
        from_floor=from_floor,
        half_white=_plane(ball, white, 0.5),
        plane_ratio=white_ratio,
        apart_rad=max(math.acos(min(1.0, float(ball @ white))), 1e-3),
        min_hue=settings.white_noise_stds * raw_noise,
        weak=weak,
        middle=middle,
        clipped_ratio=float(white[weak] / white[middle]) * math.exp(fall),
        min_level=min_level,
        sure=on_dark_ball,
        min_signal=settings.min_signal * raw_noise,
    )


def with_swapped_ball(colors: Colors) -> Colors | None:
    """Return colours with the ball's as if its red and blue were swapped; None where that is nearly its own colour.

    Light falls on the paint as it is: only what the paint adds to white is swapped.
    """
    white = np.log([colors.line.red_ratio, colors.line.blue_ratio])
    beside = np.log([colors.ball.red_ratio, colors.ball.blue_ratio]) - white
    if np.linalg.norm(beside - beside[::-1]) < _MIN_SWAP_DISTANCE:
        return None
    red, blue = np.exp(white + beside[::-1]).tolist()
    return replace(colors, ball=PaintColor(red, blue))


def floor_evidence(near_floor_nats: float, green_nats: float, settings: BallSettings) -> float:
    """Return how much more likely the frame shows a ball's floor than anything: carpet all around, and it is green.

    The second is what `green_evidence` tells of the frame's colours.
    """
    missing = max(settings.floor_nats - near_floor_nats, 0.0) / settings.floor_std
    return settings.max_floor - 0.5 * missing * missing + green_nats


def green_evidence(colors: Colors, settings: BallSettings) -> float:
    """Return how much more likely a floor of these colours is carpet than anything, as it is green: nats, 0 or less."""
    floor, white = colors.floor.lit, colors.line
    # under a cast of light carpet is greener than white; what passes for white may be some paint: than grey, too
    ratios = (floor.red_ratio, floor.blue_ratio, floor.red_ratio / white.red_ratio, floor.blue_ratio / white.blue_ratio)
    green = -math.log(max(ratios))
    return -settings.green_nats * math.log1p(math.exp(min(-green / settings.green_scale, _MAX_EXPONENT)))


def _direction(color: PaintColor) -> FloatArray:
    """Return the unit vector (3,), B, G, R, of a colour."""
    vector = np.array([color.blue_ratio, 1.0, color.red_ratio])
    return np.asarray(vector / np.linalg.norm(vector))


def _plane(color: FloatArray, other: FloatArray, ratio: float) -> kernel.Bgr:
    """Return the unit normal, B, G, R, of a plane through black, at a ratio of the way from `other` to `color`."""
    within = other + ratio * (color - other)
    normal = color - float(color @ within) / float(within @ within) * within
    length = float(np.linalg.norm(normal))
    blue, green, red = (normal / length if length > 0 else normal).tolist()
    return blue, green, red


class SearchMemory:
    """What a search keeps over frames: which pixels it has visited, and where balls were in the last one.

    Finders that look by one camera in turn may share it.

    Parameters
    ----------
    mask : (H, W) uint8 or None
        Non-zero pixels are never visited.
    """

    def __init__(self, size_px: tuple[int, int], mask: UInt8Array | None) -> None:
        width, height = size_px
        self._stamps = np.zeros((height, width), dtype=np.int32)
        if mask is not None:
            self._stamps[mask > 0] = kernel.NEVER
        self.scratch = plain(kernel.Scratch(self._stamps, np.empty(height * width, np.int32), np.empty((2, 6))))
        self.stamp = 0
        self.last_px: list[tuple[float, float, float]] = []

    def begin(self) -> int:
        """Return the first stamp of a search."""
        if self.stamp > kernel.NEVER // 2:
            self._stamps[self._stamps != kernel.NEVER] = 0
            self.stamp = 0
        return self.stamp + 1


class BallFinder:
    """Finds balls of a colour in frames of one camera; holds scratch memory, so one object a thread.

    Parameters
    ----------
    field : Field
        Gives the ball's size and colour; a white ball cannot be distinguished from lines.
    camera : OmniCamera or PinholeCamera
        With a known tilt.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    settings : BallSettings, optional
        Without them those of the camera's kind.
    memory : SearchMemory, optional
        Of the camera's frames, where finders for other orientations look at them, too.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera | PinholeCamera,
        mask: UInt8Array | None = None,
        settings: BallSettings | None = None,
        memory: SearchMemory | None = None,
    ) -> None:
        is_mirror = isinstance(camera, OmniCamera)
        self.settings = settings or (MIRROR_BALLS if is_mirror else FORWARD_BALLS)
        self.projection = ball_projection(camera, field.ball_radius_m)
        self.has_color = field.ball_color not in ("white", "black")
        self._mask = mask
        self._memory = SearchMemory(camera.size_px, mask) if memory is None else memory
        self._evidence = plain(self.settings.evidence)
        self._table: ColorTable | None = None
        self._colors: tuple[kernel.BallColor, ...] = ()
        self._swapped_colors: tuple[kernel.BallColor, ...] | None = None
        self._greenness = 0.0
        self._floor_table = kernel.FloorTable(np.empty((3, 256), dtype=np.uint16), np.empty(0, dtype=np.int8))
        self._blobs = np.empty((self.settings.max_blobs, kernel.COLUMNS))
        self._ratios = np.empty(self.settings.max_blobs)

    @cached_property
    def _size(self) -> kernel.BallSize:
        view, shape_std = self.projection, self.settings.shape_std
        along, across = view.sizes_px
        known = (along > 0) & (across > 0)
        size = np.log(np.where(known, along * across, 1.0)) / 2
        # neighbours tell how fast the size changes along the ray; at the ends of what is known they tell nothing
        change = np.abs(np.gradient(size)) * (known & np.roll(known, 1) & np.roll(known, -1))
        # where the sway is as long as the way to the horizon, any size may be
        sway = np.minimum(view.sway_px * change, 0.8)
        shape_std = math.hypot(shape_std, view.height_std)
        axis_u, axis_v = view.axis_px
        return plain(
            kernel.BallSize(
                float(axis_u),
                float(axis_v),
                float(view.span_px[0]),
                along,
                across,
                np.hypot(shape_std, sway),
                shape_std,
            )
        )

    @cached_property
    def _seeds(self) -> npt.NDArray[np.int32]:
        """Pixels (N, 2) int32, v and u, in rows so dense that a ball anywhere on the floor covers some of them."""
        view, pitch = self.projection, self.settings.seed_pitch
        (along, across), (width, height) = view.sizes_px, view.size_px
        up_rad, reach_px = math.atan2(view.ahead[1], view.ahead[0]), math.hypot(width, height)
        span_px = view.span_px[1] - view.span_px[0]
        min_half_px = min(self.settings.min_half_px, self.settings.min_half_ratio * span_px)
        rows: list[FloatArray] = []
        place = view.span_px[0] + 1.0
        while place < view.span_px[1]:
            half_px = across[round(place)]
            if half_px < min_half_px:
                place += 1.0
                continue
            turn, step = min(reach_px / place, math.pi), pitch * half_px / place
            turns = up_rad + np.arange(-turn, turn, step) + (len(rows) % 2) * step / 2
            rows.append(view.axis_px + place * np.stack([np.cos(turns), np.sin(turns)], axis=1))
            place += max(pitch * along[round(place)], 1.0)
        pixels = np.rint(np.vstack(rows)).astype(np.int32) if rows else np.empty((0, 2), dtype=np.int32)
        inside = (pixels >= 1).all(axis=1) & (pixels[:, 0] < width - 1) & (pixels[:, 1] < height - 1)
        pixels = pixels[inside]
        if self._mask is not None:
            pixels = pixels[self._mask[pixels[:, 1], pixels[:, 0]] == 0]
        # in the order of memory
        return np.ascontiguousarray(np.unique(pixels[:, ::-1], axis=0))

    def find(self, frame: UInt8Array, table: ColorTable, near_floor_nats: float) -> tuple[Ball, ...]:
        """Find the balls in a frame, the likeliest first.

        Parameters
        ----------
        near_floor_nats : float
            Mean log-likelihood ratio of the floor near the robot: how much of it is of the learnt floor's colour.
        """
        if not self.has_color:
            return ()
        self._adopt(table)
        found, self._memory.last_px = self._search(frame, self._colors, near_floor_nats, self._memory.last_px)
        return found

    def find_swapped(self, frame: UInt8Array, table: ColorTable, near_floor_nats: float) -> tuple[Ball, ...]:
        """Find things that look like balls whose red and blue are swapped; as `find`, but nothing is remembered.

        Where swapped red and blue leave the ball's colour nearly as it is, none are found.
        """
        if not self.has_color:
            return ()
        self._adopt(table)
        if self._swapped_colors is None:
            swapped = with_swapped_ball(table.colors)
            self._swapped_colors = () if swapped is None else self._colors_of(swapped)
        return self._search(frame, self._swapped_colors, near_floor_nats, [])[0]

    def _adopt(self, table: ColorTable) -> None:
        if self._table is not table:
            self._table = table
            self._colors = self._colors_of(table.colors)
            self._swapped_colors = None
            self._greenness = green_evidence(table.colors, self.settings)
            self._floor_table = plain(kernel.FloorTable(table.packing, table.floor_llr))

    def _colors_of(self, colors: Colors) -> tuple[kernel.BallColor, ...]:
        return tuple(plain(color) for color in ball_colors(colors, self.settings))

    def _search(
        self,
        frame: UInt8Array,
        colors: tuple[kernel.BallColor, ...],
        near_floor_nats: float,
        before: list[tuple[float, float, float]],
    ) -> tuple[tuple[Ball, ...], list[tuple[float, float, float]]]:
        """Return the balls of a colour, the likeliest first, and where and how large they are in the picture.

        Parameters
        ----------
        colors : tuple of BallColor
            The ball's colour, from several places on the way from white on.
        before : list of (float, float, float)
            Where and how large balls were in the last frame.
        """
        count = 0
        for color in colors:
            count += self._weigh(frame, color, count)
        places: list[tuple[float, float, float]] = []
        if not count:
            return (), places
        of_floor = floor_evidence(near_floor_nats, self._greenness, self.settings)
        ratios = [ratio + of_floor for ratio in self._ratios[:count].tolist()]
        blobs = self._blobs[:count].tolist()
        found: list[Ball] = []
        for n in sorted(range(count), key=lambda n: -ratios[n]):
            needed = self.settings.min_log_likelihood_ratio
            if ratios[n] < needed - self.settings.again_nats or len(found) == self.settings.max_balls:
                break
            u, v, along, across, _, cut = blobs[n]
            half_px = math.sqrt(along * across)
            if any(math.hypot(u - other_u, v - other_v) < max(half_px, other) for other_u, other_v, other in places):
                # the same ball, at another threshold of its colour
                continue
            again = self.settings.again_half_sizes
            if any(math.hypot(u - last_u, v - last_v) <= again * last for last_u, last_v, last in before):
                needed -= self.settings.again_nats
            if cut and ratios[n] >= needed:
                ratios[n] += self._cut_evidence(blobs[n])
            if ratios[n] >= needed:
                ratios[n] += self._upright_evidence(frame, blobs[n])
            if ratios[n] >= needed:
                ball = self._ball_at(u, v, ratios[n])
                if ball is not None:
                    places.append((u, v, half_px))
                    found.append(ball)
        # glare leaves a part of a ball its colour: it moves by its own size
        last = [(u, v, max(half_px, *self.projection.size_px_at(u, v))) for u, v, half_px in places]
        return tuple(sorted(found, key=lambda ball: -ball.log_likelihood_ratio)), last

    def _weigh(self, frame: UInt8Array, color: kernel.BallColor, first: int) -> int:
        """Find and weigh the blobs of a colour, into the rows from `first` on, and return their number."""
        memory = self._memory
        count, memory.stamp = find_and_weigh(
            frame,
            self._seeds,
            memory.scratch,
            memory.begin(),
            color,
            self._size,
            self._floor_table,
            self._evidence,
            self._blobs[first:],
            self._ratios[first:],
        )
        return int(count)

    def forget(self) -> None:
        """Forget where balls were in the last frame."""
        self._memory.last_px = []

    def hold(self, camera: PinholeCamera, sway_std_rad: tuple[float, float] | None = None) -> None:
        """Place the balls of the frames to come by the camera as it is held then; see `PinholeBallProjection.held`."""
        assert isinstance(self.projection, PinholeBallProjection)
        self.projection = self.projection.held(camera, sway_std_rad)

    def _ball_at(self, u: float, v: float, ratio: float) -> Ball | None:
        visible_ratio = 1.0
        if self._is_cut(u, v):
            u, v, visible_ratio, *_ = fit_cut_ball(u, v, *self.projection.size_px, self._size)
        return self.projection.place(u, v, self.settings.center_std_px / visible_ratio, ratio)

    def _is_cut(self, u: float, v: float) -> bool:
        """Whether a ball with its centre there may reach beyond the picture."""
        reach = max(self.projection.size_px_at(u, v)) - 0.5
        width, height = self.projection.size_px
        return not (reach <= u <= width - 1 - reach and reach <= v <= height - 1 - reach)

    def _cut_evidence(self, blob: list[float]) -> float:
        """Weigh how well a blob at the picture's edge is the part of a ball that it would show: nats."""
        u, v, visible_ratio, count, *shown = fit_cut_ball(
            blob[kernel.U], blob[kernel.V], *self.projection.size_px, self._size
        )
        if count < 2:
            return 0.0
        along, across = self.projection.size_px_at(u, v)
        area = math.pi * along * across * visible_ratio
        measured = (blob[kernel.ALONG], blob[kernel.ACROSS], math.sqrt(blob[kernel.TOTAL]))
        evidence = self.settings.evidence
        nats = 0.0
        for one, expected in zip(measured, (*shown, math.sqrt(max(area, 1.0))), strict=True):
            std = math.hypot(self.settings.shape_std, 1.0 / max(expected, 1.0))
            off = math.log(max(one, 0.5) / max(expected, 0.5)) / std
            density = math.exp(-0.5 * off * off) / (std * math.sqrt(math.tau))
            nats += math.log((1 - evidence.outlier_ratio) * density * evidence.shape_span + evidence.outlier_ratio)
        return nats

    def _upright_evidence(self, frame: UInt8Array, blob: list[float]) -> float:
        """Weigh whether a blob is a part of something upright that goes on above or below it: nats, 0 or less.

        A band of a beacon or post has the next band above, and below. Such a band is as wide as the blob, of one
        colour, and another than what lies to both sides. A ball has floor at its foot; a line that runs towards it is
        narrower, one across it goes on to both sides.
        """
        settings, middle = self.settings, (blob[kernel.U], blob[kernel.V])
        axis_u, axis_v = self.projection.axis_px
        up_u, up_v = middle[0] - axis_u, middle[1] - axis_v
        length = math.hypot(up_u, up_v)
        # glare and shade leave a part of a ball its colour: what goes on must go on beyond the whole of it
        along, across = self.projection.size_px_at(*middle)
        halves = max(blob[kernel.ALONG], along), max(blob[kernel.ACROSS], across)
        step, spreads = settings.min_upright_step, settings.upright_spreads
        count = count_upright(frame, middle, halves, (up_u / length, up_v / length), self._floor_table, step, spreads)
        return int(count) * settings.upright_nats

    def clear(self, ball: Ball, view: PolarView | FloorView, marks: UInt8Array) -> None:
        """Let the ball and its shadow block nothing: the robot drives to it. Changes `marks` (K, M) in place."""
        bearing, radius = view.from_pixel((ball.u_px, ball.v_px))
        along, across = self.projection.size_px_at(ball.u_px, ball.v_px)
        row = (bearing - float(view.bearing_rad[0])) / view.row_step_rad
        column = int(np.argmin(np.abs(view.radius_px - radius)))
        row_px = view.row_step_rad * float(view.range_m[column] / view.across_m_per_px[column])
        # a shadow lies before the ball and beside it; behind it may stand somebody. The samples' blur reaches a column.
        near_px, far_px = ((ratio * along + view.step_px + 1.5) for ratio in (_SHADOW_RATIO, _BEHIND_RATIO))
        half_rows = (_SHADOW_RATIO * across + 1.5) / row_px + 1
        free_floor.clear_ball(row, radius, half_rows, near_px, far_px, view.is_ring, view.radius_px, marks)
