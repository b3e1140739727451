"""Upright runs and silhouette edges, measured along normals at sub-pixel places."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera
from robocup_vision.kernels.goal.picture import GoalScene

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


class EdgePlaces(NamedTuple):
    """Places at which edges and feet are measured; `expected` aside, one entry a place.

    Parameters
    ----------
    starts, normals : (N, 2) float64
        Pixels, and unit directions that point out of the object.
    edge : (N,) int64
        Which edge; 6: a foot.
    inside : (N,) float64
        How far the object goes on behind its edge, pixels.
    expected : (6,) int64
        Places on each edge that lie inside the image.
    """

    starts: FloatArray
    normals: FloatArray
    edge: Int64Array
    inside: FloatArray
    expected: Int64Array


class _Profile(NamedTuple):
    """Working memory: colours (M, 3) along one normal, their score (M,), the classes' difference and means (3,)."""

    color: FloatArray
    score: FloatArray
    axis: FloatArray
    mean_in: FloatArray
    mean_out: FloatArray


@njit(cache=True, nogil=True)
def sample(image: UInt8Array, u: float, v: float, channel: int) -> float:
    """Bilinear value of one channel; the caller keeps (u, v) inside the image."""
    u0, v0 = int(u), int(v)
    fu, fv = u - u0, v - v0
    top = image[v0, u0, channel] * (1.0 - fu) + image[v0, u0 + 1, channel] * fu
    bottom = image[v0 + 1, u0, channel] * (1.0 - fu) + image[v0 + 1, u0 + 1, channel] * fu
    return float(top * (1.0 - fv) + bottom * fv)


@njit(cache=True, nogil=True)
def _read_profile(image: UInt8Array, starts: EdgeStarts, n: int, count: int, work: _Profile) -> bool:
    """Read the picture along one normal, and its projection on the expected difference; False at the image's border."""
    height, width = image.shape[0], image.shape[1]
    uv, normals, towards = starts.uv, starts.normals, starts.towards
    first = -starts.reach[n] - _MARGIN_PX
    for i in range(count):
        t = first + i * _STEP_PX
        u, v = uv[n, 0] + t * normals[n, 0], uv[n, 1] + t * normals[n, 1]
        if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
            return False
        for c in range(3):
            work.color[i, c] = sample(image, u, v, c)
        work.score[i] = (
            work.color[i, 0] * towards[n, 0] + work.color[i, 1] * towards[n, 1] + work.color[i, 2] * towards[n, 2]
        )
    return True


@njit(cache=True, nogil=True)
def _strongest_step(score: FloatArray, count: int, reach: float) -> int:
    """Index of the strongest box step of +-1.5 px, the nearer the better where two are alike; -1: none."""
    first = -reach - _MARGIN_PX
    best, at = 0.0, -1
    for i in range(6, count - 6):
        t = first + i * _STEP_PX
        value = score[i - 3] + score[i - 2] + score[i - 1] - score[i + 1] - score[i + 2] - score[i + 3]
        value *= max(0.05, 1.0 - abs(t) / reach)
        if value > best:
            best, at = value, i
    return at


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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
    for n in range(starts.uv.shape[0]):
        found.offset[n] = np.nan
        found.contrast[n] = 0.0
        found.sigma[n] = np.inf
        reach = starts.reach[n]
        count = min(_MAX_STEPS, int(round(2.0 * (reach + _MARGIN_PX) / _STEP_PX)) + 1)
        if not _read_profile(image, starts, n, count, work):
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


@njit(cache=True, nogil=True)
def link_runs(
    row: FloatArray, left: FloatArray, right: FloatArray, lean: float, max_gap: float, chain: Int64Array
) -> int:
    """Give each run the number of its chain: the runs that stack into one upright strip. They come sorted by row.

    A run continues the chain whose last run's ends are nearest, within one pixel plus what a strip leaning by `lean`
    (pixels per row) moves; `max_gap` rows may be missing. Returns the number of chains; `chain` (N,) holds each run's.
    """
    count = row.shape[0]
    last = np.empty(count, np.int64)
    chains, oldest = 0, 0
    taken = np.zeros(count, np.bool_)
    for n in range(count):
        best, at = np.inf, -1
        for k in range(oldest, chains):
            m = last[k]
            gap = row[n] - row[m]
            if gap <= 0 or gap > max_gap:
                continue
            tolerance = 1.0 + lean * gap
            off = max(abs(left[n] - left[m]), abs(right[n] - right[m]))
            if off <= tolerance and off + 0.5 * gap < best and not taken[m]:
                best, at = off + 0.5 * gap, k
        if at < 0:
            at = chains
            chains += 1
        else:
            taken[last[at]] = True
        last[at] = n
        chain[n] = at
        while oldest < chains and row[n] - row[last[oldest]] > max_gap:
            oldest += 1
    return chains


