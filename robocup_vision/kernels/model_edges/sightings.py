"""Finds coloured beacons and posts in a picture without a prior, with their bearing and their size in pixels.

The size puts the camera on a circle about the object, the bearing gives its heading. Neither depends on the tilt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.lens import distorted

SIGHTING_COLUMNS = 8
BINS = 96  # bins of bearing across the picture; each is read in one column
LIKENESS = 0.93  # least cosine between a colour and its paint, both less grey
MIN_RUN_PX = 3  # least height of a band in a column
BLUR_PX = 3  # greatest gap between two bands, where blur mixes their colours
MAX_SIGHTINGS = 12
CUT = 1e4  # stands for a height in pixels that the top of the searched part cuts off
NOD_RAD = 0.06  # greatest error of a foot's place: three standard deviations of the tilt of a walking body


class Uprights(NamedTuple):
    """Coloured beacons and posts of a field, prepared once.

    Parameters
    ----------
    paints : (K, 3) float64
        Unit vectors of their colours less grey: blue, green, red.
    places : (N, 4) float64
        x0, y0, x1, y1, metres: the two places where it may stand, as a post of a goal; else both are the same.
    paint : (N, 2) int64
        Indices of the paints of its upper and lower band; of a post the lower is -1.
    height_m : (N,) float64
        Height of both bands together, or of a post.
    width_m : (N,) float64
        Width of its cylinder, or of a panel.
    weight : (N,) float64
        Weight of its bearing and size, in line points: two bands are seldom anything else, a post's colour often is.
    """

    paints: FloatArray
    places: FloatArray
    paint: Int64Array
    height_m: FloatArray
    width_m: FloatArray
    weight: FloatArray


class Horizon(NamedTuple):
    """Row of the horizon at rest, the camera's height (m), and how far a nod may shift an object's foot (pixels)."""

    row: float
    height_m: float
    slack_px: float


@compiled(error_model="numpy", inline="always")
def _chroma(image: UInt8Array, v: int, u: int) -> tuple[float, float, float, float]:
    """Return a pixel's colour less grey (blue, green, red) and its length; the length is 0 where it is nearly grey."""
    b, g, r = float(image[v, u, 0]), float(image[v, u, 1]), float(image[v, u, 2])
    grey = (b + g + r) / 3.0
    b, g, r = b - grey, g - grey, r - grey
    size = math.sqrt(b * b + g * g + r * r)
    return b, g, r, size if size > 0.35 * grey + 10.0 else 0.0


@compiled(error_model="numpy", inline="always")
def _column_of(i: int, half_view_rad: float, lens: FloatArray) -> int:
    """Return the picture's column in the middle of a bin of bearings."""
    across, _, _, _, _, _ = distorted(lens, -math.tan(half_view_rad * (1.0 - 2.0 * (i + 0.5) / BINS)), 0.0)
    return int(round(lens[2] + lens[0] * across))


@compiled(error_model="numpy", inline="always")
def _paint_of(image: UInt8Array, v: int, u: int, paints: FloatArray) -> int:
    """Return the index of the paint that a pixel shows, -1 for none."""
    b, g, r, size = _chroma(image, v, u)
    if size == 0.0:
        return -1
    for k in range(paints.shape[0]):
        if b * paints[k, 0] + g * paints[k, 1] + r * paints[k, 2] > LIKENESS * size:
            return k
    return -1


@compiled(error_model="numpy")
def _sizes(
    image: UInt8Array,
    u: int,
    top: int,
    bottom: int,
    horizon: Horizon,
    uprights: Uprights,
    sizes: FloatArray,
    column: int,
) -> None:
    """Fill in one column of sizes (N, BINS): each upright's height in pixels in image column u.

    The height is 0 if the upright does not appear between rows `top` and `bottom`, and `CUT` if `top` cuts it off.
    """
    number = uprights.paint.shape[0]
    upper, upper_begin, upper_end = -1, -9, -9
    paint, begin = -1, top
    for v in range(top, bottom + 1):
        now = _paint_of(image, v, u, uprights.paints) if v < bottom else -1
        if now == paint and v < bottom:
            continue
        if paint >= 0 and v - begin >= MIN_RUN_PX:
            for n in range(number):
                size = 0.0
                if uprights.paint[n, 1] < 0:
                    if uprights.paint[n, 0] == paint:
                        size = float(v - begin)
                        below = v - horizon.row
                        if begin == top:
                            size = CUT if below > horizon.slack_px else 0.0
                        elif abs(below - size * horizon.height_m / uprights.height_m[n]) > horizon.slack_px:
                            size = 0.0
                elif uprights.paint[n, 0] == upper and uprights.paint[n, 1] == paint:
                    above, below = upper_end - upper_begin, v - begin
                    if begin - upper_end <= BLUR_PX:
                        if upper_begin == top:
                            size = CUT
                        elif above <= 2 * below and below <= 2 * above:
                            size = float(v - upper_begin)
                sizes[n, column] = max(sizes[n, column], size)
            upper, upper_begin, upper_end = paint, begin, v
        paint, begin = now, v


