"""Compiled search for small coloured blobs on the floor, about as large as a ball is there.

1. `_flood` gathers the pixels of the ball's colour around a seed.
2. `_half_sizes` measures the blob along and across the ray from the camera's axis.

`evidence.weigh_blobs` weighs each of them as a ball.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled

NEVER = 2**31 - 1
# a channel from here on is clipped, and its ratio to the others tells nothing
CLIPPED = 250
# areas in units of the expected ones: smaller is a speck, larger is another thing; the size's evidence does the rest
_MIN_AREA_RATIO, _MAX_AREA_RATIO = 0.15, 2.2
# so much of a blob unmixed is enough to measure it by
_UNMIXED_RATIO = 0.5
# what is known of a blob: centre, half sizes along and across the ray, sum of weights, whether the picture cuts it
U, V, ALONG, ACROSS, TOTAL, CUT = range(6)
COLUMNS = 6
ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)
# a pixel of a blob in one whole number: shifts take it apart, a division would take as long as all else
ROW_BITS = 15
COLUMN_MASK = 2**ROW_BITS - 1

# B, G, R; scalars, as an array in a tuple costs more at each call than the test itself
Bgr = tuple[float, float, float]


class BallColor(NamedTuple):
    """Which pixels have the ball's colour.

    Parameters
    ----------
    from_white, from_floor : (float, float, float)
        Unit normals in B, G, R of the planes through black that part the ball's colour from white and from the floor.
    half_white : (float, float, float)
        As `from_white`, half-way: what lies beyond is the ball, unmixed.
    plane_ratio, apart_rad : float
        Where `from_white` lies on the way from white to the ball's colour, and how long that is.
    min_hue : float
        The dot product with `from_white` must exceed this: noise.
    weak, middle : int
        Channels in which the ball is darkest beside white, and in between.
    clipped_ratio : float
        Where a channel is clipped, the weak one must be less than this times the middle one.
    min_level : float
        Darker pixels (sum of B, G, R) have no colour.
    sure : float
        From this dot product with `from_floor` on a pixel is ball all over.
    min_signal : float
        The sum of these dot products over a blob must reach this times the root of its area: more than noise gives.
    """

    from_white: Bgr
    from_floor: Bgr
    half_white: Bgr
    plane_ratio: float
    apart_rad: float
    min_hue: float
    weak: int
    middle: int
    clipped_ratio: float
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
    log_std : (R,) float64
        Standard deviation of the size's logarithm there: by a camera that sways, and by shade.
    shape_std : float
        Of the logarithm of the ratio of both half sizes.
    """

    axis_u: float
    axis_v: float
    body_px: float
    along_px: FloatArray
    across_px: FloatArray
    log_std: FloatArray
    shape_std: float


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
    queue : (N,) int32
        N >= H W: pixels of a blob, v 2^ROW_BITS + u.
    sums : (2, 6) float64
        Of a blob's weights, of their offsets from the seed, u and v, and of the offsets' products uu, uv and vv: over
        all pixels, and over the unmixed ones.
    """

    stamps: Int32Array
    queue: Int32Array
    sums: FloatArray


@compiled
def find_blobs(
    frame: UInt8Array,
    seeds: Int32Array,
    scratch: Scratch,
    first_stamp: int,
    color: BallColor,
    size: BallSize,
    out: FloatArray,
) -> tuple[int, int]:
    """Find the blobs that may be balls.

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
    color, size
        What a ball looks like.
    out : (M, COLUMNS) float64
        Filled with the blobs; those beyond M are left out.

    Returns
    -------
    (int, int)
        Number of blobs, and the last stamp used.
    """
    stamp, count, size_px = first_stamp, 0, (frame.shape[1], frame.shape[0])
    # once for all: to reshape an array takes as long as the walk from a seed
    pixels, stamps = frame.reshape(-1), scratch.stamps.reshape(-1)
    picked = np.empty(seeds.shape[0], np.int32)
    for i in range(_pick_hue(frame, seeds, color, picked)):
        v0, u0 = seeds[picked[i], 0], seeds[picked[i], 1]
        b, g, r = frame[v0, u0, 0], frame[v0, u0, 1], frame[v0, u0, 2]
        if not has_hue(color, float(b), float(g), float(r)):
            continue
        if float(b) + g + r < color.min_level or scratch.stamps[v0, u0] >= first_stamp:
            continue
        stamp += 1
        if _touches(pixels, stamps, frame.shape[1], first_stamp, stamp, color, u0, v0):
            continue
        at_seed = int(math.sqrt((u0 - size.axis_u) ** 2 + (v0 - size.axis_v) ** 2) + 0.5)
        if at_seed >= size.along_px.shape[0] or not size.along_px[at_seed] > 0.0:
            continue
        largest = _MAX_AREA_RATIO * math.exp(2.0 * size.log_std[at_seed])
        largest *= math.pi * (size.along_px[at_seed] + 1.0) * (size.across_px[at_seed] + 1.0)
        alone, area = _flood(pixels, stamps, scratch.queue, size_px, first_stamp, stamp, color, u0, v0, largest)
        if not alone or area < 3:
            continue
        cut, signal = _add_up(pixels, scratch, size_px, area, color, u0, v0)
        if signal < color.min_signal * math.sqrt(area):
            continue
        # its shadow, glare and compression shift the rim of a mixed blob: what is unmixed says where it is
        unmixed = scratch.sums[1, 0] >= _UNMIXED_RATIO * scratch.sums[0, 0]
        total, sum_u, sum_v, sum_uu, sum_uv, sum_vv = scratch.sums[1 if unmixed else 0]
        cu, cv = sum_u / total, sum_v / total
        x, y = u0 + cu - size.axis_u, v0 + cv - size.axis_v
        radius = math.sqrt(x * x + y * y)
        index = int(radius + 0.5)
        if index >= size.along_px.shape[0] or not size.along_px[index] > 0.0:
            continue
        smallest = _MIN_AREA_RATIO * math.exp(-2.0 * size.log_std[index])
        if area < smallest * math.pi * (size.along_px[index] + 0.25) * (size.across_px[index] + 0.25):
            continue
        if count >= out.shape[0]:
            break
        ex, ey = x / radius, y / radius
        uu = sum_uu / total - cu * cu + 1.0 / 12
        uv = sum_uv / total - cu * cv
        vv = sum_vv / total - cv * cv + 1.0 / 12
        out[count, U], out[count, V] = u0 + cu, v0 + cv
        out[count, ALONG], out[count, ACROSS] = _half_sizes(ex, ey, uu, uv, vv)
        out[count, TOTAL] = total
        out[count, CUT] = cut
        count += 1
    return count, stamp


@compiled
def _pick_hue(frame: UInt8Array, seeds: Int32Array, color: BallColor, out: Int32Array) -> int:
    """Write which seeds (N, 2) have the ball's hue, as far as single precision tells, and return their number.

    In three passes, of which none branches: colours are gathered, judged side by side, and the seeds written.
    """
    count, width = seeds.shape[0], frame.shape[1]
    flat = frame.reshape(-1)
    channels = np.empty((3, count), np.uint8)
    for n in range(count):
        # unsigned: a signed index would be checked for being negative
        at = np.uint64(3 * (seeds[n, 0] * width + seeds[n, 1]))
        channels[0, n], channels[1, n], channels[2, n] = flat[at], flat[at + ONE], flat[at + TWO]
    blue, green, red = channels[0], channels[1], channels[2]
    weak, middle = channels[color.weak], channels[color.middle]
    f, w = color.from_floor, color.from_white
    f0, f1, f2 = np.float32(f[0]), np.float32(f[1]), np.float32(f[2])
    w0, w1, w2 = np.float32(w[0]), np.float32(w[1]), np.float32(w[2])
    zero, min_hue, clipped_ratio = np.float32(0.0), np.float32(color.min_hue), np.float32(color.clipped_ratio)
    clipped = np.uint8(CLIPPED)
    has = np.empty(count, np.uint8)
    for n in range(count):
        b, g, r = np.float32(blue[n]), np.float32(green[n]), np.float32(red[n])
        is_hue = (f0 * b + f1 * g + f2 * r > zero) & (w0 * b + w1 * g + w2 * r > min_hue)
        is_clipped = (blue[n] >= clipped) | (green[n] >= clipped) | (red[n] >= clipped)
        is_burnt_out = is_clipped & (np.float32(weak[n]) < clipped_ratio * np.float32(middle[n]))
        has[n] = is_hue | is_burnt_out
    found = np.uint64(0)
    for n in range(count):
        out[found] = n
        found += np.uint64(has[n])
    return int(found)


@compiled(inline="always")
def has_hue(color: BallColor, blue: float, green: float, red: float) -> bool:
    """Whether a pixel has the ball's hue, however dark it is."""
    f, w = color.from_floor, color.from_white
    if f[0] * blue + f[1] * green + f[2] * red > 0.0:
        if w[0] * blue + w[1] * green + w[2] * red > color.min_hue:
            return True
    return _is_burnt_out(color, blue, green, red)


