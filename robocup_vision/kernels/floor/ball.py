"""Compiled search for a small coloured blob on the floor, of the size a ball has there.

1. `_flood` gathers the pixels of the ball's colour around a seed.
2. `_half_sizes` measures the blob along and across the ray from the camera's axis.
3. `_open_floor` looks for floor before the blob and beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, UInt8Array, UInt16Array

NEVER = 2**31 - 1
# areas in units of the expected one: a ball half hidden or in deep shade, and one whose glow spreads
MIN_AREA_RATIO, MAX_AREA_RATIO = 0.15, 2.2
# half sizes in units of the expected ones, with a pixel's slack: blur and a shaded side change them by so much
MIN_SIZE_RATIO, MAX_SIZE_RATIO = 0.35, 1.6
# floor is looked for so many half sizes, and pixels, from the blob's centre: just beyond its rim and the blur
_RIM_RATIO, _RIM_PX = 1.35, 2.0
# places around the blob, and how many of them, before it and beside it, must show floor
_AROUND, _WANTED = 16, 9


class BallColor(NamedTuple):
    """Which pixels have the ball's colour.

    Parameters
    ----------
    from_white, from_floor : (3,) float64
        A pixel has it if both dot products with its B, G, R are positive.
    min_level : float
        Darker pixels (sum of B, G, R) have no colour.
    sure : float
        From this dot product with `from_floor` on a pixel is ball all over.
    min_signal : float
        The sum of these dot products over a blob must reach this times the root of its area: more than noise gives.
    """

    from_white: FloatArray
    from_floor: FloatArray
    min_level: float
    sure: float
    min_signal: float


class BallSize(NamedTuple):
    """How large a ball looks.

    Parameters
    ----------
    axis_u, axis_v : float
        Pixel at which rays from the robot outwards start.
    body_px : float
        What is nearer to there shows the robot itself.
    along_px, across_px : (R,) float64
        Half the ball's size along and across the ray, by its distance from there in whole pixels; 0 where none can be.
    """

    axis_u: float
    axis_v: float
    body_px: float
    along_px: FloatArray
    across_px: FloatArray


class FloorTable(NamedTuple):
    """The colour table: offsets of each channel's counts, and the floor's log-likelihood ratios."""

    packing: UInt16Array
    floor_llr: Int8Array


class Scratch(NamedTuple):
    """Memory that lives over frames.

    Parameters
    ----------
    stamps : (H, W) int32
        Pixels that carry a frame's first stamp or more have been visited in it; those that carry NEVER are not to be.
    stack : (N,) int32
        N >= H W.
    """

    stamps: Int32Array
    stack: Int32Array


@njit(cache=True, nogil=True)
def find_ball(
    frame: UInt8Array,
    seeds: Int32Array,
    scratch: Scratch,
    first_stamp: int,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    out: FloatArray,
) -> tuple[float, int]:
    """Find the blob that is most like a ball on open floor.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    seeds : (N, 2) int32
        Pixels (v, u) so dense that a ball anywhere covers one.
    scratch : Scratch
        Used and changed.
    first_stamp : int
        Greater than any stamp of the frame before.
    color, size, table
        What a ball looks like, and what the floor looks like.
    out : (4,) float64
        Filled with the blob's centre u, v, its half sizes' mean ratio to the expected, and its ratio of floor before
        and beside it.

    Returns
    -------
    (float, int)
        The best blob's score: the ratio of floor before and beside it, less what has its own colour; 0 when none. And
        the last stamp used.
    """
    stamp = first_stamp
    best = 0.0
    for n in range(seeds.shape[0]):
        v0, u0 = seeds[n, 0], seeds[n, 1]
        b, g, r = frame[v0, u0, 0], frame[v0, u0, 1], frame[v0, u0, 2]
        if not _has_hue(color, b, g, r):
            continue
        if float(b) + g + r < color.min_level or scratch.stamps[v0, u0] >= first_stamp:
            continue
        at_seed = int(math.sqrt((u0 - size.axis_u) ** 2 + (v0 - size.axis_v) ** 2) + 0.5)
        if at_seed >= size.along_px.shape[0] or not size.along_px[at_seed] > 0.0:
            continue
        largest = 3.0 * math.pi * (size.along_px[at_seed] + 1.0) * (size.across_px[at_seed] + 1.0)
        stamp += 1
        alone, area, signal, total, sum_u, sum_v, sum_uu, sum_uv, sum_vv = _flood(
            frame, scratch, first_stamp, stamp, color, u0, v0, largest
        )
        if not alone or signal < color.min_signal * math.sqrt(area):
            continue
        cu, cv = sum_u / total, sum_v / total
        x, y = u0 + cu - size.axis_u, v0 + cv - size.axis_v
        radius = math.sqrt(x * x + y * y)
        index = int(radius + 0.5)
        if index >= size.along_px.shape[0] or not size.along_px[index] > 0.0:
            continue
        a, t = size.along_px[index], size.across_px[index]
        expected = math.pi * (a + 0.25) * (t + 0.25)
        if area < max(2.0, MIN_AREA_RATIO * expected) or area > MAX_AREA_RATIO * (a + 0.75) * (t + 0.75) * math.pi:
            continue
        ex, ey = x / radius, y / radius
        uu = sum_uu / total - cu * cu + 1.0 / 12
        uv = sum_uv / total - cu * cv
        vv = sum_vv / total - cv * cv + 1.0 / 12
        along, across = _half_sizes(ex, ey, uu, uv, vv)
        if along > MAX_SIZE_RATIO * a + 1.0 or across > MAX_SIZE_RATIO * t + 1.0:
            continue
        if along < MIN_SIZE_RATIO * a - 0.5 or across < MIN_SIZE_RATIO * t - 0.5:
            continue
        floor, like, wanted = _open_floor(frame, color, size, table, x, y, a, t)
        if not wanted:
            continue
        score = floor / wanted - like / 8.0
        if score > best:
            best = score
            out[0] = size.axis_u + x
            out[1] = size.axis_v + y
            out[2] = 0.5 * (along / a + across / t)
            out[3] = floor / wanted
    return best, stamp


@njit(cache=True, nogil=True)
def _has_hue(color: BallColor, blue: int, green: int, red: int) -> bool:
    """Whether a pixel lies on the ball's side of both planes, however dark it is."""
    f, w = color.from_floor, color.from_white
    if f[0] * blue + f[1] * green + f[2] * red <= 0.0:
        return False
    return bool(w[0] * blue + w[1] * green + w[2] * red > 0.0)


