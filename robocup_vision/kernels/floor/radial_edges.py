"""Sub-pixel edges along the bearings of a mirror camera's frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import (
    BoolArray,
    Float32Array,
    FloatArray,
    Int32Array,
    UInt8Array,
    UInt64Array,
)
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.bits import eight_bytes

# bilinear weights are integers in units of 1/ONE pixel, as in OpenCV, because integer arithmetic is twice as fast
ONE = 32
Size = tuple[int, int]
Pair = tuple[float, float]
# a channel of at least this level may be clipped
SATURATED = 245
# bits of the sum of two samples in 1/ONE^2
TWO_SAMPLES_BITS = 11
# samples around an edge on each line of sight, and half the width of the fitted step, pixels
EDGE_SAMPLES, STEP_HALF_PX = 5, 1.75
BYTE, NEXT_PIXEL = np.uint64(255), np.uint64(24)


class Rays(NamedTuple):
    """Bearings along which edges are located.

    Parameters
    ----------
    center_u, center_v : float
        Pixel from which they start.
    step_u, step_v : (K,) float64
        Image direction of each bearing.
    start_px : (K,) float64
        Image radius of the last floor sample; NaN if no edge is to be located.
    """

    center_u: float
    center_v: float
    step_u: FloatArray
    step_v: FloatArray
    start_px: FloatArray


class EdgeSearch(NamedTuple):
    """Parameters of the search for edges.

    Parameters
    ----------
    column_step_px : float
        Uncertainty of `Rays.start_px` outwards.
    half_width : float
        Angle between neighbouring lines of sight, radians.
    min_contrast : float
        Least colour difference of an edge, counts.
    """

    column_step_px: float
    half_width: float
    min_contrast: float


@compiled
def radial_edges(frame: UInt8Array, hidden: UInt8Array, rays: Rays, search: EdgeSearch, out: FloatArray) -> None:
    """Locate the edge between two colours along each bearing with sub-pixel precision.

    The frame is sampled every pixel along the bearing around the coarse edge. The steepest place divides the samples
    into an inner and an outer colour. A smooth step is fitted to the samples of three neighbouring lines of sight,
    projected onto the difference of the two colours, so that colour casts and shadows do not bias it. Channels that
    are saturated on the outer side would bias it and are not used.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    hidden : (H, W) uint8, or (0, 0)
        Non-zero where no bilinear sample may be taken; a bearing that needs one has no edge.
    rays : Rays
        K bearings.
    search : EdgeSearch
        Parameters of the search.
    out : (K,) float64
        Filled with the edge's image radius; NaN if there is none.
    """
    # blur puts the last sample of floor colour about a column and a pixel inside the edge
    span = int(math.ceil(search.column_step_px + 1.0))
    reach = span + 3
    size_px = frame.shape[1], frame.shape[0]
    center = rays.center_u, rays.center_v
    # each step is computed for all bearings before the next, so that arithmetic vectorises
    bearings = rays.start_px.shape[0]
    which, near = np.empty(bearings, np.int64), np.empty(bearings)
    step_u, step_v = np.empty(bearings), np.empty(bearings)
    count = 0
    for k in range(bearings):
        out[k] = np.nan
        if not rays.start_px[k] > 0:
            continue
        step = rays.step_u[k], rays.step_v[k]
        first = rays.start_px[k] + search.column_step_px + 0.5 - reach
        if _is_inside(size_px, center, step, first, first + 2 * reach + 5, search.half_width):
            which[count], near[count], step_u[count], step_v[count] = k, first, step[0], step[1]
            count += 1
    seen = np.ones(count, np.bool_)
    samples = 2 * reach + 1
    places = np.empty((samples, count), np.int32)
    parts = np.empty((2, samples, count), np.int32)
    profile = np.empty((3, samples, count), np.int32)
    _place_samples(center, step_u, step_v, near, size_px[0], places, parts)
    _sample_colors(frame, places, parts, profile)
    _exclude_hidden(hidden, places, frame.shape[1], seen)
    gain, edge = np.empty((3, count), np.int32), np.empty(count)
    signal, base, rise = np.empty((3, EDGE_SAMPLES, count), np.int32), np.empty(count), np.empty(count)
    _find_steps(profile, near, reach - span, reach + span, search.min_contrast, gain, edge, signal[2], base, rise)
    offset = np.empty(count)
    for n in range(count):
        # the neighbouring lines are sampled from two pixels inside the edge on
        offset[n] = near[n] + int(edge[n] - near[n] + 0.5) - edge[n]
        near[n] = edge[n] - 2.0
    aside_u, aside_v = np.empty(count), np.empty(count)
    # separate arrays, because slices are not known to be contiguous and do not vectorise
    places, parts = np.empty((EDGE_SAMPLES, count), np.int32), np.empty((2, EDGE_SAMPLES, count), np.int32)
    colors = np.empty((3, EDGE_SAMPLES, count), np.int32)
    for side in range(2):
        turn = (2 * side - 1) * search.half_width
        for n in range(count):
            aside_u[n], aside_v[n] = step_u[n] - turn * step_v[n], step_v[n] + turn * step_u[n]
        _place_samples(center, aside_u, aside_v, near, size_px[0], places, parts)
        _sample_colors(frame, places, parts, colors)
        _weigh(colors, gain, signal[side])
        _exclude_hidden(hidden, places, frame.shape[1], seen)
    shift = np.empty(count, np.float32)
    _fit_steps(signal, offset, base, rise, shift)
    for n in range(count):
        if rise[n] > 0.0 and seen[n]:
            out[which[n]] = edge[n] + shift[n]


@compiled
def _is_inside(size_px: Size, center: Pair, step: Pair, near: float, far: float, half_width: float) -> bool:
    """Whether all samples of a bearing between two radii are inside the picture."""
    (width, height), (center_u, center_v), (step_u, step_v) = size_px, center, step
    aside = half_width * far + 1.0
    left = center_u + min((near - 5) * step_u, far * step_u) - aside
    right = center_u + max((near - 5) * step_u, far * step_u) + aside
    top = center_v + min((near - 5) * step_v, far * step_v) - aside
    bottom = center_v + max((near - 5) * step_v, far * step_v) + aside
    return bool(left >= 0 and right < width - 1 and top >= 0 and bottom < height - 1)


@compiled
def _place_samples(
    center: Pair,
    step_u: FloatArray,
    step_v: FloatArray,
    near: FloatArray,
    width: int,
    places: Int32Array,
    parts: Int32Array,
) -> None:
    """Write the pixels and sub-pixel offsets of samples that are one pixel apart, from a radius on.

    Fills places (S, N), indices v W + u, and parts (2, S, N), offsets to the right and down in 1/ONE pixels.
    """
    for i in range(places.shape[0]):
        for n in range(places.shape[1]):
            u, v = center[0] + (near[n] + i) * step_u[n], center[1] + (near[n] + i) * step_v[n]
            x, y = np.int32(u), np.int32(v)
            places[i, n] = y * width + x
            parts[0, i, n] = np.int32((u - x) * ONE + 0.5)
            parts[1, i, n] = np.int32((v - y) * ONE + 0.5)


@compiled
def _exclude_hidden(hidden: UInt8Array, places: Int32Array, width: int, seen: BoolArray) -> None:
    """Set `seen` (N,) to False for bearings with a hidden sample."""
    if hidden.shape[0] == 0:
        return
    for i in range(places.shape[0]):
        for n in range(places.shape[1]):
            seen[n] &= hidden[places[i, n] // width, places[i, n] % width] == 0


@compiled(inline="always")
def _weights(across: np.int32, down: np.int32) -> tuple[np.int32, np.int32, np.int32, np.int32]:
    """Return bilinear weights of a pixel, of the one to its right and of the two below, in 1/ONE^2."""
    both = across * down
    below, beside = ONE * down - both, ONE * across - both
    return ONE * (ONE - across) - below, beside, below, both


@compiled
def _gather_pairs(frame: UInt8Array, places: Int32Array, here: UInt64Array, below: UInt64Array) -> None:
    """Fill (N,) each with the bytes of a pixel and the one to its right, and of the two below."""
    flat = frame.reshape(-1)
    row = np.uint64(3 * frame.shape[1])
    for n in range(np.uint64(places.shape[0])):
        # unsigned, because numba tests signed indices for negative ones
        at = np.uint64(3 * places[n])
        here[n], below[n] = eight_bytes(flat, at), eight_bytes(flat, at + row)


@compiled
def _mix_pairs(
    here: UInt64Array, below: UInt64Array, across: Int32Array, down: Int32Array, shift: np.uint64, out: Int32Array
) -> None:
    """Fill one channel's values (N,), in 1/ONE^2; `shift` is the first bit of its byte in the pairs."""
    beside = shift + NEXT_PIXEL
    for n in range(np.uint64(out.shape[0])):
        w00, w01, w10, w11 = _weights(across[n], down[n])
        out[n] = (
            np.int32((here[n] >> shift) & BYTE) * w00
            + np.int32((here[n] >> beside) & BYTE) * w01
            + np.int32((below[n] >> shift) & BYTE) * w10
            + np.int32((below[n] >> beside) & BYTE) * w11
        )