@compiled(inline="always")
def _is_burnt_out(color: BallColor, blue: float, green: float, red: float) -> bool:
    """Whether a pixel with a clipped channel may be a ball's: what is not clipped still has less of the weak one."""
    if blue < CLIPPED and green < CLIPPED and red < CLIPPED:
        return False
    weak = blue if color.weak == 0 else green if color.weak == 1 else red
    middle = blue if color.middle == 0 else green if color.middle == 1 else red
    return bool(weak < color.clipped_ratio * middle)


@compiled(inline="always")
def _touches(
    pixels: UInt8Array, stamps: Int32Array, width: int, no_hue: int, stamp: int, color: BallColor, u0: int, v0: int
) -> bool:
    """Whether the ball's colour goes on from a seed, straight up or straight left, to an earlier flood.

    A thing that is too large has hundreds of seeds, and this tells of most in a few pixels that they are its rest.
    """
    for side in range(2):
        most, step = (v0, width) if side == 0 else (u0, 1)
        at = v0 * width + u0
        for _ in range(most):
            at -= step
            place = np.uint64(at)
            seen = stamps[place]
            if seen == no_hue or seen == NEVER:
                break
            if seen > no_hue:
                while at != v0 * width + u0:
                    at += step
                    stamps[np.uint64(at)] = stamp
                return True
            b, g, r = pixels[THREE * place], pixels[THREE * place + ONE], pixels[THREE * place + TWO]
            if float(b) + g + r < color.min_level or not has_hue(color, float(b), float(g), float(r)):
                stamps[place] = no_hue
                break
    return False