@compiled(error_model="numpy")
def sightings(
    image: UInt8Array,
    lens: FloatArray,
    horizon: Horizon,
    half_view_rad: float,
    uprights: Uprights,
    out: FloatArray,
) -> int:
    """Find what may be beacons and posts in a picture; returns their number.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    lens : (L,) float64
        See `prediction.predict`.
    horizon : Horizon
        Horizon of the camera.
    half_view_rad : float
        Angle from the optical axis to the left or right border of the picture.
    uprights : Uprights
        Beacons and posts of the field.
    out : (S, 8) float64
        Result: x0, y0, x1, y1 of its two possible places (m), bearing (rad, positive to the left), its height or width
        (m), the same in pixels, and its weight.
    """
    height, width = image.shape[0], image.shape[1]
    top = max(int(horizon.row - 0.45 * height), 0)
    bottom = height
    number = uprights.paint.shape[0]
    if number == 0:
        return 0
    sizes = np.zeros((number, BINS))
    columns = np.zeros(BINS, np.int64)
    for i in range(BINS):
        columns[i] = _column_of(i, half_view_rad, lens)
        if 0 <= columns[i] < width:
            _sizes(image, columns[i], top, bottom, horizon, uprights, sizes, i)
    per_bin_px = 2.0 * half_view_rad / BINS * lens[0]
    count = variable(0)
    for n in range(number):
        i = variable(0)
        while i < BINS:
            if sizes[n, i] == 0.0:
                i += 1
                continue
            # one object has about the same height in all its bins; a goal's bar is much lower than its posts are
            begin, tallest = i, sizes[n, i]
            while i < BINS and sizes[n, i] > 0.6 * tallest:
                tallest = max(tallest, sizes[n, i])
                i += 1
            first, last = begin, i
            while first < last and sizes[n, first] < 0.6 * tallest:
                first += 1
            total = 0.0
            for j in range(first, last):
                total += sizes[n, j]
            size, size_m = total / (last - first), uprights.height_m[n]
            wide_px = (last - first) * per_bin_px
            if tallest == CUT:
                # its width gives its distance if it lies entirely in the picture
                if wide_px < 2 * MIN_RUN_PX or first == 0 or last == BINS:
                    continue
                size, size_m = wide_px, uprights.width_m[n]
            expected_px = size * uprights.width_m[n] / size_m
            if size < 2 * MIN_RUN_PX or wide_px > 2.5 * expected_px + 2.0 * per_bin_px or wide_px < 0.4 * expected_px:
                continue
            if count < out.shape[0]:
                for j in range(4):
                    out[count, j] = uprights.places[n, j]
                out[count, 4] = half_view_rad * (1.0 - (first + last) / BINS)
                out[count, 5], out[count, 6], out[count, 7] = size_m, size, uprights.weight[n]
                count += 1
    return count


@compiled
def poses_around(
    found: FloatArray, focal_px: float, half_m: tuple[float, float], step_m: float, poses: FloatArray
) -> int:
    """Fill in the poses from which each beacon or post has its bearing and size; returns their number.

    Parameters
    ----------
    found : (S, 8) float64
        As `sightings` returns them.
    focal_px : float
        Focal length of the camera.
    half_m : (float, float)
        Greatest |x| and |y| of a pose, metres.
    step_m : float
        Distance of neighbouring poses about the same place.
    poses : (N, 3) float64
        Result: x, y, heading; poses beyond its size are left out.
    """
    count = 0
    for n in range(found.shape[0]):
        bearing, size_m, size_px = found[n, 4], found[n, 5], found[n, 6]
        away_m = size_m * focal_px / (size_px * math.cos(bearing))
        around = max(8, int(math.ceil(2.0 * math.pi * away_m / step_m)))
        is_one = found[n, 0] == found[n, 2] and found[n, 1] == found[n, 3]
        for place in range(1 if is_one else 2):
            for k in range(around):
                turn = 2.0 * math.pi * k / around
                x = found[n, 2 * place] + away_m * math.cos(turn)
                y = found[n, 2 * place + 1] + away_m * math.sin(turn)
                if abs(x) < half_m[0] and abs(y) < half_m[1]:
                    if count == poses.shape[0]:
                        return count
                    poses[count, 0], poses[count, 1], poses[count, 2] = x, y, turn + math.pi - bearing
                    count += 1
    return count
