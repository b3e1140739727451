"""Compiled search for coloured blobs on the floor that are about as large as a ball would be there.

`evidence.weigh_blobs` computes for each of them how likely it is a ball.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled

NEVER = 2**31 - 1
# a channel of at least this level may be clipped, so that its ratio to the others is meaningless
CLIPPED = 250
# bounds of a blob's area in units of the expected area; `evidence` weighs sizes between them
_MIN_AREA_RATIO, _MAX_AREA_RATIO = 0.15, 2.2
# if this part of a blob consists of unmixed pixels, only these measure it
_UNMIXED_RATIO = 0.5
# columns of a blob: centre, half sizes along and across the ray, sum of weights, whether the picture's edge cuts it
U, V, ALONG, ACROSS, TOTAL, CUT = range(6)
COLUMNS = 6
ONE, TWO, THREE = np.uint64(1), np.uint64(2), np.uint64(3)
# a pixel in one integer, unpacked by shifts because divisions are slow
ROW_BITS = 15
COLUMN_MASK = 2**ROW_BITS - 1

# B, G, R; tuples of scalars, because an array inside a tuple makes each call slower
Bgr = tuple[float, float, float]


class BallColor(NamedTuple):
    """Which pixels have the ball's colour.

    Parameters
    ----------
    from_white, from_floor : (float, float, float)
        Unit normals in B, G, R of the planes through black that separate the ball's colour from white and from floor.
    half_white : (float, float, float)
        As `from_white`, half-way to the ball's colour: pixels beyond this plane are unmixed ball.
    plane_ratio, apart_rad : float
        Position of the plane `from_white` on the way from white to the ball's colour, and the angle between the two.
    min_hue : float
        Noise level that the dot product with `from_white` must exceed.
    weak, middle : int
        Channels that the ball reflects least, relative to white, and second least.
    clipped_ratio : float
        If a channel is clipped, the weak one must be less than this times the middle one.
    min_level : float
        Pixels whose sum of B, G, R is lower have no reliable colour.
    sure : float
        A pixel with at least this dot product with `from_floor` is entirely ball.
    min_signal : float
        The sum of these dot products over a blob must exceed this times the root of its area, as noise does not.
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
    """The size of a ball in the image.

    Parameters
    ----------
    axis_u, axis_v : float
        Pixel from which the rays from the robot outwards start.
    body_px : float
        Pixels nearer to it show the robot itself.
    along_px, across_px : (R,) float64
        Half the ball's size along and across the ray, by the distance from that pixel in whole pixels; 0: no ball
        there.
    log_std : (R,) float64
        Standard deviation of the logarithm of that size, from the camera's sway and from shade.
    shape_std : float
        Standard deviation of the logarithm of the ratio of the two half sizes.
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
    """Memory that is kept from frame to frame.

    Parameters
    ----------
    stamps : (H, W) int32
        A frame has visited the pixels whose stamp is at least its first stamp. Pixels with NEVER are not visited.
    queue : (N,) int32
        Pixels of a blob as v 2^ROW_BITS + u; N >= H W.
    sums : (2, 6) float64
        Sums of a blob's weights, of their offsets u and v from the seed, and of the products uu, uv and vv, over all
        its pixels and over its unmixed ones.
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
    """Write at most M blobs that may be balls into `out` (M, COLUMNS).

    Parameters
    ----------
    seeds : (N, 2) int32
        Pixels (v, u), so dense that a ball covers at least one wherever it is.
    scratch : Scratch
        Used and changed.
    first_stamp : int
        Greater than any stamp of the frame before.

    Returns
    -------
    (int, int)
        Number of blobs, and the last stamp used.
    """
    stamp, count, size_px = first_stamp, 0, (frame.shape[1], frame.shape[0])
    # reshaped once, because reshaping takes as long as the walk from a seed
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
        # shadow, glare and compression shift the rim of a blob that includes mixed pixels
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
    """Write the indices of seeds (N, 2) that have the ball's hue in single precision, and return their number.

    Three passes without branches, so that they vectorise: gather colours, test them, write the indices.
    """
    count, width = seeds.shape[0], frame.shape[1]
    flat = frame.reshape(-1)
    channels = np.empty((3, count), np.uint8)
    for n in range(count):
        # unsigned, because numba tests signed indices for negative ones
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
    """Whether a pixel has the ball's hue, at any brightness."""
    f, w = color.from_floor, color.from_white
    if f[0] * blue + f[1] * green + f[2] * red > 0.0:
        if w[0] * blue + w[1] * green + w[2] * red > color.min_hue:
            return True
    return _is_burnt_out(color, blue, green, red)


@compiled(inline="always")
def _is_burnt_out(color: BallColor, blue: float, green: float, red: float) -> bool:
    """Whether a pixel with a clipped channel may be ball: its weak channel is still less than its middle one."""
    if blue < CLIPPED and green < CLIPPED and red < CLIPPED:
        return False
    weak = blue if color.weak == 0 else green if color.weak == 1 else red
    middle = blue if color.middle == 0 else green if color.middle == 1 else red
    return bool(weak < color.clipped_ratio * middle)


@compiled(inline="always")
def _touches(
    pixels: UInt8Array, stamps: Int32Array, width: int, no_hue: int, stamp: int, color: BallColor, u0: int, v0: int
) -> bool:
    """Whether the ball's colour continues from a seed, straight up or left, to a blob that was flooded before.

    A large object has hundreds of seeds. This test rejects most of them after a few pixels.
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
    """Flood the ball's colour from a seed, up to an area that a ball there could have.

    Adjacent pixels of another colour get the stamp `no_hue`, so that none is tested twice.

    Returns
    -------
    tuple
        Whether the blob is complete and touches no earlier blob, which would have been too large; and its area. Its
        pixels are in `queue`.
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
            # unsigned, because numba tests signed indices for negative ones
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
    """Fill the sums of a blob's pixels; returns whether it touches the picture's edge, and its signal."""
    (width, height), queue = size_px, scratch.queue
    f, h = color.from_floor, color.half_white
    per_sure = 1.0 / color.sure
    # scalars, because sums in arrays would be stored and loaded at each pixel
    a0, a1, a2, a3, a4, a5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p0, p1, p2, p3, p4, p5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    cut, signal = False, 0.0
    for i in range(area):
        u, v = queue[i] & COLUMN_MASK, queue[i] >> ROW_BITS
        at = THREE * np.uint64(v * width + u)
        b, g, r = float(pixels[at]), float(pixels[at + ONE]), float(pixels[at + TWO])
        # mixed pixels at the rim count in part; shaded or clipped ones inside count fully
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
    """Return half sizes along and across a ray (ex, ey): an ellipse's second moments are a quarter of their squares."""
    return (
        2.0 * math.sqrt(max(0.0, ex * ex * uu + 2 * ex * ey * uv + ey * ey * vv)),
        2.0 * math.sqrt(max(0.0, ey * ey * uu - 2 * ex * ey * uv + ex * ex * vv)),
    )
