"""Search for balls of one colour: blobs of that colour, each with its likelihood ratio."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls import blobs as kernel
from robocup_vision.kernels.balls.cut_ball import fit_cut_ball
from robocup_vision.kernels.balls.evidence import BallEvidence, find_and_weigh
from robocup_vision.kernels.balls.upright import count_upright
from robocup_vision.perception.balls.ball import Sighting
from robocup_vision.perception.balls.look import BallFrame
from robocup_vision.perception.balls.projection import BallProjection
from robocup_vision.perception.balls.sizes import BallSizes
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.floor_color import PaintColor

# least difference, in logarithms of R/G and B/G, of a ball's colour from that with red and blue swapped
_MIN_SWAP_DISTANCE = 0.5
# noise of a pixel relative to that of a polar sample, which is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# beyond this log(1 + exp(x)) equals x, and the exponential may overflow
_MAX_EXPONENT = 50.0


@dataclass(frozen=True, slots=True)
class ColoredBallSettings:
    """Settings of the search for coloured balls."""

    #: distributions of the measurements of balls and of clutter
    evidence: BallEvidence = field(default_factory=BallEvidence)
    #: least log-likelihood ratio of a ball, given some hundred objects of its colour in a frame
    min_log_likelihood_ratio: float = 6.5
    #: decrease of that near balls of the last frame, and its radius in half sizes, because balls stay and few other
    #: objects are that near
    again_nats: float = 3.0
    again_half_sizes: float = 8.0
    max_blobs: int = 128  #: greatest number of blobs, for pictures full of the ball's colour
    #: margin of the ball's colour from white, standard deviations of the noise, because dark grey has any hue in noise
    white_noise_stds: float = 0.5
    #: position between white and the ball's colour at which it begins for clipped pixels: an overexposed ball is nearly
    #: white
    clipped_ratio: float = 0.15
    #: margin of the ball's colour from the floor's, standard deviations of the noise
    floor_stds: float = 3.5
    min_level: float = 0.6  #: brightness of the ball's shaded side, sum of its channels, relative to the lit floor
    min_signal: float = 4.0  #: least difference of a blob from the floor, standard deviations
    #: mean log-likelihood ratio of a near floor that is all carpet; standard deviation of its decrease by robots and
    #: walls; nats for a frame with such a floor
    floor_nats: float = 3.0
    floor_std: float = 0.7
    max_floor: float = 1.0
    #: scale, a logarithm, by which carpet is greener than grey and than the frame's white; cost of each unit less
    green_scale: float = 0.025
    green_nats: float = 2.0
    center_std_px: float = 0.3  #: standard deviation of the blob's centre
    #: an upright object continues above or below a blob if the colour there differs from both sides by this number of
    #: levels plus this multiple of its own spread; nats for each such side
    min_upright_step: float = 15.0
    upright_spreads: float = 2.0
    upright_nats: float = -2.5


def ball_colors(
    colors: Colors, settings: ColoredBallSettings, white_ratios: tuple[float, ...]
) -> tuple[kernel.BallColor, ...]:
    """Return the ball's colour for several positions between white and it at which it begins, without duplicates."""
    found = [_ball_color(colors, settings, ratio) for ratio in white_ratios]
    return tuple(one for n, one in enumerate(found) if n == 0 or one.plane_ratio < found[n - 1].plane_ratio)


def _ball_color(colors: Colors, settings: ColoredBallSettings, min_ratio: float) -> kernel.BallColor:
    """Return the planes between the ball's colour and white and floor, and the least brightness and signal."""
    ball, floor, white = (_direction(color) for color in (colors.ball, colors.floor.lit, colors.line))
    raw_noise = _RAW_NOISE * colors.floor.noise
    # a small ball is mixed with floor everywhere, so the plane is as near to the floor's colour as noise allows
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
    """Return colours with the ball's red and blue swapped; None if that is nearly its own colour.

    The light stays the same: only the difference of the paint to white is swapped.
    """
    white = np.log([colors.line.red_ratio, colors.line.blue_ratio])
    beside = np.log([colors.ball.red_ratio, colors.ball.blue_ratio]) - white
    if np.linalg.norm(beside - beside[::-1]) < _MIN_SWAP_DISTANCE:
        return None
    red, blue = np.exp(white + beside[::-1]).tolist()
    return replace(colors, ball=PaintColor(red, blue))