@compiled
def _sample_colors(frame: UInt8Array, places: Int32Array, parts: Int32Array, colors: Int32Array) -> None:
    """Fill colors (3, S, N) with the channels at the places, in 1/ONE^2; only the mixing vectorises."""
    here, below = np.empty(places.size, np.uint64), np.empty(places.size, np.uint64)
    _gather_pairs(frame, places.reshape(-1), here, below)
    for c in range(3):
        _mix_pairs(here, below, parts[0].reshape(-1), parts[1].reshape(-1), np.uint64(8 * c), colors[c].reshape(-1))


@compiled
def _weigh(colors: Int32Array, gain: Int32Array, out: Int32Array) -> None:
    """Fill out (S, N) with colours (3, S, N) weighted by the gains (3, N) of their channels."""
    for i in range(out.shape[0]):
        for n in range(out.shape[1]):
            out[i, n] = gain[0, n] * colors[0, i, n] + gain[1, n] * colors[1, i, n] + gain[2, n] * colors[2, i, n]


@compiled(inline="always")
def _find_steps(
    profile: Int32Array,
    near: FloatArray,
    first: int,
    last: int,
    min_contrast: float,
    gain: Int32Array,
    edge: FloatArray,
    signal: Int32Array,
    base: FloatArray,
    rise: FloatArray,
) -> None:
    """Find the steepest place of each profile (3, S, N), and weight its channels.

    Fills the channels' gains (3, N), the edge's radius (N,), the weighted samples (EDGE_SAMPLES, N) around it, and the
    signal inside it and its rise (N,); the rise is 0 if the contrast is too small.
    """
    _, samples, count = profile.shape
    steepest, at = np.empty(count, np.float32), np.empty(count, np.int32)
    for n in range(count):
        steepest[n], at[n] = np.float32(-1.0), (first + last) // 2
    for i in range(first, last + 1):
        for n in range(count):
            d0 = np.float32(profile[0, i + 1, n] - profile[0, i - 1, n])
            d1 = np.float32(profile[1, i + 1, n] - profile[1, i - 1, n])
            d2 = np.float32(profile[2, i + 1, n] - profile[2, i - 1, n])
            slope = d0 * d0 + d1 * d1 + d2 * d2
            is_steeper = slope > steepest[n]
            steepest[n] = slope if is_steeper else steepest[n]
            at[n] = i if is_steeper else at[n]
    beside = np.empty((7, 3, count), np.int32)
    for n in range(count):
        first_beside = at[n] - 3
        for i in range(7):
            for c in range(3):
                beside[i, c, n] = profile[c, first_beside + i, n]
    contrast2, middle = np.empty(count), np.empty(count, np.int32)
    _weigh_channels(beside, min_contrast * min_contrast, gain, contrast2)
    _shift_to_middle(beside, gain, contrast2, near, at, edge, middle)
    weighed = np.empty((samples, count), np.int32)
    _weigh(profile, gain, weighed)
    for n in range(count):
        place, last_place = middle[n], samples - 1
        inside = weighed[max(place - 3, 0), n] + weighed[max(place - 2, 0), n]
        outside = weighed[min(place + 2, last_place), n] + weighed[min(place + 3, last_place), n]
        for i in range(-2, 3):
            signal[i + 2, n] = weighed[min(max(place + i, 0), last_place), n]
        base[n] = 0.5 * inside
        rise[n] = 0.5 * outside - base[n]