@compiled(inline="always")
def _flood(
    pixels: UInt8Array,
    stamps: Int32Array,
    queue: Int32Array,
    size_px: tuple[int, int],
    no_hue: int,
    stamp: int,
    color: BallColor,
    u0: int,
    v0: int,
    largest: float,
) -> tuple[bool, int]:
    """Flood over the ball's colour from a seed, but no farther than a ball there could reach.

    Pixels beside it that are not the ball's carry the stamp `no_hue` then, so that none is looked at twice.

    Returns
    -------
    tuple
        Whether the blob is whole and alone (what touches an earlier flood is the rest of a thing that was too large),
        and its area. Its pixels are in `scratch.queue`.
    """
    width, height = size_px
    queue[0] = (v0 << ROW_BITS) + u0
    stamps[v0 * width + u0] = stamp
    head, area = 0, 1
    while head < area:
        u, v = queue[head] & COLUMN_MASK, queue[head] >> ROW_BITS
        head += 1
        for side in range(4):
            nu = u + (1 if side == 0 else -1 if side == 1 else 0)
            nv = v + (1 if side == 2 else -1 if side == 3 else 0)
            if nu < 0 or nv < 0 or nu >= width or nv >= height:
                continue
            # unsigned: a signed index would be checked for being negative
            at = np.uint64(nv * width + nu)
            seen = stamps[at]
            if seen == stamp or seen == no_hue or seen == NEVER:
                continue
            b, g, r = pixels[THREE * at], pixels[THREE * at + ONE], pixels[THREE * at + TWO]
            if float(b) + g + r < color.min_level or not has_hue(color, float(b), float(g), float(r)):
                stamps[at] = no_hue
                continue
            if seen > no_hue:
                return False, area
            stamps[at] = stamp
            queue[area] = (nv << ROW_BITS) + nu
            area += 1
            if area > largest:
                return False, area
    return True, area


@compiled
def _add_up(
    pixels: UInt8Array, scratch: Scratch, size_px: tuple[int, int], area: int, color: BallColor, u0: int, v0: int
) -> tuple[bool, float]:
    """Fill the sums of a blob's pixels; returns whether it reaches the picture's edge, and its signal."""
    (width, height), queue = size_px, scratch.queue
    f, h = color.from_floor, color.half_white
    per_sure = 1.0 / color.sure
    # written out: sums in arrays would be stored and loaded at each pixel
    a0, a1, a2, a3, a4, a5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p0, p1, p2, p3, p4, p5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    cut, signal = False, 0.0
    for i in range(area):
        u, v = queue[i] & COLUMN_MASK, queue[i] >> ROW_BITS
        at = THREE * np.uint64(v * width + u)
        b, g, r = float(pixels[at]), float(pixels[at + ONE]), float(pixels[at + TWO])
        # a mixed pixel at the rim counts in part, a shaded or a burnt-out one inside as a whole
        value = f[0] * b + f[1] * g + f[2] * r
        burnt_out = _is_burnt_out(color, b, g, r)
        if value < color.sure and burnt_out:
            value = color.sure
        signal += value
        cut |= (u == 0) | (v == 0) | (u == width - 1) | (v == height - 1)
        weight, du, dv = min(1.0, value * per_sure), float(u - u0), float(v - v0)
        pure = weight if burnt_out or h[0] * b + h[1] * g + h[2] * r > 0.0 else 0.0
        wu, wv, pu, pv = weight * du, weight * dv, pure * du, pure * dv
        a0, a1, a2, a3, a4, a5 = a0 + weight, a1 + wu, a2 + wv, a3 + wu * du, a4 + wu * dv, a5 + wv * dv
        p0, p1, p2, p3, p4, p5 = p0 + pure, p1 + pu, p2 + pv, p3 + pu * du, p4 + pu * dv, p5 + pv * dv
    sums = scratch.sums
    sums[0, 0], sums[0, 1], sums[0, 2], sums[0, 3], sums[0, 4], sums[0, 5] = a0, a1, a2, a3, a4, a5
    sums[1, 0], sums[1, 1], sums[1, 2], sums[1, 3], sums[1, 4], sums[1, 5] = p0, p1, p2, p3, p4, p5
    return cut, signal


@compiled
def _half_sizes(ex: float, ey: float, uu: float, uv: float, vv: float) -> tuple[float, float]:
    """Half sizes along and across a ray (ex, ey): an ellipse's second moments are a quarter of their squares."""
    return (
        2.0 * math.sqrt(max(0.0, ex * ex * uu + 2 * ex * ey * uv + ey * ey * vv)),
        2.0 * math.sqrt(max(0.0, ey * ey * uu - 2 * ex * ey * uv + ex * ex * vv)),
    )
