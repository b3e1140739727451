"""Search for balls of one colour: blobs of that colour, each with its likelihood ratio."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls import blobs as kernel
from robocup_vision.kernels.balls.cut_ball import fit_cut_ball
from robocup_vision.kernels.balls.evidence import OUTLIER_RATIO, SHAPE_SPAN, find_and_weigh
from robocup_vision.kernels.balls.upright import count_upright
from robocup_vision.perception.balls.ball import Sighting
from robocup_vision.perception.balls.projection import BallFrame, BallProjection, Sightings
from robocup_vision.perception.balls.sizes import BallSizes
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.floor_color import PaintColor

# least difference, in logarithms of R/G and B/G, of a ball's colour from that with red and blue swapped
_MIN_SWAP_DISTANCE = 0.5
# noise of a pixel relative to that of a polar sample, which is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# beyond this log(1 + exp(x)) equals x, and the exponential may overflow
_MAX_EXPONENT = 50.0
# least log-likelihood ratio of a ball, given some hundred objects of its colour in a frame
_MIN_LOG_LIKELIHOOD_RATIO = 6.5
# decrease of that near balls of the last frame, and its radius in half sizes, because balls stay and few other objects
# are that near
_AGAIN_NATS, _AGAIN_HALF_SIZES = 3.0, 8.0
# greatest number of blobs, for pictures full of the ball's colour
_MAX_BLOBS = 128
# margin of the ball's colour from white, standard deviations of the noise, because dark grey has any hue in noise
_WHITE_NOISE_STDS = 0.5
# position between white and the ball's colour at which it begins for clipped pixels: an overexposed ball is nearly
# white
_CLIPPED_RATIO = 0.15
# margin of the ball's colour from the floor's, standard deviations of the noise
_FLOOR_STDS = 3.5
# brightness of the ball's shaded side, sum of its channels, relative to the lit floor
_MIN_LEVEL = 0.6
# least difference of a blob from the floor, standard deviations
_MIN_SIGNAL = 4.0
# mean log-likelihood ratio of a near floor that is all carpet; standard deviation of its decrease by robots and walls;
# nats for a frame with such a floor
_FLOOR_NATS, _FLOOR_STD, MAX_FLOOR = 3.0, 0.7, 1.0
# scale, a logarithm, by which carpet is greener than grey and than the frame's white; cost of each unit less
_GREEN_SCALE, _GREEN_NATS = 0.025, 2.0
# standard deviation of the blob's centre
_CENTER_STD_PX = 0.3
# nats for each side, above and below a blob, on which an upright object continues
_UPRIGHT_NATS = -2.5


def ball_colors(colors: Colors, white_ratios: tuple[float, ...]) -> tuple[kernel.BallColor, ...]:
    """Return the ball's colour for several positions between white and it at which it begins, without duplicates."""
    found = [_ball_color(colors, ratio) for ratio in white_ratios]
    return tuple(one for n, one in enumerate(found) if n == 0 or one.plane_ratio < found[n - 1].plane_ratio)


