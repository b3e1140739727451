"""Silhouette edges, measured along normals to a fraction of a pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled

_WASHED = 0.5  # least over greatest channel: half of the colour is lost to white
_STEP_PX, _MARGIN_PX, _MAX_STEPS = (
    0.5,
    3.0,
    257,
)  # along a normal, beyond its reach, and how many steps there are room for


class EdgeStarts(NamedTuple):
    """Where edges are looked for.

    Parameters
    ----------
    uv, normals : (N, 2) float64
        Pixels, and unit directions that point out of the object.
    reach : (N,) float64
        How far to look to both sides, pixels.
    inside : (N,) float64
        How far the object certainly goes on behind its edge, pixels.
    towards : (N, 3) float64
        Colour difference object - surroundings that each edge must agree with in sign.
    grey : (N,) float64
        How much of the two classes' difference in brightness counts: 1 for white paint, less for paint of a hue, beside
        which grey clutter has edges of its own.
    """

    uv: FloatArray
    normals: FloatArray
    reach: FloatArray
    inside: FloatArray
    towards: FloatArray
    grey: FloatArray


class EdgeOffsets(NamedTuple):
    """Measured edges (N,) float64.

    Parameters
    ----------
    offset : (N,) float64
        Where the edge lies, pixels along the normal; NaN: none.
    contrast : (N,) float64
        Its colour step; -1: dropped as glare.
    sigma : (N,) float64
        The offset's own noise, pixels.
    """

    offset: FloatArray
    contrast: FloatArray
    sigma: FloatArray


class _Profile(NamedTuple):
    """Working memory: colours (M, 3) along one normal, their score (M,), the classes' difference and means (3,)."""

    color: FloatArray
    score: FloatArray
    axis: FloatArray
    mean_in: FloatArray
    mean_out: FloatArray


@compiled
def _read_profile(image: UInt8Array, flat: UInt8Array, starts: EdgeStarts, n: int, count: int, work: _Profile) -> bool:
    """Read the picture along one normal, and its projection on the expected difference; False at the image's border."""
    height, width = image.shape[0], image.shape[1]
    uv, normals, towards, color = starts.uv, starts.normals, starts.towards, work.color
    first = -starts.reach[n] - _MARGIN_PX
    middle_u, middle_v, step_u, step_v = uv[n, 0], uv[n, 1], normals[n, 0], normals[n, 1]
    blue, green, red = towards[n, 0], towards[n, 1], towards[n, 2]
    for i in (0, count - 1):
        t = first + i * _STEP_PX
        u, v = middle_u + t * step_u, middle_v + t * step_v
        if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
            return False
    for i in range(count):
        t = first + i * _STEP_PX
        u, v = middle_u + t * step_u, middle_v + t * step_v
        u0, v0 = int(u), int(v)
        fu, fv = u - u0, v - v0
        # by places in the picture as one row: each pixel's is worked out once for its channels
        above = np.uint64(3 * (v0 * width + u0))
        below = above + np.uint64(3 * width)
        for c in range(3):
            k = np.uint64(c)
            top = flat[above + k] * (1.0 - fu) + flat[above + k + np.uint64(3)] * fu
            bottom = flat[below + k] * (1.0 - fu) + flat[below + k + np.uint64(3)] * fu
            color[i, c] = top * (1.0 - fv) + bottom * fv
        work.score[i] = color[i, 0] * blue + color[i, 1] * green + color[i, 2] * red
    return True


@compiled
def _strongest_step(score: FloatArray, count: int, reach: float) -> int:
    """Index of the strongest box step of +-1.5 px, the nearer the better where two are alike; -1: none."""
    first = -reach - _MARGIN_PX
    best, at = 0.0, -1
    for i in range(6, count - 6):
        t = first + i * _STEP_PX
        value = score[i - 3] + score[i - 2] + score[i - 1] - score[i + 1] - score[i + 2] - score[i + 3]
        if value <= best:
            continue
        value *= max(0.05, 1.0 - abs(t) / reach)
        if value > best:
            best, at = value, i
    return at


@compiled
def _class_means(work: _Profile, at: int, window: tuple[int, int, int]) -> float:
    """Set the mean colours of both classes beside an edge; returns how much brighter the object is."""
    low, high, n_in = window
    n_out = high - (at + 3) + 1
    work.mean_in[:] = 0.0
    work.mean_out[:] = 0.0
    brightness = 0.0
    for c in range(3):
        for i in range(low, low + n_in):
            work.mean_in[c] += work.color[i, c] / n_in
        for i in range(at + 3, high + 1):
            work.mean_out[c] += work.color[i, c] / n_out
        brightness += (work.mean_in[c] - work.mean_out[c]) / 3.0
    return brightness