@njit(cache=True, nogil=True)
def goal_points(scene: GoalScene, p: FloatArray, points: FloatArray) -> bool:
    """Ideal pixels of where to measure: both ends of each free edge, feet, and points above the feet.

    Parameters
    ----------
    scene, p
        See `kernels.goal.picture.predict_goal`; the stated focal length counts.
    points : (12 + 4 * K, 2) float64
        Results: ends of the six edges, the feet of the left, then of the right post, and as many half a radius higher.

    Returns
    -------
    bool
        Whether all of it is in front of the camera.
    """
    axes = camera_axes(p[2], p[3], p[4])
    shape, view, offsets = scene.shape, scene.camera, scene.offsets
    line_x, half, top, radius = shape[0], 0.5 * shape[1], shape[2], shape[3]
    dx, dz = line_x - p[0], top - p[5]
    side = -1.0 if dx < 0 else 1.0
    elevation, bar_half = math.atan2(dz, abs(dx)), math.asin(min(1.0, radius / math.hypot(dx, dz)))
    count = offsets.shape[0]
    for n in range(12 + 4 * count):
        x, y, z = line_x, 0.0, 0.0
        if n < 8:
            e = n // 2
            y = half if e < 2 else -half
            z = 0.7 * radius if n % 2 == 0 else (top + 0.5 * radius if e == 0 or e == 3 else top - 2.0 * radius)
            bearing = math.atan2(y - p[1], dx)
            wide = math.asin(min(1.0, radius / math.hypot(dx, y - p[1])))
            if e == 0 or e == 2:
                x -= radius * math.sin(bearing + wide)
                y += radius * math.cos(bearing + wide)
            else:
                x += radius * math.sin(bearing - wide)
                y -= radius * math.cos(bearing - wide)
        elif n < 12:
            trim = 0.0 if n < 10 else 2.0 * radius
            y = half - trim if n % 2 == 0 else trim - half
            if n < 10:
                x -= side * radius * math.sin(elevation + bar_half)
                z = top + radius * math.cos(elevation + bar_half)
            else:
                x += side * radius * math.sin(elevation - bar_half)
                z = top - radius * math.cos(elevation - bar_half)
        else:
            k = (n - 12) % (2 * count)
            post_y = half if k < count else -half
            offset = offsets[k % count]
            along = math.sqrt(1.0 - offset**2)
            distance = math.hypot(dx, post_y - p[1])
            ux, uy = dx / distance, (post_y - p[1]) / distance
            x = line_x + radius * (offset * uy - along * ux)
            y = post_y + radius * (-offset * ux - along * uy)
            z = 0.0 if n < 12 + 2 * count else 0.5 * radius
        depth, left, up = in_camera(axes, x - p[0], y - p[1], z - p[5])
        if depth <= 0.05:
            return False
        points[n, 0], points[n, 1] = ideal_pixel(view[0], view[1], view[2], view[3], depth, left, up)
    return True


@njit(cache=True, nogil=True)
def spread_samples(
    points: FloatArray, feet: int, size: tuple[int, int], spacing: float, max_count: int, places: EdgePlaces
) -> int:
    """Places along the edges and at the feet, with outward normals.

    Parameters
    ----------
    points : (12 + 2 * feet, 2) float64
        Of `goal_points`, in image pixels.
    feet : int
        How many of them are feet.
    size : (int, int)
        Width and height of the image, pixels.
    spacing, max_count : float, int
        Pixels between places on an edge, and their greatest number.
    places : EdgePlaces
        Results, with room for 6 * max_count + feet.

    Returns
    -------
    int
        How many places there are; the last `feet` are the feet.
    """
    width, height = size
    starts, normals, edge, inside, expected = places
    n = 0
    for e in range(6):
        expected[e] = 0
        ax, ay, bx, by = points[2 * e, 0], points[2 * e, 1], points[2 * e + 1, 0], points[2 * e + 1, 1]
        length = math.hypot(bx - ax, by - ay)
        if not (1.0 < length < 1e4):
            continue
        partner = e ^ 1
        px = 0.5 * (points[2 * partner, 0] + points[2 * partner + 1, 0]) - ax
        py = 0.5 * (points[2 * partner, 1] + points[2 * partner + 1, 1]) - ay
        nx, ny = (by - ay) / length, -(bx - ax) / length
        across = nx * px + ny * py
        if across > 0:
            nx, ny = -nx, -ny
        count = int(min(max(length / spacing, 4.0), max_count))
        for k in range(count):
            t = (k + 0.5) / count
            u, v = ax + t * (bx - ax), ay + t * (by - ay)
            if 3 < u < width - 4 and 3 < v < height - 4:
                starts[n, 0], starts[n, 1], normals[n, 0], normals[n, 1] = u, v, nx, ny
                edge[n] = e
                inside[n] = 0.5 * abs(across)
                expected[e] += 1
                n += 1
    for k in range(feet):
        u, v = points[12 + k, 0], points[12 + k, 1]
        du, dv = u - points[12 + feet + k, 0], v - points[12 + feet + k, 1]
        length = max(math.hypot(du, dv), 1e-9)
        starts[n, 0], starts[n, 1], normals[n, 0], normals[n, 1] = u, v, du / length, dv / length
        edge[n] = 6
        inside[n] = 4.0
        n += 1
    return n