def _ball_color(colors: Colors, min_ratio: float) -> kernel.BallColor:
    """Return the planes between the ball's colour and white and floor, and the least brightness and signal."""
    ball, floor, white = (_direction(color) for color in (colors.ball, colors.floor.lit, colors.line))
    raw_noise = _RAW_NOISE * colors.floor.noise
    # a small ball is mixed with floor everywhere, so the plane is as near to the floor's colour as noise allows
    floor_counts = 4 * colors.floor.level / float(floor @ [1.0, 2.0, 1.0])
    apart = math.acos(min(1.0, float(ball @ floor)))
    noise_ratio = _FLOOR_STDS * raw_noise / floor_counts / max(apart, 1e-3)
    ratio = min(0.5, max(1 / 3, noise_ratio))
    from_floor = _plane(ball, floor, ratio)
    white_ratio = min(0.5, max(min_ratio, noise_ratio))
    min_level = _MIN_LEVEL * colors.floor.level
    on_dark_ball = min_level * float(np.dot(from_floor, ball) / ball.sum())
    beside_white = np.log(ball / white)
    weak, middle, _ = (int(channel) for channel in np.argsort(beside_white, kind="stable"))
    fall = _CLIPPED_RATIO * float(beside_white[weak] - beside_white[middle])
    return kernel.BallColor(
        from_white=_plane(ball, white, white_ratio),
        from_floor=from_floor,
        half_white=_plane(ball, white, 0.5),
        plane_ratio=white_ratio,
        apart_rad=max(math.acos(min(1.0, float(ball @ white))), 1e-3),
        min_hue=_WHITE_NOISE_STDS * raw_noise,
        weak=weak,
        middle=middle,
        clipped_ratio=float(white[weak] / white[middle]) * math.exp(fall),
        min_level=min_level,
        sure=on_dark_ball,
        min_signal=_MIN_SIGNAL * raw_noise,
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


def floor_evidence(near_floor_nats: float, green_nats: float) -> float:
    """Return the log-likelihood ratio of the frame's floor to anything else: carpet all around, and green.

    `green_nats` is the result of `green_evidence`.
    """
    missing = max(_FLOOR_NATS - near_floor_nats, 0.0) / _FLOOR_STD
    return MAX_FLOOR - 0.5 * missing * missing + green_nats


def green_evidence(colors: Colors) -> float:
    """Return the log-likelihood ratio of carpet to anything else by the greenness of the floor's colour: at most 0."""
    floor, white = colors.floor.lit, colors.line
    # carpet is greener than white under any light, and than grey, because the assumed white may be paint
    ratios = (floor.red_ratio, floor.blue_ratio, floor.red_ratio / white.red_ratio, floor.blue_ratio / white.blue_ratio)
    green = -math.log(max(ratios))
    return -_GREEN_NATS * math.log1p(math.exp(min(-green / _GREEN_SCALE, _MAX_EXPONENT)))


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

    def __init__(self, field: Field, size_px: tuple[int, int], mask: UInt8Array | None = None) -> None:
        self._has_color = field.ball_color not in ("white", "black")
        width, height = size_px
        # pixels visited in a frame
        self._stamps = np.zeros((height, width), dtype=np.int32)
        if mask is not None:
            self._stamps[mask > 0] = kernel.NEVER
        self._scratch = plain(kernel.Scratch(self._stamps, np.empty(height * width, np.int32), np.empty((2, 6))))
        self._stamp = 0
        self._last_px: list[tuple[float, float, float]] = []
        self._table: ColorTable | None = None
        self._colors: tuple[kernel.BallColor, ...] = ()
        self._swapped_colors: tuple[kernel.BallColor, ...] | None = None
        self._greenness = 0.0
        self._floor_table = kernel.FloorTable(np.empty((3, 256), dtype=np.uint16), np.empty(0, dtype=np.int8))
        self._blobs = np.empty((_MAX_BLOBS, kernel.COLUMNS))
        self._ratios = np.empty(_MAX_BLOBS)

    def sightings(self, seen: BallFrame) -> Sightings:
        """Return the sightings of balls in a frame."""
        if not self._has_color or seen.table is None or seen.projection is None:
            return [], None
        self._adopt(seen.table, seen.projection)
        found, self._last_px = self._search(seen, seen.projection.sizes, self._colors, self._last_px)
        return found, seen.projection

    def swapped_sightings(self, seen: BallFrame) -> Sightings:
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
            self._greenness = green_evidence(table.colors)
            self._floor_table = plain(kernel.FloorTable(table.packing, table.floor_llr))

    def _colors_of(self, colors: Colors, projection: BallProjection) -> tuple[kernel.BallColor, ...]:
        return tuple(plain(color) for color in ball_colors(colors, projection.white_ratios))

    def _search(
        self,
        seen: BallFrame,
        sizes: BallSizes,
        colors: tuple[kernel.BallColor, ...],
        before: list[tuple[float, float, float]],
    ) -> tuple[list[Sighting], list[tuple[float, float, float]]]:
        """Return the balls of a colour, the most likely first, and their places and sizes in the picture.

        `colors` has the colour for each position at which it begins, and `before` the last frame's places and sizes.
        """
        count = 0
        for color in colors:
            count += self._weigh(seen.frame, sizes, color, count)
        places: list[tuple[float, float, float]] = []
        if not count:
            return [], places
        of_floor = floor_evidence(seen.near_floor_nats, self._greenness)
        ratios = [ratio + of_floor for ratio in self._ratios[:count].tolist()]
        blobs = self._blobs[:count].tolist()
        found: list[Sighting] = []
        for n in sorted(range(count), key=lambda n: -ratios[n]):
            needed = _MIN_LOG_LIKELIHOOD_RATIO
            if ratios[n] < needed - _AGAIN_NATS:
                break
            u, v, along, across, _, cut = blobs[n]
            half_px = math.sqrt(along * across)
            if any(math.hypot(u - other_u, v - other_v) < max(half_px, other) for other_u, other_v, other in places):
                # the same ball by another colour threshold
                continue
            if any(math.hypot(u - last_u, v - last_v) <= _AGAIN_HALF_SIZES * last for last_u, last_v, last in before):
                needed -= _AGAIN_NATS
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
            self._blobs[first:],
            self._ratios[first:],
        )
        return int(count)

    def _whole(self, sizes: BallSizes, u: float, v: float, nats: float) -> Sighting:
        """Return the sighting of the whole ball for a blob."""
        visible_ratio = 1.0
        if sizes.are_cut(u, v):
            u, v, visible_ratio, *_ = fit_cut_ball(u, v, *sizes.camera.size_px, sizes.table)
        return Sighting(u, v, _CENTER_STD_PX / visible_ratio, nats)

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
        nats = 0.0
        for one, expected in zip(measured, (*shown, math.sqrt(max(area, 1.0))), strict=True):
            std = math.hypot(sizes.shape_std, 1.0 / max(expected, 1.0))
            off = math.log(max(one, 0.5) / max(expected, 0.5)) / std
            density = math.exp(-0.5 * off * off) / (std * math.sqrt(math.tau))
            nats += math.log((1 - OUTLIER_RATIO) * density * SHAPE_SPAN + OUTLIER_RATIO)
        return nats

    def _upright_evidence(self, frame: UInt8Array, sizes: BallSizes, blob: list[float]) -> float:
        """Return nats, at most 0, for upright objects that continue above or below a blob.

        A band of a beacon or post has another band above or below, of the same width, in one colour that differs from
        both sides. A ball has floor at its foot; a line towards it is narrower, and one across it is wider.
        """
        middle = blob[kernel.U], blob[kernel.V]
        up_u, up_v = middle[0] - sizes.axis_px[0], middle[1] - sizes.axis_px[1]
        length = math.hypot(up_u, up_v)
        # glare and shade may hide a part of the ball, so the continuation is tested beyond its whole size
        along, across = sizes.at(*middle)
        halves = max(blob[kernel.ALONG], along), max(blob[kernel.ACROSS], across)
        up = up_u / length, up_v / length
        count = count_upright(frame, middle, halves, up, self._floor_table)
        return int(count) * _UPRIGHT_NATS
