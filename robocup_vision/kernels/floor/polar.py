"""Compiled loops over a frame's polar samples: colours, the floor's outline, and its edges to a fraction of a pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int64Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled

# bilinear weights are whole numbers of 1/ONE pixel, as in OpenCV: integers all the way are twice as fast
ONE = 32
Size = tuple[int, int]
Pair = tuple[float, float]
# a level from which a channel may be clipped
SATURATED = 245
B1, B2, THREE, B4, B5 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5)


@compiled
def classify(
    samples: UInt8Array,
    packing: UInt16Array,
    floor_llr: Int8Array,
    valid: UInt8Array,
    ring_columns: int,
    out: Int8Array,
) -> float:
    """Look samples up in a colour table; 0 where not valid.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    packing, floor_llr
        The colour table.
    valid : (K, M) uint8
    ring_columns : int
        Number of innermost columns whose mean is returned.
    out : (K, M) int8
        Filled with the likelihood ratios.
    """
    rows, columns = valid.shape
    ring, count = 0, 0
    for k in range(rows):
        for m in range(columns):
            index = packing[0, samples[k, m, 0]] + packing[1, samples[k, m, 1]] + packing[2, samples[k, m, 2]]
            out[k, m] = floor_llr[index] if valid[k, m] else np.int8(0)
        for m in range(ring_columns):
            ring += out[k, m]
            count += valid[k, m]
    return ring / max(count, 1)


@compiled
def outer_boundary(llr: Int8Array, valid: UInt8Array, certain: int, gap: int, min_strip: int, out: Int64Array) -> None:
    """Find the outermost floor sample of each bearing.

    Floor is five samples in a row, or three in a row on three neighbouring bearings (a far strip of floor is thin but
    long), whose mean reaches `certain`. From there a strip of floor behind a painted line still counts: two samples,
    not more than `gap` samples on, whose sum reaches `min_strip`.

    Writes out (K,) int64: its column, or -1 where a bearing has no floor, or where what follows cannot be seen.
    """
    rows, columns = llr.shape
    for k in range(rows):
        out[k] = -1
        before, after = k - 1, (k + 1) % rows
        for m in range(columns - 3, -1, -1):
            own = llr[k, m] + llr[k, m + 1] + llr[k, m + 2]
            if own < 2 * certain:
                continue
            beside = llr[before, m] + llr[before, m + 1] + llr[before, m + 2]
            beside += llr[after, m] + llr[after, m + 1] + llr[after, m + 2]
            if own + beside < 9 * certain:
                if m < 2 or own + llr[k, m - 1] + llr[k, m - 2] < 5 * certain:
                    continue
            edge = m + 2
            while edge > m and llr[k, edge] <= 0:
                edge -= 1
            ahead = edge + 1
            while ahead + 1 < columns and ahead <= edge + gap + 1:
                if llr[k, ahead] > 0 and llr[k, ahead] + llr[k, ahead + 1] >= min_strip:
                    edge = ahead + 1 if llr[k, ahead + 1] > 0 else ahead
                    ahead = edge
                ahead += 1
            if edge + 2 < columns and valid[k, edge + 1] and valid[k, edge + 2]:
                out[k] = edge
            break


class Rays(NamedTuple):
    """Bearings along which edges are located.

    Parameters
    ----------
    center_u, center_v : float
        Pixel that they start from.
    step_u, step_v : (K,) float64
        Image direction of each bearing.
    start_px : (K,) float64
        Image radius of the last floor sample; NaN: no edge is located.
    """

    center_u: float
    center_v: float
    step_u: FloatArray
    step_v: FloatArray
    start_px: FloatArray


class EdgeSearch(NamedTuple):
    """How edges are located.

    Parameters
    ----------
    column_step_px : float
        Uncertainty of `Rays.start_px` outwards.
    half_width : float
        Angle between neighbouring lines of sight, radians.
    min_contrast : float
        Smallest colour difference (counts) that is an edge.
    """

    column_step_px: float
    half_width: float
    min_contrast: float


@compiled
def radial_edges(frame: UInt8Array, hidden: UInt8Array, rays: Rays, search: EdgeSearch, out: FloatArray) -> None:
    """Locate the edge between two colours along each bearing to a fraction of a pixel.

    Around the coarse edge the frame is sampled every pixel along the bearing. The steepest place splits the samples
    into an inner and an outer colour; what counts from there on is the projection on their difference, on three
    neighbouring lines of sight, to which the edge is fitted as a smooth step. A cast, a shadow or the floor's own
    brightness so cannot bias it; channels that the outer side drives into saturation would, and are left out.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    hidden : (H, W) uint8, or (0, 0)
        Non-zero where no bilinear sample may be taken: a bearing that needs one has no edge.
    rays : Rays
        K bearings.
    search : EdgeSearch
        How they are searched.
    out : (K,) float64
        Filled with the edge's image radius, NaN where there is none.
    """
    # blur takes the last sample that looks like floor about a column and a pixel inside the edge
    span = int(math.ceil(search.column_step_px + 1.0))
    reach = span + 3
    profile = np.empty((2 * reach + 1, 3), np.int64)
    signal = np.empty(21, np.int64)
    gain = np.empty(3, np.int64)
    offset = np.zeros(3)
    size_px = frame.shape[1], frame.shape[0]
    flat = frame.reshape(-1)
    center = rays.center_u, rays.center_v
    min_contrast2 = search.min_contrast * search.min_contrast
    for k in range(rays.start_px.shape[0]):
        out[k] = np.nan
        if not rays.start_px[k] > 0:
            continue
        step = rays.step_u[k], rays.step_v[k]
        near = rays.start_px[k] + search.column_step_px + 0.5 - reach
        if not _is_inside(size_px, center, step, near, near + 2 * reach + 5, search.half_width):
            continue
        seen = _sample_along(flat, size_px, hidden, center, step, near, profile)
        place = _steepest(profile, reach - span, reach + span)
        contrast2 = _weigh_channels(profile, place, min_contrast2, gain)
        if contrast2 < 0:
            continue
        edge = near + place + _first_shift(profile, gain, place, contrast2)
        for side in range(2):
            turn = (2 * side - 1) * search.half_width
            aside = step[0] - turn * step[1], step[1] + turn * step[0]
            seen &= _sample_beside(flat, size_px, hidden, center, aside, edge, gain, signal[7 * side : 7 * side + 7])
        middle = int(edge - near + 0.5)
        offset[2] = near + middle - edge
        for i in range(7):
            j = min(max(middle + i - 3, 0), profile.shape[0] - 1)
            signal[14 + i] = gain[0] * profile[j, 0] + gain[1] * profile[j, 1] + gain[2] * profile[j, 2]
        base = 0.5 * (signal[14] + signal[15])
        rise = 0.5 * (signal[19] + signal[20]) - base
        if rise > 0.0 and seen:
            out[k] = edge + _step_shift(signal, offset, base, rise)


@compiled
def _is_inside(size_px: Size, center: Pair, step: Pair, near: float, far: float, half_width: float) -> bool:
    """Whether the picture shows all that is sampled on a bearing between two radii."""
    (width, height), (center_u, center_v), (step_u, step_v) = size_px, center, step
    aside = half_width * far + 1.0
    left = center_u + min((near - 5) * step_u, far * step_u) - aside
    right = center_u + max((near - 5) * step_u, far * step_u) + aside
    top = center_v + min((near - 5) * step_v, far * step_v) - aside
    bottom = center_v + max((near - 5) * step_v, far * step_v) + aside
    return bool(left >= 0 and right < width - 1 and top >= 0 and bottom < height - 1)


@compiled
def _sample_along(
    flat: UInt8Array, size_px: Size, hidden: UInt8Array, center: Pair, step: Pair, near: float, profile: Int64Array
) -> bool:
    """Write the colours every pixel along a bearing, from a radius on; returns whether none of them is hidden."""
    (width, height), (center_u, center_v), (step_u, step_v) = size_px, center, step
    masked = hidden.shape[0] == height
    row = np.uint64(3 * width)
    seen = True
    for i in range(profile.shape[0]):
        u, v = center_u + (near + i) * step_u, center_v + (near + i) * step_v
        x, y = int(u), int(v)
        seen = seen and not (masked and hidden[y, x] != 0)
        fx, fy = int((u - x) * ONE + 0.5), int((v - y) * ONE + 0.5)
        w11 = fx * fy
        w10, w01 = ONE * fy - w11, ONE * fx - w11
        w00 = ONE * (ONE - fx) - w10
        # unsigned: a signed index would be checked for being negative at every access
        at = np.uint64(3 * (y * width + x))
        for c in range(np.uint64(3)):
            profile[i, c] = (
                flat[at + c] * w00
                + flat[at + c + THREE] * w01
                + flat[at + c + row] * w10
                + flat[at + c + row + THREE] * w11
            )
    return seen


@compiled
def _steepest(profile: Int64Array, first: int, last: int) -> int:
    """Return the sample between `first` and `last` at which the colour changes most."""
    steepest, place = -1, (first + last) // 2
    for i in range(first, last + 1):
        slope = 0
        for c in range(3):
            d = profile[i + 1, c] - profile[i - 1, c]
            slope += d * d
        if slope > steepest:
            steepest, place = slope, i
    return place


@compiled
def _weigh_channels(profile: Int64Array, place: int, min_contrast2: float, gain: Int64Array) -> int:
    """Weigh channels by how they distinguish both sides; returns the squared contrast, -1 where it is too small."""
    contrast2, unsaturated2 = 0, 0
    for c in range(3):
        outer = profile[place + 3, c] + profile[place + 2, c]
        gain[c] = (outer - profile[place - 3, c] - profile[place - 2, c]) // (2 * ONE * ONE)
        contrast2 += gain[c] * gain[c]
        if outer < SATURATED * 2 * ONE * ONE:
            unsaturated2 += gain[c] * gain[c]
    if contrast2 <= min_contrast2:
        return -1
    if 10 * unsaturated2 > contrast2 and unsaturated2 > min_contrast2:
        contrast2 = unsaturated2
        for c in range(3):
            if profile[place + 3, c] + profile[place + 2, c] >= SATURATED * 2 * ONE * ONE:
                gain[c] = 0
    return contrast2


@compiled
def _first_shift(profile: Int64Array, gain: Int64Array, place: int, contrast2: int) -> float:
    """Return where the edge lies off the steepest sample, pixels: half-way between both sides, by the slope there."""
    gain0, gain1, gain2 = gain[0], gain[1], gain[2]
    low = gain0 * profile[place - 2, 0] + gain1 * profile[place - 2, 1] + gain2 * profile[place - 2, 2]
    high = gain0 * profile[place + 2, 0] + gain1 * profile[place + 2, 1] + gain2 * profile[place + 2, 2]
    here = gain0 * profile[place, 0] + gain1 * profile[place, 1] + gain2 * profile[place, 2]
    ahead = gain0 * profile[place + 1, 0] + gain1 * profile[place + 1, 1] + gain2 * profile[place + 1, 2]
    behind = gain0 * profile[place - 1, 0] + gain1 * profile[place - 1, 1] + gain2 * profile[place - 1, 2]
    rise = max(0.5 * (ahead - behind), 0.2 * contrast2 * ONE * ONE)
    return float(max(-1.0, min(1.0, (0.5 * (low + high) - here) / rise)))


@compiled
def _sample_beside(
    flat: UInt8Array,
    size_px: Size,
    hidden: UInt8Array,
    center: Pair,
    step: Pair,
    edge: float,
    gain: Int64Array,
    signal: Int64Array,
) -> bool:
    """Write five weighted samples about the edge on a line of sight beside; returns whether none of them is hidden."""
    (width, height), (center_u, center_v), (step_u, step_v) = size_px, center, step
    masked = hidden.shape[0] == height
    row = np.uint64(3 * width)
    gain0, gain1, gain2 = gain[0], gain[1], gain[2]
    seen = True
    for i in range(1, 6):
        radius = edge + i - 3.0
        u, v = center_u + radius * step_u, center_v + radius * step_v
        x, y = int(u), int(v)
        seen = seen and not (masked and hidden[y, x] != 0)
        fx, fy = int((u - x) * ONE + 0.5), int((v - y) * ONE + 0.5)
        w11 = fx * fy
        w10, w01 = ONE * fy - w11, ONE * fx - w11
        w00 = ONE * (ONE - fx) - w10
        at = np.uint64(3 * (y * width + x))
        below = at + row
        signal[i] = (
            w00 * (gain0 * flat[at] + gain1 * flat[at + B1] + gain2 * flat[at + B2])
            + w01 * (gain0 * flat[at + THREE] + gain1 * flat[at + B4] + gain2 * flat[at + B5])
            + w10 * (gain0 * flat[below] + gain1 * flat[below + B1] + gain2 * flat[below + B2])
            + w11 * (gain0 * flat[below + THREE] + gain1 * flat[below + B4] + gain2 * flat[below + B5])
        )
    return seen


@compiled(error_model="numpy")
def _step_shift(signal: Int64Array, offset: FloatArray, base: float, rise: float) -> float:
    """Fit a smooth step to the samples of all three lines of sight; returns its shift, pixels."""
    shift = 0.0
    for _ in range(2):
        numerator, denominator = 0.0, 0.0
        for side in range(3):
            for i in range(5):
                x = (i - 2.0 + offset[side] - shift) / 1.75
                weight = max(1.0 - x * x, 0.0)
                expected = 0.5 + 0.75 * x - 0.25 * x * x * x
                numerator += weight * (expected - (signal[7 * side + i + 1] - base) / rise)
                denominator += weight * weight
        shift = max(-1.5, min(1.5, shift + numerator / denominator * 1.75 / 0.75))
    return shift
