"""Compiled log-likelihood ratios of blobs: ball against any other object of the ball's colour.

Each measurement adds its own ratio. Mixtures with outliers bound what one measurement can cost, because a ball may be
partly hidden or touch an object of its colour.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import sort, sorted_median
from robocup_vision.kernels.balls.blobs import (
    ACROSS,
    ALONG,
    CLIPPED,
    CUT,
    TOTAL,
    BallColor,
    BallSize,
    FloorTable,
    Scratch,
    U,
    V,
    find_blobs,
    has_hue,
)

# number of sample places around a blob's rim, inside and outside
_AROUND = 16
# outside places: half sizes and pixels from the centre, just beyond the rim and its blur
_RIM_RATIO, _RIM_PX = 1.35, 2.0
# inside places: half sizes, minus pixels
_IN_RATIO, _IN_PX = 0.8, 0.7
# greatest distance at which the floor around is searched, in expected half sizes
_MAX_REACH = 3.0
# added to the brightness, because the hue of dark pixels is noise
_DARK = 10.0
# distributions of the measurements of balls and of clutter of the ball's colour: continuous ones are normal for a ball
# and uniform for clutter, and counts of places are binomial for both
# probability that a measurement of a ball is an outlier
OUTLIER_RATIO = 0.05
# widths of the uniform densities: of the logarithms of size, slenderness and filled part of the ellipse
_SIZE_SPAN, SHAPE_SPAN, _FILL_SPAN = 6.0, 3.0, 2.0
# errors of a blob's half sizes by whole pixels and blur, and by them of its slenderness
_SIZE_PX, _SHAPE_PX = 0.5, 0.4
# standard deviation of the logarithm of the filled part, and its increase by one over the half size, pixels
_FILL_STD, _FILL_PX = 0.08, 0.25
# number of neighbouring places that count as one independent place
_RIM_PIXELS = 3.0
# probabilities for ball and clutter that a place inside the rim, or outside, has the hue
_HUED_INSIDE, _HUED_OUTSIDE = (0.95, 0.6), (0.03, 0.15)
# probabilities for ball and clutter that a place outside the rim shows floor: on the robot's side, and on the far side,
# where boards or robots may be
_NEAR_FLOOR, _FAR_FLOOR = (0.8, 0.5), (0.5, 0.45)
# the contrast is the difference between the hues inside and outside, in units of the spread outside: the neutral one,
# nats for each unit above and below it, and the bounds of the nats
_CLEAR_STDS, _CLEAR_SLOPE, _MURKY_SLOPE, _MIN_CLEAR, _MAX_CLEAR = 3.0, 0.8, 2.0, -4.0, 3.0
# nats for each unit by which the hue inside is farther than a ratio of the way from white to the ball's colour, that
# ratio, and the bound of the nats, because pale colours are common in clutter
_PURE_SLOPE, _PURE_RATIO, _MAX_PURE = 6.0, 0.5, 1.5
# spread of hues that noise alone causes
_HUE_NOISE = 0.03


@compiled
def find_and_weigh(
    frame: UInt8Array,
    seeds: Int32Array,
    scratch: Scratch,
    first_stamp: int,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    blobs: FloatArray,
    ratios: FloatArray,
) -> tuple[int, int]:
    """Call `find_blobs`, whose result it returns, then `weigh_blobs`; fills `blobs` and `ratios`.

    The named tuples may be plain ones.
    """
    scratch, color, size, table = Scratch(*scratch), BallColor(*color), BallSize(*size), FloorTable(*table)
    count, stamp = find_blobs(frame, seeds, scratch, first_stamp, color, size, blobs)
    if count > 0:
        weigh_blobs(frame, blobs[:count], color, size, table, ratios)
    return count, stamp


@compiled(inline="always")
def weigh_blobs(
    frame: UInt8Array,
    blobs: FloatArray,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    out: FloatArray,
) -> None:
    """Write the log-likelihood ratio (N,) of each blob (N, COLUMNS), nats."""
    rim = np.empty(_AROUND)
    for n in range(blobs.shape[0]):
        blob = blobs[n]
        x, y = blob[U] - size.axis_u, blob[V] - size.axis_v
        radius = math.sqrt(x * x + y * y)
        index = int(radius + 0.5)
        a, t = size.along_px[index], size.across_px[index]
        llr = _rim_llr(frame, blob, color, size, table, rim)
        log_std, half_px = size.log_std[index], max(math.sqrt(a * t), 0.5)
        measured_px = max(math.sqrt(blob[ALONG] * blob[ACROSS]), 0.5)
        fill = math.log(blob[TOTAL] / (math.pi * blob[ALONG] * blob[ACROSS] + 1e-9) + 1e-9)
        # an ellipse has a filled part of one; pixels of the outline add a little
        fill_std = _FILL_STD + _FILL_PX / measured_px
        llr += _normal_llr(min(fill + 0.03, 0.0), fill_std, _FILL_SPAN)
        if blob[CUT] == 0.0:
            size_std = math.sqrt(log_std**2 + (_SIZE_PX / half_px) ** 2)
            by_hue = math.log(measured_px / math.sqrt((a + 0.2) * (t + 0.2)))
            by_floor = math.log(max(_floor_distance(frame, blob, color, size, table), 0.1))
            # glare and compression change the colour of a part of a small ball: the floor around it also gives its size
            by_hue = _normal_llr(by_hue, size_std, _SIZE_SPAN)
            by_floor = _normal_llr(by_floor, size_std, _SIZE_SPAN)
            llr += max(by_hue, by_floor - math.log(2.0))
            shape_std = math.sqrt(size.shape_std**2 + 2.0 * (_SHAPE_PX / measured_px) ** 2)
            slender = math.log((blob[ALONG] + 0.1) / (blob[ACROSS] + 0.1)) - math.log(a / t)
            llr += _normal_llr(slender, shape_std, SHAPE_SPAN)
        out[n] = llr


@compiled
def _normal_llr(x: float, std: float, span: float) -> float:
    """Log-likelihood ratio of a normal density with outliers against a uniform density over a span."""
    density = math.exp(-0.5 * (x / std) ** 2) / (std * math.sqrt(2.0 * math.pi))
    return math.log((1.0 - OUTLIER_RATIO) * density * span + OUTLIER_RATIO)


@compiled
def _count_llr(hits: int, places: int, ball: float, clutter: float) -> float:
    """Log-likelihood ratio of two binomial distributions."""
    return hits * math.log(ball / clutter) + (places - hits) * math.log((1.0 - ball) / (1.0 - clutter))


@compiled
def _hue_of(color: BallColor, blue: float, green: float, red: float) -> float:
    """Return how far a colour lies from white towards the ball's: the sine of an angle."""
    w = color.from_white
    length = math.sqrt(blue * blue + green * green + red * red + _DARK * _DARK)
    return float((w[0] * blue + w[1] * green + w[2] * red) / length)