@compiled
def _middle_crossing(
    work: _Profile, at: int, window: tuple[int, int, int], first: float, norm2: float
) -> tuple[float, float]:
    """Where the profile, projected on the classes' difference, crosses their middle nearest to `at`, and its slope."""
    low, high, _ = window
    last, crossing, slope = 0.0, np.nan, 1.0
    for i in range(low, high + 1):
        value = 0.0
        for c in range(3):
            value += (work.color[i, c] - work.mean_out[c]) * work.axis[c]
        value = value / norm2 - 0.5
        if i > low and last >= 0.0 and value < 0.0:
            t = first + (i - 1 + last / (last - value)) * _STEP_PX
            if math.isnan(crossing) or abs(t - first - at * _STEP_PX) < abs(crossing - first - at * _STEP_PX):
                crossing = t
                slope = (last - value) / _STEP_PX
        last = value
    return crossing, slope


@compiled
def _fine_edge(
    work: _Profile, towards: FloatArray, at: int, window: tuple[int, int, int], grey: tuple[float, float], reach: float
) -> tuple[float, float, float]:
    """Offset, contrast and noise of one edge between its two classes; a NaN offset where there is none.

    `grey` is how much of the difference in brightness counts, and that difference.
    """
    low, high, n_in = window
    keep, brightness = grey
    mean_in, mean_out, axis = work.mean_in, work.mean_out, work.axis
    norm2, agree, size2, var, freedom = 0.0, 0.0, 0.0, 0.0, 0
    for c in range(3):
        axis[c] = mean_in[c] - mean_out[c] - (1.0 - keep) * brightness
        norm2 += axis[c] * (mean_in[c] - mean_out[c])
        agree += axis[c] * towards[c]
        size2 += axis[c] ** 2
    if norm2 < 1.0 or agree <= 0.0:
        return np.nan, 0.0, np.inf
    size = norm2 / math.sqrt(size2)
    for i in range(low, high + 1):
        if low + n_in <= i < at + 3:
            continue
        value = 0.0
        for c in range(3):
            value += (work.color[i, c] - (mean_in[c] if i < at else mean_out[c])) * axis[c]
        var += value**2 / size2
        freedom += 1
    noise = math.sqrt(var / freedom + 1.0)
    if size < 5.0 * noise:
        return np.nan, 0.0, np.inf
    crossing, slope = _middle_crossing(work, at, window, -reach - _MARGIN_PX, norm2)
    if math.isnan(crossing) or abs(crossing) > reach:
        return np.nan, 0.0, np.inf
    return crossing, size, noise / (size * slope)


@compiled
def measure_edges(image: UInt8Array, starts: EdgeStarts, glare: float, found: EdgeOffsets) -> None:
    """Sub-pixel step along the normal of each start point: a two-class edge, its classes taken beside it.

    Parameters
    ----------
    image : (H, W, 3) uint8
    starts : EdgeStarts
        Where to look, and for what.
    glare : float
        Samples are dropped whose inside is brighter than this and has lost half of its colour to white.
    found : EdgeOffsets
        Results.
    """
    work = _Profile(np.empty((_MAX_STEPS, 3)), np.empty(_MAX_STEPS), np.empty(3), np.empty(3), np.empty(3))
    flat = image.reshape(-1)
    for n in range(starts.uv.shape[0]):
        found.offset[n] = np.nan
        found.contrast[n] = 0.0
        found.sigma[n] = np.inf
        reach = starts.reach[n]
        count = min(_MAX_STEPS, int(round(2.0 * (reach + _MARGIN_PX) / _STEP_PX)) + 1)
        if not _read_profile(image, flat, starts, n, count, work):
            continue
        at = _strongest_step(work.score, count, reach)
        if at < 0:
            continue
        near = int(round(min(3.0, max(1.5, starts.inside[n])) / _STEP_PX))
        window = (max(0, at - near), min(count - 1, at + 6), max(1, near // 2))
        brightness = _class_means(work, at, window)
        mean_in = work.mean_in
        brightest = max(mean_in[0], mean_in[1], mean_in[2])
        if brightest >= glare and min(mean_in[0], mean_in[1], mean_in[2]) >= _WASHED * brightest:
            found.contrast[n] = -1.0
            continue
        grey = starts.grey[n]
        offset, contrast, sigma = _fine_edge(work, starts.towards[n], at, window, (grey, brightness), reach)
        if math.isnan(offset):
            continue
        found.offset[n], found.contrast[n], found.sigma[n] = offset, contrast, sigma
        if grey >= 1.0:
            continue
        # brightness is sharper than hue, but only where no grey clutter beside the edge pulls it aside
        sharper, _, spread = _fine_edge(work, starts.towards[n], at, window, (1.0, brightness), reach)
        if abs(sharper - offset) < 0.4:
            both = 1.0 / sigma**2 + 1.0 / spread**2
            found.offset[n] = (offset / sigma**2 + sharper / spread**2) / both
            found.sigma[n] = both**-0.5
