"""Balls of one colour: blobs of it, each judged by its evidence."""

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

# a ball whose logarithms of R/G and B/G change by less cannot be distinguished from one with red and blue swapped
_MIN_SWAP_DISTANCE = 0.5
# a polar sample is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# beyond it the logarithm of 1 + exp(x) is x, and the exponential may overflow
_MAX_EXPONENT = 50.0


@dataclass(frozen=True, slots=True)
class ColoredBallSettings:
    """What the search for coloured balls can be tuned by."""

    evidence: BallEvidence = field(default_factory=BallEvidence)  #: what a ball looks like, and everything else
    #: a find with less is no ball: of some hundred things of its colour in a frame none may pass by chance
    min_log_likelihood_ratio: float = 6.5
    #: it may be so much less where the last frame showed a ball within so many half sizes: balls stay, and of the
    #: hundred things few are so near
    again_nats: float = 3.0
    again_half_sizes: float = 8.0
    max_blobs: int = 128  #: more are not looked at: a picture full of the ball's colour
    #: so many standard deviations of the noise beyond where it begins on the way from white is the ball's colour: dark
    #: grey has any hue in noise
    white_noise_stds: float = 0.5
    #: where on the way from white it begins where a channel is at its end, by the others: a ball burnt out by a lamp is
    #: nearly white
    clipped_ratio: float = 0.15
    #: standard deviations by which floor seldom differs from itself: the ball's colour begins beyond
    floor_stds: float = 3.5
    min_level: float = 0.6  #: brightness of the ball's shaded side, sum of its channels, as a ratio of the lit floor's
    min_signal: float = 4.0  #: standard deviations by which a blob must differ from the floor
    #: mean log-likelihood ratio from which on the floor near the robot is all carpet; how far, as a standard deviation,
    #: robots and walls let it fall; nats of a frame with such a floor. Photographs of anything have 1.3 (median), of
    #: fields 3 to 4; of rendered frames in a crowd one in ten has less than 1.5.
    floor_nats: float = 3.0
    floor_std: float = 0.7
    max_floor: float = 1.0
    #: carpet is greener than grey and than the frame's white by some times the first, a logarithm; each time that it is
    #: less green costs the second. The greyest carpet of the photographs has 1.5 times the first.
    green_scale: float = 0.025
    green_nats: float = 2.0
    center_std_px: float = 0.3  #: of the blob's centre
    #: something upright goes on above a blob, or below it, where what is as wide as it differs from what lies to both
    #: sides by so many levels, and by so many times what differs in it; what that costs
    min_upright_step: float = 15.0
    upright_spreads: float = 2.0
    upright_nats: float = -2.5


def ball_colors(
    colors: Colors, settings: ColoredBallSettings, white_ratios: tuple[float, ...]
) -> tuple[kernel.BallColor, ...]:
    """Return what is of the ball's colour, from so far on the way from white on; noise may make several the same."""
    found = [_ball_color(colors, settings, ratio) for ratio in white_ratios]
    return tuple(one for n, one in enumerate(found) if n == 0 or one.plane_ratio < found[n - 1].plane_ratio)


def _ball_color(colors: Colors, settings: ColoredBallSettings, min_ratio: float) -> kernel.BallColor:
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


def floor_evidence(near_floor_nats: float, green_nats: float, settings: ColoredBallSettings) -> float:
    """Return how much more likely the frame shows a ball's floor than anything: carpet all around, and it is green.

    The second is what `green_evidence` tells of the frame's colours.
    """
    missing = max(settings.floor_nats - near_floor_nats, 0.0) / settings.floor_std
    return settings.max_floor - 0.5 * missing * missing + green_nats


def green_evidence(colors: Colors, settings: ColoredBallSettings) -> float:
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


class ColoredLook:
    """Balls of one colour; holds scratch memory, so one object a thread.

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
        # pixels that were visited in a frame
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
        """Return what looks like balls whose red and blue are swapped; as `sightings`, but nothing is remembered."""
        if not self._has_color or seen.table is None or seen.projection is None:
            return [], None
        self._adopt(seen.table, seen.projection)
        if self._swapped_colors is None:
            swapped = with_swapped_ball(seen.table.colors)
            self._swapped_colors = () if swapped is None else self._colors_of(swapped, seen.projection)
        return self._search(seen, seen.projection.sizes, self._swapped_colors, [])[0], seen.projection

    def forget(self) -> None:
        """Forget where balls were in the last frame."""
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
                # the same ball, at another threshold of its colour
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
        # glare leaves a part of a ball its colour: it moves by its own size
        last = [(u, v, max(half_px, *sizes.at(u, v))) for u, v, half_px in places]
        return sorted(found, key=lambda one: -one.nats), last

    def _weigh(self, frame: UInt8Array, sizes: BallSizes, color: kernel.BallColor, first: int) -> int:
        """Find and weigh the blobs of a colour, into the rows from `first` on, and return their number."""
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
        """Return the whole ball of which the picture shows a blob."""
        visible_ratio = 1.0
        if sizes.are_cut(u, v):
            u, v, visible_ratio, *_ = fit_cut_ball(u, v, *sizes.camera.size_px, sizes.table)
        return Sighting(u, v, self.settings.center_std_px / visible_ratio, nats)

    def _cut_evidence(self, sizes: BallSizes, blob: list[float]) -> float:
        """Weigh how well a blob at the picture's edge is the part of a ball that it would show: nats."""
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
        """Weigh whether a blob is a part of something upright that goes on above or below it: nats, 0 or less.

        A band of a beacon or post has the next band above, and below. Such a band is as wide as the blob, of one
        colour, and another than what lies to both sides. A ball has floor at its foot; a line that runs towards it is
        narrower, one across it goes on to both sides.
        """
        settings, middle = self.settings, (blob[kernel.U], blob[kernel.V])
        up_u, up_v = middle[0] - sizes.axis_px[0], middle[1] - sizes.axis_px[1]
        length = math.hypot(up_u, up_v)
        # glare and shade leave a part of a ball its colour: what goes on must go on beyond the whole of it
        along, across = sizes.at(*middle)
        halves = max(blob[kernel.ALONG], along), max(blob[kernel.ACROSS], across)
        step, spreads = settings.min_upright_step, settings.upright_spreads
        up = up_u / length, up_v / length
        count = count_upright(frame, middle, halves, up, self._floor_table, step, spreads)
        return int(count) * settings.upright_nats