@compiled
def _rim_llr(
    frame: UInt8Array,
    blob: FloatArray,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    rim: FloatArray,
) -> float:
    """Log-likelihood ratio of the places inside and outside the rim: hue inside, no hue outside, floor around."""
    height, width = frame.shape[0], frame.shape[1]
    x, y = blob[U] - size.axis_u, blob[V] - size.axis_v
    radius = math.sqrt(x * x + y * y)
    ex, ey = x / radius, y / radius
    f = color.from_floor
    inside, unclipped, hued, outside, like = 0, 0, 0, 0, 0
    near, near_floor, far, far_floor = 0, 0, 0, 0
    hue_inside = 0.0
    for k in range(_AROUND):
        cos, sin = math.cos(2.0 * math.pi * k / _AROUND), math.sin(2.0 * math.pi * k / _AROUND)
        along = max(_IN_RATIO * blob[ALONG] - _IN_PX, 0.0) * cos
        aside = max(_IN_RATIO * blob[ACROSS] - _IN_PX, 0.0) * sin
        u = int(blob[U] + along * ex - aside * ey + 0.5)
        v = int(blob[V] + along * ey + aside * ex + 0.5)
        if u >= 0 and v >= 0 and u < width and v < height:
            blue, green, red = float(frame[v, u, 0]), float(frame[v, u, 1]), float(frame[v, u, 2])
            hue = _hue_of(color, blue, green, red)
            inside += 1
            # with two clipped channels the hue is unknown
            if blue + green + red - max(blue, green, red) - min(blue, green, red) < CLIPPED:
                unclipped += 1
                hue_inside += hue
            # single pixels are noisy: any hue on the ball's side counts
            if (hue > 0.0 and f[0] * blue + f[1] * green + f[2] * red > 0.0) or has_hue(color, blue, green, red):
                hued += 1
        along = (_RIM_RATIO * blob[ALONG] + _RIM_PX) * cos
        aside = (_RIM_RATIO * blob[ACROSS] + _RIM_PX) * sin
        u = int(blob[U] + along * ex - aside * ey + 0.5)
        v = int(blob[V] + along * ey + aside * ex + 0.5)
        if u < 1 or v < 1 or u >= width - 1 or v >= height - 1:
            continue
        if (u - size.axis_u) ** 2 + (v - size.axis_v) ** 2 < (size.body_px + 2.0) ** 2:
            continue
        blue_sum, green_sum, red_sum = 0, 0, 0
        for nv in range(v - 1, v + 2):
            for nu in range(u - 1, u + 2):
                blue_sum += frame[nv, nu, 0]
                green_sum += frame[nv, nu, 1]
                red_sum += frame[nv, nu, 2]
        mean_blue, mean_green, mean_red = blue_sum // 9, green_sum // 9, red_sum // 9
        blue, green, red = float(mean_blue), float(mean_green), float(mean_red)
        rim[outside] = _hue_of(color, blue, green, red)
        outside += 1
        is_floor = False
        if has_hue(color, blue, green, red):
            like += mean_blue + mean_green + mean_red >= color.min_level
        else:
            packed = table.packing[0, mean_blue] + table.packing[1, mean_green] + table.packing[2, mean_red]
            is_floor = table.floor_llr[packed] > 0
        if cos < 0.01:
            near += 1
            near_floor += is_floor
        else:
            far += 1
            far_floor += is_floor
    llr = _count_llr(hued, inside, *_HUED_INSIDE)
    llr += _count_llr(like, outside, *_HUED_OUTSIDE)
    llr += _count_llr(near_floor, near, *_NEAR_FLOOR)
    llr += _count_llr(far_floor, far, *_FAR_FLOOR)
    llr /= _RIM_PIXELS
    if unclipped == 0 or outside < 4:
        return float(llr)
    hue_inside /= unclipped
    pure = color.plane_ratio + math.asin(min(max(hue_inside, -1.0), 1.0)) / color.apart_rad
    nats = _PURE_SLOPE * (pure - _PURE_RATIO)
    llr += min(max(nats, -_MAX_PURE), _MAX_PURE)
    # quartiles are robust against a line, a board or a robot beside the ball
    around = rim[:outside]
    sort(around)
    low, middle, high = around[outside // 4], around[outside // 2], around[(3 * outside) // 4]
    clear = (hue_inside - middle) / ((high - low) / 1.35 + _HUE_NOISE)
    slope = _CLEAR_SLOPE if clear >= _CLEAR_STDS else _MURKY_SLOPE
    nats = slope * (clear - _CLEAR_STDS)
    return float(llr + min(max(nats, _MIN_CLEAR), _MAX_CLEAR))


@compiled
def _floor_distance(frame: UInt8Array, blob: FloatArray, color: BallColor, size: BallSize, table: FloorTable) -> float:
    """Median distance from the centre to the floor, towards the robot and aside, in expected half sizes."""
    height, width = frame.shape[0], frame.shape[1]
    x, y = blob[U] - size.axis_u, blob[V] - size.axis_v
    radius = math.sqrt(x * x + y * y)
    ex, ey = x / radius, y / radius
    index = int(radius + 0.5)
    a, t = size.along_px[index], size.across_px[index]
    step = max(0.5 / max(a, t), 0.08)
    reached = np.empty(_AROUND)
    count = 0
    for k in range(_AROUND):
        cos, sin = math.cos(2.0 * math.pi * k / _AROUND), math.sin(2.0 * math.pi * k / _AROUND)
        if cos > 0.3:
            continue
        reach, run, found = 0.0, 0, _MAX_REACH
        while reach < _MAX_REACH:
            along, aside = reach * a * cos, reach * t * sin
            u = int(blob[U] + along * ex - aside * ey + 0.5)
            v = int(blob[V] + along * ey + aside * ex + 0.5)
            if u < 0 or v < 0 or u >= width or v >= height:
                break
            blue, green, red = frame[v, u, 0], frame[v, u, 1], frame[v, u, 2]
            packed = table.packing[0, blue] + table.packing[1, green] + table.packing[2, red]
            run = (
                run + 1
                if table.floor_llr[packed] > 0 and not has_hue(color, float(blue), float(green), float(red))
                else 0
            )
            if run == 2:
                found = reach - step
                break
            reach += step
        reached[count] = found
        count += 1
    return sorted_median(reached[:count])