@compiled
def _weigh_channels(beside: Int32Array, min_contrast2: float, gain: Int32Array, contrast2: FloatArray) -> None:
    """Weight channels by their difference across the steepest sample, which is the middle one of `beside` (7, 3, N).

    Fills the gains (3, N) and the squared contrasts (N,), with zeros if the contrast is too small.
    """
    full = SATURATED * 2 * ONE * ONE
    for n in range(contrast2.shape[0]):
        outer0 = beside[6, 0, n] + beside[5, 0, n]
        outer1 = beside[6, 1, n] + beside[5, 1, n]
        outer2 = beside[6, 2, n] + beside[5, 2, n]
        # shifted, because a division of integers takes ten times as long
        step0 = (outer0 - beside[0, 0, n] - beside[1, 0, n]) >> TWO_SAMPLES_BITS
        step1 = (outer1 - beside[0, 1, n] - beside[1, 1, n]) >> TWO_SAMPLES_BITS
        step2 = (outer2 - beside[0, 2, n] - beside[1, 2, n]) >> TWO_SAMPLES_BITS
        open0, open1, open2 = outer0 < full, outer1 < full, outer2 < full
        square0, square1, square2 = step0 * step0, step1 * step1, step2 * step2
        every = square0 + square1 + square2
        unsaturated = (square0 if open0 else 0) + (square1 if open1 else 0) + (square2 if open2 else 0)
        is_seen = every > min_contrast2
        leaves_out = (10 * unsaturated > every) & (unsaturated > min_contrast2)
        gain[0, n] = step0 if is_seen & (open0 | (not leaves_out)) else 0
        gain[1, n] = step1 if is_seen & (open1 | (not leaves_out)) else 0
        gain[2, n] = step2 if is_seen & (open2 | (not leaves_out)) else 0
        contrast2[n] = (unsaturated if leaves_out else every) if is_seen else 0