@njit(cache=True, nogil=True)
def _flood(
    frame: UInt8Array,
    scratch: Scratch,
    first_stamp: int,
    stamp: int,
    color: BallColor,
    u0: int,
    v0: int,
    largest: float,
) -> tuple[bool, int, float, float, float, float, float, float, float]:
    """Flood over the ball's colour from a seed, but no farther than a ball there could reach.

    Returns
    -------
    tuple
        Whether the blob is whole and alone (what touches an earlier flood is the rest of a thing that was too large);
        its area and signal; the sum of the pixels' weights, of their offsets from the seed, u and v, and of the
        offsets' products uu, uv and vv.
    """
    stamps, stack = scratch.stamps, scratch.stack
    height, width = frame.shape[0], frame.shape[1]
    f0, f1, f2 = color.from_floor[0], color.from_floor[1], color.from_floor[2]
    stack[0] = v0 * width + u0
    stamps[v0, u0] = stamp
    top, area, alone = 1, 0, True
    total, sum_u, sum_v, sum_uu, sum_uv, sum_vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    signal = 0.0
    while top > 0 and alone:
        top -= 1
        v, u = stack[top] // width, stack[top] % width
        b, g, r = frame[v, u, 0], frame[v, u, 1], frame[v, u, 2]
        # a mixed pixel at the rim counts in part, a shaded one inside as a whole
        value = f0 * b + f1 * g + f2 * r
        signal += value
        weight = min(1.0, value / color.sure)
        area += 1
        total += weight
        du, dv = float(u - u0), float(v - v0)
        sum_u += weight * du
        sum_v += weight * dv
        sum_uu += weight * du * du
        sum_uv += weight * du * dv
        sum_vv += weight * dv * dv
        for side in range(4):
            nu = u + (1 if side == 0 else -1 if side == 1 else 0)
            nv = v + (1 if side == 2 else -1 if side == 3 else 0)
            if nu < 0 or nv < 0 or nu >= width or nv >= height or stamps[nv, nu] == stamp:
                continue
            b, g, r = frame[nv, nu, 0], frame[nv, nu, 1], frame[nv, nu, 2]
            if not _has_hue(color, b, g, r):
                continue
            if float(b) + g + r < color.min_level or stamps[nv, nu] == NEVER:
                continue
            alone = alone and stamps[nv, nu] < first_stamp
            stamps[nv, nu] = stamp
            stack[top] = nv * width + nu
            top += 1
        alone = alone and area <= largest
    return alone, area, signal, total, sum_u, sum_v, sum_uu, sum_uv, sum_vv