def floor_evidence(near_floor_nats: float, green_nats: float, settings: ColoredBallSettings) -> float:
    """Return the log-likelihood ratio of the frame's floor to anything else: carpet all around, and green.

    `green_nats` is the result of `green_evidence`.
    """
    missing = max(settings.floor_nats - near_floor_nats, 0.0) / settings.floor_std
    return settings.max_floor - 0.5 * missing * missing + green_nats


def green_evidence(colors: Colors, settings: ColoredBallSettings) -> float:
    """Return the log-likelihood ratio of carpet to anything else by the greenness of the floor's colour: at most 0."""
    floor, white = colors.floor.lit, colors.line
    # carpet is greener than white under any light, and than grey, because the assumed white may be paint
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


class ColoredLook:
    """Balls of one colour; has scratch memory, so not shared between threads.

    Parameters
    ----------
    field : Field
        Gives the ball's colour; a white ball cannot be distinguished from lines.
    size_px : (int, int)
        Width and height of the frames.
    mask : (H, W) uint8 or None
        Non-zero pixels are never visited.
    """

    def __init__(
        self,
        field: Field,
        size_px: tuple[int, int],
        mask: UInt8Array | None = None,
        settings: ColoredBallSettings = ColoredBallSettings(),
    ) -> None:
        self.settings = settings
        self._has_color = field.ball_color not in ("white", "black")
        width, height = size_px
        # pixels visited in a frame
        self._stamps = np.zeros((height, width), dtype=np.int32)
        if mask is not None:
            self._stamps[mask > 0] = kernel.NEVER
        self._scratch = plain(kernel.Scratch(self._stamps, np.empty(height * width, np.int32), np.empty((2, 6))))
        self._stamp = 0
        self._last_px: list[tuple[float, float, float]] = []
        self._evidence = plain(settings.evidence)
        self._table: ColorTable | None = None
        self._colors: tuple[kernel.BallColor, ...] = ()
        self._swapped_colors: tuple[kernel.BallColor, ...] | None = None
        self._greenness = 0.0
        self._floor_table = kernel.FloorTable(np.empty((3, 256), dtype=np.uint16), np.empty(0, dtype=np.int8))
        self._blobs = np.empty((settings.max_blobs, kernel.COLUMNS))
        self._ratios = np.empty(settings.max_blobs)

    def sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """See `BallLook.sightings`."""
        if not self._has_color or seen.table is None or seen.projection is None:
            return [], None
        self._adopt(seen.table, seen.projection)
        found, self._last_px = self._search(seen, seen.projection.sizes, self._colors, self._last_px)
        return found, seen.projection

    def swapped_sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """Return sightings of balls with red and blue swapped; as `sightings`, but does not change the state."""
        if not self._has_color or seen.table is None or seen.projection is None:
            return [], None
        self._adopt(seen.table, seen.projection)
        if self._swapped_colors is None:
            swapped = with_swapped_ball(seen.table.colors)
            self._swapped_colors = () if swapped is None else self._colors_of(swapped, seen.projection)
        return self._search(seen, seen.projection.sizes, self._swapped_colors, [])[0], seen.projection

    def forget(self) -> None:
        """Forget the balls of the last frame."""
        self._last_px = []

    def _adopt(self, table: ColorTable, projection: BallProjection) -> None:
        if self._table is not table:
            self._table = table
            self._colors = self._colors_of(table.colors, projection)
            self._swapped_colors = None
            self._greenness = green_evidence(table.colors, self.settings)
            self._floor_table = plain(kernel.FloorTable(table.packing, table.floor_llr))

    def _colors_of(self, colors: Colors, projection: BallProjection) -> tuple[kernel.BallColor, ...]:
        return tuple(plain(color) for color in ball_colors(colors, self.settings, projection.white_ratios))

    def _search(
        self,
        seen: BallFrame,
        sizes: BallSizes,
        colors: tuple[kernel.BallColor, ...],
        before: list[tuple[float, float, float]],
    ) -> tuple[list[Sighting], list[tuple[float, float, float]]]:
        """Return the balls of a colour, the most likely first, and their places and sizes in the picture.

        Parameters
        ----------
        colors : tuple of BallColor
            The ball's colour for several positions at which it begins.
        before : list of (float, float, float)
            Places and sizes of balls in the last frame.
        """
        count = 0
        for color in colors:
            count += self._weigh(seen.frame, sizes, color, count)
        places: list[tuple[float, float, float]] = []
        if not count:
            return [], places
        of_floor = floor_evidence(seen.near_floor_nats, self._greenness, self.settings)
        ratios = [ratio + of_floor for ratio in self._ratios[:count].tolist()]
        blobs = self._blobs[:count].tolist()
        found: list[Sighting] = []
        for n in sorted(range(count), key=lambda n: -ratios[n]):
            needed = self.settings.min_log_likelihood_ratio
            if ratios[n] < needed - self.settings.again_nats:
                break
            u, v, along, across, _, cut = blobs[n]
            half_px = math.sqrt(along * across)
            if any(math.hypot(u - other_u, v - other_v) < max(half_px, other) for other_u, other_v, other in places):
                # the same ball by another colour threshold
                continue
            again = self.settings.again_half_sizes
            if any(math.hypot(u - last_u, v - last_v) <= again * last for last_u, last_v, last in before):
                needed -= self.settings.again_nats
            if cut and ratios[n] >= needed:
                ratios[n] += self._cut_evidence(sizes, blobs[n])
            if ratios[n] >= needed:
                ratios[n] += self._upright_evidence(seen.frame, sizes, blobs[n])
            if ratios[n] >= needed:
                places.append((u, v, half_px))
                found.append(self._whole(sizes, u, v, ratios[n]))
        # a ball moves by its own size, of which glare may hide a part
        last = [(u, v, max(half_px, *sizes.at(u, v))) for u, v, half_px in places]
        return sorted(found, key=lambda one: -one.nats), last

    def _weigh(self, frame: UInt8Array, sizes: BallSizes, color: kernel.BallColor, first: int) -> int:
        """Find and weigh the blobs of a colour; fills the rows from `first` on and returns their number."""
        if self._stamp > kernel.NEVER // 2:
            self._stamps[self._stamps != kernel.NEVER] = 0
            self._stamp = 0
        count, self._stamp = find_and_weigh(
            frame,
            sizes.seeds,
            self._scratch,
            self._stamp + 1,
            color,
            sizes.table,
            self._floor_table,
            self._evidence,
            self._blobs[first:],
            self._ratios[first:],
        )
        return int(count)

    def _whole(self, sizes: BallSizes, u: float, v: float, nats: float) -> Sighting:
        """Return the sighting of the whole ball for a blob."""
        visible_ratio = 1.0
        if sizes.are_cut(u, v):
            u, v, visible_ratio, *_ = fit_cut_ball(u, v, *sizes.camera.size_px, sizes.table)
        return Sighting(u, v, self.settings.center_std_px / visible_ratio, nats)

    def _cut_evidence(self, sizes: BallSizes, blob: list[float]) -> float:
        """Return the log-likelihood ratio that a blob at the picture's edge is the visible part of a ball, nats."""
        u, v, visible_ratio, count, *shown = fit_cut_ball(
            blob[kernel.U], blob[kernel.V], *sizes.camera.size_px, sizes.table
        )
        if count < 2:
            return 0.0
        along, across = sizes.at(u, v)
        area = math.pi * along * across * visible_ratio
        measured = (blob[kernel.ALONG], blob[kernel.ACROSS], math.sqrt(blob[kernel.TOTAL]))
        evidence = self.settings.evidence
        nats = 0.0
        for one, expected in zip(measured, (*shown, math.sqrt(max(area, 1.0))), strict=True):
            std = math.hypot(sizes.shape_std, 1.0 / max(expected, 1.0))
            off = math.log(max(one, 0.5) / max(expected, 0.5)) / std
            density = math.exp(-0.5 * off * off) / (std * math.sqrt(math.tau))
            nats += math.log((1 - evidence.outlier_ratio) * density * evidence.shape_span + evidence.outlier_ratio)
        return nats

    def _upright_evidence(self, frame: UInt8Array, sizes: BallSizes, blob: list[float]) -> float:
        """Return nats, at most 0, for upright objects that continue above or below a blob.

        A band of a beacon or post has another band above or below, of the same width, in one colour that differs from
        both sides. A ball has floor at its foot; a line towards it is narrower, and one across it is wider.
        """
        settings, middle = self.settings, (blob[kernel.U], blob[kernel.V])
        up_u, up_v = middle[0] - sizes.axis_px[0], middle[1] - sizes.axis_px[1]
        length = math.hypot(up_u, up_v)
        # glare and shade may hide a part of the ball, so the continuation is tested beyond its whole size
        along, across = sizes.at(*middle)
        halves = max(blob[kernel.ALONG], along), max(blob[kernel.ACROSS], across)
        step, spreads = settings.min_upright_step, settings.upright_spreads
        up = up_u / length, up_v / length
        count = count_upright(frame, middle, halves, up, self._floor_table, step, spreads)
        return int(count) * settings.upright_nats