@compiled(inline="always")
def _weighed(beside: Int32Array, gain: Int32Array, i: int, n: int) -> int:
    """Return a sample weighted by the gains of its channels."""
    return int(gain[0, n] * beside[i, 0, n] + gain[1, n] * beside[i, 1, n] + gain[2, n] * beside[i, 2, n])


@compiled(error_model="numpy")
def _shift_to_middle(
    beside: Int32Array,
    gain: Int32Array,
    contrast2: FloatArray,
    near: FloatArray,
    at: Int32Array,
    edge: FloatArray,
    middle: Int32Array,
) -> None:
    """Fill the radii (N,) where the signal is half-way between both sides, and the nearest samples (N,)."""
    for n in range(edge.shape[0]):
        low, here, high = (
            _weighed(beside, gain, 1, n), _weighed(beside, gain, 3, n), _weighed(beside, gain, 5, n)
        )  # fmt: skip
        slope = 0.5 * (_weighed(beside, gain, 4, n) - _weighed(beside, gain, 2, n))
        rise = max(slope, 0.2 * contrast2[n] * ONE * ONE)
        off = max(-1.0, min(1.0, (0.5 * (low + high) - here) / rise))
        edge[n] = near[n] + at[n] + (off if contrast2[n] > 0.0 else 0.0)
        middle[n] = int(edge[n] - near[n] + 0.5)


@compiled(error_model="numpy")
def _fit_steps(signal: Int32Array, offset: FloatArray, base: FloatArray, rise: FloatArray, shift: Float32Array) -> None:
    """Fit a smooth step to the samples (3, EDGE_SAMPLES, N) of three lines of sight; writes its shift (N,), pixels.

    The third line of sight is the bearing itself, whose samples are off the edge by `offset` (N,), pixels. `base` and
    `rise` (N,) are the signal inside and its increase to the outside.
    """
    count = shift.shape[0]
    first, per_rise = np.zeros((2, count), np.float32), np.empty(count, np.float32)
    start, off, weights = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    one, half, per_width = np.float32(1.0), np.float32(0.5), np.float32(1.0 / STEP_HALF_PX)
    slope, bend, most = np.float32(0.75), np.float32(0.25), np.float32(1.5)
    for n in range(count):
        first[1, n] = offset[n]
        start[n] = base[n]
        per_rise[n] = one / np.float32(rise[n]) if rise[n] > 0.0 else np.float32(0.0)
        shift[n] = np.float32(0.0)
    for _ in range(2):
        for n in range(count):
            off[n], weights[n] = np.float32(0.0), np.float32(0.0)
        for side in range(3):
            begin = first[1 if side == 2 else 0]
            for i in range(EDGE_SAMPLES):
                values, place = signal[side, i], np.float32(i - 2.0)
                for n in range(count):
                    x = (begin[n] + place - shift[n]) * per_width
                    square = x * x
                    weight = one - square if square < one else np.float32(0.0)
                    expected = half + x * (slope - bend * square)
                    off[n] += weight * (expected - (np.float32(values[n]) - start[n]) * per_rise[n])
                    weights[n] += weight * weight
        for n in range(count):
            moved = shift[n] + off[n] / weights[n] * np.float32(STEP_HALF_PX / 0.75)
            shift[n] = -most if moved < -most else most if moved > most else moved