@njit(cache=True, nogil=True)
def _half_sizes(ex: float, ey: float, uu: float, uv: float, vv: float) -> tuple[float, float]:
    """Half sizes along and across a ray (ex, ey): an ellipse's second moments are a quarter of their squares."""
    return (
        2.0 * math.sqrt(max(0.0, ex * ex * uu + 2 * ex * ey * uv + ey * ey * vv)),
        2.0 * math.sqrt(max(0.0, ey * ey * uu - 2 * ex * ey * uv + ex * ex * vv)),
    )


@njit(cache=True, nogil=True)
def _open_floor(
    frame: UInt8Array,
    color: BallColor,
    size: BallSize,
    table: FloorTable,
    x: float,
    y: float,
    along_px: float,
    across_px: float,
) -> tuple[int, int, int]:
    """Count the places around a blob that show floor, and those that show the ball's colour.

    Floor must lie before the blob and on both sides; behind it may be anything but more of its own colour. At the
    picture's edge the nearest places in view do; where the robot's own body is before the blob, fewer places do.

    Returns
    -------
    (int, int, int)
        Places with floor, places with the ball's colour, and how many places with floor are wanted.
    """
    height, width = frame.shape[0], frame.shape[1]
    radius = math.sqrt(x * x + y * y)
    ex, ey = x / radius, y / radius
    floor, like, asked, wanted = 0, 0, 0, _WANTED
    for k in range(_AROUND):
        step = 8 + ((k + 1) // 2 if k % 2 else -(k // 2))
        angle = step * math.pi / 8
        along = (_RIM_RATIO * along_px + _RIM_PX) * math.cos(angle)
        aside = (_RIM_RATIO * across_px + _RIM_PX) * math.sin(angle)
        u = int(size.axis_u + x + along * ex - aside * ey + 0.5)
        v = int(size.axis_v + y + along * ey + aside * ex + 0.5)
        if u < 1 or v < 1 or u >= width - 1 or v >= height - 1:
            continue
        if (u - size.axis_u) ** 2 + (v - size.axis_v) ** 2 < (size.body_px + 2.0) ** 2:
            wanted -= 1
            continue
        asked += 1
        blue, green, red = 0, 0, 0
        for nv in range(v - 1, v + 2):
            for nu in range(u - 1, u + 2):
                blue += frame[nv, nu, 0]
                green += frame[nv, nu, 1]
                red += frame[nv, nu, 2]
        blue, green, red = blue // 9, green // 9, red // 9
        packed = table.packing[0, blue] + table.packing[1, green] + table.packing[2, red]
        if _has_hue(color, blue, green, red):
            like += blue + green + red >= color.min_level
        elif asked <= wanted and table.floor_llr[packed] > 0:
            floor += 1
    return floor, like, wanted
