"""Compiled sampling of a pinhole camera's frame after a small change of tilt and roll."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.lens import BENT, CELLS, FORWARD, LOWEST_COSINE, MAX_SLOPE2, P1, P2, PER_COSINE

# adding and subtracting this rounds a small float32 to an integer
_ROUNDS = np.float32(1.5 * 2**23)


@compiled(error_model="numpy")
def sample_turned(
    frame: UInt8Array,
    planes: Float32Array,
    homography: FloatArray,
    lens: Float32Array,
    hidden: UInt8Array,
    valid: UInt8Array,
    out: UInt8Array,
) -> None:
    """Map ideal pixels by a homography and the lens into the frame; write the colours of the nearest pixels.

    Places of a whole row are computed before its colours are fetched, without branches, so that this vectorises.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        Places outside are moved to its border.
    planes : (2, K, M) float32
        Ideal pixels u and v; NaN is treated as 0.
    homography : (3, 3) float64
        Maps (u, v, 1).
    lens : (L,) float32
        `camera.lens_table` of the camera.
    hidden : (H, W) uint8
        Non-zero pixels show the robot itself. A hidden place takes the colour of the next one nearer in its row; those
        at the near end take that of the first place that is not hidden. (0, 0) if nothing is hidden.
    valid : (N, M) uint8
        N >= K. Filled: 1 where a place is inside the frame and not hidden.
    out : (K, M, 3) uint8
        Filled.
    """
    # scalars, because the compiler must assume that the output overlaps the homography
    a, b, c = np.float32(homography[0, 0]), np.float32(homography[0, 1]), np.float32(homography[0, 2])
    d, e, f = np.float32(homography[1, 0]), np.float32(homography[1, 1]), np.float32(homography[1, 2])
    g, h, i = np.float32(homography[2, 0]), np.float32(homography[2, 1]), np.float32(homography[2, 2])
    height, width = frame.shape[:2]
    right, low, none, one = np.float32(width - 1), np.float32(height - 1), np.float32(0.0), np.float32(1.0)
    nan = np.float32(np.nan)
    across = np.int32(3 * width)
    flat = frame.reshape(-1)
    rows, columns = planes.shape[1:]
    valid[rows:] = 0
    at = np.empty(columns, np.int32)
    us, vs = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for k in range(rows):
        for m in range(columns):
            u, v = planes[0, k, m], planes[1, k, m]
            scale = g * u + h * v + i
            by_scale = one / scale if scale > none else nan
            us[m], vs[m] = (a * u + b * v + c) * by_scale, (d * u + e * v + f) * by_scale
        if lens[BENT] != none:
            _distort(us, vs, lens)
        for m in range(columns):
            x, y = us[m], vs[m]
            valid[k, m] = np.uint8((x >= none) & (y >= none) & (x <= right) & (y <= low))
            x = x if x > none else none
            y = y if y > none else none
            x = x if x < right else right
            y = y if y < low else low
            x, y = (x + _ROUNDS) - _ROUNDS, (y + _ROUNDS) - _ROUNDS
            at[m] = np.int32(y) * across + np.int32(3) * np.int32(x)
        if hidden.size > 0:
            _avoid(hidden.reshape(-1), at, valid[k])
        for m in range(columns):
            # unsigned, because numba tests signed indices for negative ones
            place = np.uint32(at[m])
            out[k, m, 0] = flat[place]
            out[k, m, 1] = flat[place + np.uint32(1)]
            out[k, m, 2] = flat[place + np.uint32(2)]


@compiled(error_model="numpy")
def _distort(us: Float32Array, vs: Float32Array, lens: Float32Array) -> None:
    """Distort ideal pixels in place; those beyond the lens' greatest slope are moved there."""
    fu, fv, cu, cv = lens[0], lens[1], lens[2], lens[3]
    p1, p2, farthest, one, two = lens[P1], lens[P2], lens[MAX_SLOPE2], np.float32(1.0), np.float32(2.0)
    lowest, per_cosine, last = lens[LOWEST_COSINE], lens[PER_COSINE], np.float32(CELLS - 1)
    for m in range(len(us)):
        x, y = (us[m] - cu) / fu, (vs[m] - cv) / fv
        r2 = x * x + y * y
        inward = np.sqrt(farthest / r2) if r2 > farthest else one
        x, y = inward * x, inward * y
        r2 = x * x + y * y
        cosine = one / np.sqrt(one + r2)
        place = (cosine - lowest) * per_cosine
        # NaN, of a ray behind the camera, stays NaN in the first cell
        cell = np.uint32(place if place < last else last) if place > np.float32(0.0) else np.uint32(0)
        t, at = place - np.float32(cell), np.uint32(FORWARD) + np.uint32(4) * cell
        three = lens[at + np.uint32(3)]
        factor = cosine * (lens[at] + t * (lens[at + np.uint32(1)] + t * (lens[at + np.uint32(2)] + t * three)))
        cross = two * x * y
        us[m] = cu + fu * (x * factor + p1 * cross + p2 * (r2 + two * x * x))
        vs[m] = cv + fv * (y * factor + p1 * (r2 + two * y * y) + p2 * cross)


@compiled
def _avoid(hidden: UInt8Array, at: Int32Array, valid: UInt8Array) -> None:
    """Replace offsets of hidden pixels in a row (three for each pixel) by those of neighbours, and clear `valid`."""
    for m in range(len(at)):
        if hidden[at[m] // 3]:
            valid[m] = 0
    first = 0
    while first < len(at) and hidden[at[first] // 3]:
        first += 1
    if first == len(at):
        return
    for m in range(first):
        at[m] = at[first]
    for m in range(first + 1, len(at)):
        if hidden[at[m] // 3]:
            at[m] = at[m - 1]
