"""Compiled log-likelihood ratios of blobs: ball against any other object of the ball's colour.

Each measurement adds its own ratio. Mixtures with outliers bound what one measurement can cost, because a ball may be
partly hidden or touch an object of its colour.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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


class BallEvidence(NamedTuple):
    """Distributions of the measurements of balls, and of clutter of the ball's colour.

    Continuous measurements are normal for a ball and uniform for clutter. Counts of places are binomial for both.

    Parameters
    ----------
    outlier_ratio : float
        Probability that a measurement of a ball is an outlier.
    size_span, shape_span, fill_span : float
        Widths of the uniform densities: of the logarithms of size, slenderness and filled part of the ellipse.
    size_px, shape_px : float
        Errors of a blob's half sizes by whole pixels and blur.
    fill_std, fill_px : float
        Standard deviation of the logarithm of the filled part, and its increase by one over the half size, pixels.
    rim_pixels : float
        Number of neighbouring places that count as one independent place.
    inside_ball, inside_clutter : float
        Probability that a place inside the rim has the hue.
    outside_ball, outside_clutter : float
        Probability that a place outside the rim has the hue.
    near_ball, near_clutter : float
        Probability that a place outside the rim on the robot's side shows floor.
    far_ball, far_clutter : float
        The same on the far side, where boards or robots may be.
    clear_stds, clear_slope, murky_slope, min_clear, max_clear : float
        The contrast is the difference between the hues inside and outside, in units of the spread outside. `clear_stds`
        is neutral; the slopes are nats for each unit above and below; the nats are clipped to the bounds.
    pure_slope, pure_ratio, max_pure : float
        Nats for each unit by which the hue inside is farther than `pure_ratio` on the way from white to the ball's
        colour, and their bound. Pale colours are common in clutter.
    hue_noise : float
        Spread of hues that noise alone causes.
    """

    outlier_ratio: float = 0.05
    size_span: float = 6.0
    shape_span: float = 3.0
    fill_span: float = 2.0
    size_px: float = 0.5
    shape_px: float = 0.4
    fill_std: float = 0.08
    fill_px: float = 0.25
    rim_pixels: float = 3.0
    inside_ball: float = 0.95
    inside_clutter: float = 0.6
    outside_ball: float = 0.03
    outside_clutter: float = 0.15
    near_ball: float = 0.8
    near_clutter: float = 0.5
    far_ball: float = 0.5
    far_clutter: float = 0.45
    clear_stds: float = 3.0
    clear_slope: float = 0.8
    murky_slope: float = 2.0
    min_clear: float = -4.0
    max_clear: float = 3.0
    pure_slope: float = 6.0
    pure_ratio: float = 0.5
    max_pure: float = 1.5
    hue_noise: float = 0.03


@compiled
def find_and_weigh(
    frame: UInt8Array,
    seeds: Int32Array,
    scratch: Scratch,
    first_stamp: int,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    evidence: BallEvidence,
    blobs: FloatArray,
    ratios: FloatArray,
) -> tuple[int, int]:
    """Call `find_blobs`, whose result it returns, then `weigh_blobs`; fills `blobs` and `ratios`.

    The named tuples may be plain ones.
    """
    scratch, color, size = Scratch(*scratch), BallColor(*color), BallSize(*size)
    table, evidence = FloorTable(*table), BallEvidence(*evidence)
    count, stamp = find_blobs(frame, seeds, scratch, first_stamp, color, size, blobs)
    if count > 0:
        weigh_blobs(frame, blobs[:count], color, size, table, evidence, ratios)
    return count, stamp


@compiled(inline="always")
def weigh_blobs(
    frame: UInt8Array,
    blobs: FloatArray,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    evidence: BallEvidence,
    out: FloatArray,
) -> None:
    """Compute the log-likelihood ratio of each blob.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    blobs : (N, COLUMNS) float64
        As `find_blobs` fills them.
    color, size, table
        Appearance of a ball and of the floor.
    evidence : BallEvidence
        Distributions of the measurements.
    out : (N,) float64
        Filled with the log-likelihood ratios, nats.
    """
    rim = np.empty(_AROUND)
    for n in range(blobs.shape[0]):
        blob = blobs[n]
        x, y = blob[U] - size.axis_u, blob[V] - size.axis_v
        radius = math.sqrt(x * x + y * y)
        index = int(radius + 0.5)
        a, t = size.along_px[index], size.across_px[index]
        llr = _rim_llr(frame, blob, color, size, table, evidence, rim)
        log_std, half_px = size.log_std[index], max(math.sqrt(a * t), 0.5)
        measured_px = max(math.sqrt(blob[ALONG] * blob[ACROSS]), 0.5)
        fill = math.log(blob[TOTAL] / (math.pi * blob[ALONG] * blob[ACROSS] + 1e-9) + 1e-9)
        # an ellipse has a filled part of one; pixels of the outline add a little
        fill_std = evidence.fill_std + evidence.fill_px / measured_px
        llr += _normal_llr(min(fill + 0.03, 0.0), fill_std, evidence.fill_span, evidence.outlier_ratio)
        if blob[CUT] == 0.0:
            size_std = math.sqrt(log_std**2 + (evidence.size_px / half_px) ** 2)
            by_hue = math.log(measured_px / math.sqrt((a + 0.2) * (t + 0.2)))
            by_floor = math.log(max(_floor_distance(frame, blob, color, size, table), 0.1))
            # glare and compression change the colour of a part of a small ball: the floor around it also gives its size
            by_hue = _normal_llr(by_hue, size_std, evidence.size_span, evidence.outlier_ratio)
            by_floor = _normal_llr(by_floor, size_std, evidence.size_span, evidence.outlier_ratio)
            llr += max(by_hue, by_floor - math.log(2.0))
            shape_std = math.sqrt(size.shape_std**2 + 2.0 * (evidence.shape_px / measured_px) ** 2)
            slender = math.log((blob[ALONG] + 0.1) / (blob[ACROSS] + 0.1)) - math.log(a / t)
            llr += _normal_llr(slender, shape_std, evidence.shape_span, evidence.outlier_ratio)
        out[n] = llr


@compiled
def _normal_llr(x: float, std: float, span: float, outliers: float) -> float:
    """Log-likelihood ratio of a normal density with outliers against a uniform density over a span."""
    density = math.exp(-0.5 * (x / std) ** 2) / (std * math.sqrt(2.0 * math.pi))
    return math.log((1.0 - outliers) * density * span + outliers)


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
    evidence: BallEvidence,
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
    llr = _count_llr(hued, inside, evidence.inside_ball, evidence.inside_clutter)
    llr += _count_llr(like, outside, evidence.outside_ball, evidence.outside_clutter)
    llr += _count_llr(near_floor, near, evidence.near_ball, evidence.near_clutter)
    llr += _count_llr(far_floor, far, evidence.far_ball, evidence.far_clutter)
    llr /= evidence.rim_pixels
    if unclipped == 0 or outside < 4:
        return float(llr)
    hue_inside /= unclipped
    pure = color.plane_ratio + math.asin(min(max(hue_inside, -1.0), 1.0)) / color.apart_rad
    nats = evidence.pure_slope * (pure - evidence.pure_ratio)
    llr += min(max(nats, -evidence.max_pure), evidence.max_pure)
    # quartiles are robust against a line, a board or a robot beside the ball
    around = rim[:outside]
    sort(around)
    low, middle, high = around[outside // 4], around[outside // 2], around[(3 * outside) // 4]
    clear = (hue_inside - middle) / ((high - low) / 1.35 + evidence.hue_noise)
    slope = evidence.clear_slope if clear >= evidence.clear_stds else evidence.murky_slope
    nats = slope * (clear - evidence.clear_stds)
    return float(llr + min(max(nats, evidence.min_clear), evidence.max_clear))


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
