"""Where field lines are due in a pinhole camera's picture, a few pixels apart along each, and where they are seen."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.pinhole import camera_axes, in_camera

# grey levels that a line's middle must be brighter than its sides in one sample; samples along it are so far apart
_MIN_RIDGE, _ALONG_STEP_PX = 6.0, 1.5
_MAX_STEPS = 401  # across a line, of half a pixel
_CARPET_GREENNESS = 0.08  # least ratio (2 G - R - B) / (R + G + B) beside a line
_GREEN, _RED, _NEXT = np.uint64(1), np.uint64(2), np.uint64(3)  # from a pixel's blue in the picture as one row

_Weights = tuple[float, float, float, float]


class MarkLimits(NamedTuple):
    """Which places on lines count.

    Parameters
    ----------
    line_width_m : float
        Of the paint.
    spacing_px : float
        Between places on a line.
    min_width_px : float
        Lines that look thinner are left out.
    """

    line_width_m: float
    spacing_px: float
    min_width_px: float


class MarkPlaces(NamedTuple):
    """Places on lines.

    Parameters
    ----------
    marks, pixels, normals : (N, 2) float64
        The places in the field (metres) and in the ideal image (pixels), and unit vectors across the line there.
    widths : (N,) float64
        How wide the line looks, pixels.
    """

    marks: FloatArray
    pixels: FloatArray
    normals: FloatArray
    widths: FloatArray


@compiled
def line_marks(
    points: FloatArray,
    directions: FloatArray,
    view: FloatArray,
    p: FloatArray,
    size: tuple[int, int],
    limits: MarkLimits,
    places: MarkPlaces,
) -> int:
    """Places along lines.

    Parameters
    ----------
    points, directions : (N, 2) float64
        Points along the lines, one line after the other, field frame, metres, and unit vectors along them.
    view, p
        See `kernels.goal.picture.predict_goal`.
    size : (int, int)
        Width and height of the image, pixels.
    limits : MarkLimits
        Which places count.
    places : MarkPlaces
        Results.

    Returns
    -------
    int
        How many places there are.
    """
    marks, pixels, normals, widths = places
    axes = camera_axes(p[2], p[3], p[4])
    (r00, r01, r02), (r10, r11, r12), _ = axes
    fu, fv = view[0] * math.exp(p[6]), view[1] * math.exp(p[6])
    n = variable(0)
    last_u, last_v = -1e9, -1e9
    z = -p[5]
    for k in range(points.shape[0]):
        x, y = points[k, 0] - p[0], points[k, 1] - p[1]
        depth, left, up = in_camera(axes, x, y, z)
        if depth < 0.1:
            continue
        a, b = left / depth, up / depth
        u, v = view[2] - fu * a, view[3] - fv * b
        if not (3.0 < u < size[0] - 4.0 and 3.0 < v < size[1] - 4.0):
            continue
        if math.hypot(u - last_u, v - last_v) < limits.spacing_px:
            continue
        # derivative of the picture by a step on the floor
        dx, dy = directions[k, 0], directions[k, 1]
        along_u = -fu * (dx * (r01 - a * r00) + dy * (r11 - a * r10)) / depth
        along_v = -fv * (dx * (r02 - b * r00) + dy * (r12 - b * r10)) / depth
        across_u = -fu * (-dy * (r01 - a * r00) + dx * (r11 - a * r10)) / depth
        across_v = -fv * (-dy * (r02 - b * r00) + dx * (r12 - b * r10)) / depth
        length = max(math.hypot(along_u, along_v), 1e-12)
        nu, nv = along_v / length, -along_u / length
        width = abs(across_u * nu + across_v * nv) * limits.line_width_m
        if width < limits.min_width_px:
            continue
        marks[n, 0], marks[n, 1] = points[k, 0], points[k, 1]
        pixels[n, 0], pixels[n, 1] = u, v
        normals[n, 0], normals[n, 1] = nu, nv
        widths[n] = width
        last_u, last_v = u, v
        n += 1
    return n


@compiled
def _is_inside(
    start: FloatArray, normal: FloatArray, first: float, last: float, aside: float, columns: int, rows: int
) -> bool:
    """Whether a rectangle lies in the picture: from `first` to `last` along a normal, `aside` to both sides."""
    along_u, along_v = abs(aside * normal[1]), abs(aside * normal[0])
    u0, u1 = start[0] + first * normal[0], start[0] + last * normal[0]
    v0, v1 = start[1] + first * normal[1], start[1] + last * normal[1]
    return bool(
        min(u0, u1) - along_u >= 0.0
        and max(u0, u1) + along_u < columns - 1
        and min(v0, v1) - along_v >= 0.0
        and max(v0, v1) + along_v < rows - 1
    )


@compiled
def _pixels_at(u: float, v: float, columns: int) -> tuple[np.uint64, _Weights]:
    """Place of the pixel left above a point in the picture as one row, and the weights of it and its neighbours."""
    u0, v0 = int(u), int(v)
    fu, fv = u - u0, v - v0
    return np.uint64(3 * (v0 * columns + u0)), ((1.0 - fu) * (1.0 - fv), fu * (1.0 - fv), (1.0 - fu) * fv, fu * fv)


@compiled
def _mean_of(flat: UInt8Array, at: np.uint64, row: np.uint64, weights: _Weights) -> float:
    """Interpolated value of one channel."""
    here, right, below, across = weights
    upper = here * flat[at] + right * flat[at + _NEXT]
    return float(upper + below * flat[at + row] + across * flat[at + row + _NEXT])


@compiled
def measure_ridges(
    image: UInt8Array,
    starts: FloatArray,
    normals: FloatArray,
    reach: float,
    width: FloatArray,
    along_px: float,
    offset: FloatArray,
    contrast: FloatArray,
) -> None:
    """Middle of the white line that crosses each start point's normal nearest, seen against green on both sides.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    starts, normals : (N, 2) float64
        Where a line should be, pixels, and unit directions across it.
    reach : float
        How far to look to both sides, pixels.
    width : (N,) float64
        How wide the line should look, pixels.
    along_px : float
        Over how much of the line the picture is averaged, pixels: so faint a line still counts as this leaves clear of
        the noise. 0: not at all.
    offset, contrast : (N,) float64
        Results: pixels along the normal (NaN: none), and grey levels over the greener sides.
    """
    rows, columns = image.shape[0], image.shape[1]
    step = 0.5
    bright, blue, red = np.empty(_MAX_STEPS), np.empty(_MAX_STEPS), np.empty(_MAX_STEPS)
    repeats = 1 + int(along_px / _ALONG_STEP_PX)
    least = _MIN_RIDGE / math.sqrt(repeats)
    aside, weight, flat = 0.5 * (repeats - 1) * _ALONG_STEP_PX, 1.0 / repeats, image.reshape(-1)
    row = np.uint64(3 * columns)
    for n in range(starts.shape[0]):
        offset[n] = np.nan
        contrast[n] = 0.0
        side = 0.5 * width[n] + 1.5
        margin = side + 1.0
        count = int(round(2.0 * (reach + margin) / step)) + 1
        if count > _MAX_STEPS:
            continue
        first = -reach - margin
        if not _is_inside(starts[n], normals[n], first, first + (count - 1) * step, aside, columns, rows):
            continue
        for i in range(count):
            t = first + i * step
            middle_u, middle_v = starts[n, 0] + t * normals[n, 0], starts[n, 1] + t * normals[n, 1]
            b, r = 0.0, 0.0
            for k in range(repeats):
                s = k * _ALONG_STEP_PX - aside
                at_blue, weights = _pixels_at(middle_u - s * normals[n, 1], middle_v + s * normals[n, 0], columns)
                b += _mean_of(flat, at_blue, row, weights)
                r += _mean_of(flat, at_blue + _RED, row, weights)
            blue[i], red[i], bright[i] = b, r, min(b, r) * weight
        half = max(0, int(0.3 * width[n] / step))
        far = int(round(side / step))
        best, at = least, -1
        for i in range(far + 2, count - far - 2):
            middle = 0.0
            for k in range(i - half, i + half + 1):
                middle += bright[k] / (2 * half + 1)
            left = (bright[i - far] + bright[i - far - 1] + bright[i - far - 2]) / 3.0
            right = (bright[i + far] + bright[i + far + 1] + bright[i + far + 2]) / 3.0
            value = (middle - max(left, right)) * (1.0 - 0.5 * abs(first + i * step) / (reach + 1.0))
            if value <= best:
                continue
            is_on_carpet = True
            for j in (i - far - 1, i + far + 1):
                t = first + j * step
                middle_u, middle_v = starts[n, 0] + t * normals[n, 0], starts[n, 1] + t * normals[n, 1]
                g = 0.0
                for k in range(repeats):
                    s = k * _ALONG_STEP_PX - aside
                    at_blue, weights = _pixels_at(middle_u - s * normals[n, 1], middle_v + s * normals[n, 0], columns)
                    g += _mean_of(flat, at_blue + _GREEN, row, weights)
                greenness = (2.0 * g - red[j] - blue[j]) / (red[j] + g + blue[j] + 30.0 * repeats)
                is_on_carpet = is_on_carpet and greenness >= _CARPET_GREENNESS
            if is_on_carpet:
                best, at = value, i
        if at < 0:
            continue
        peak = at
        for i in range(at - half - 1, at + half + 2):
            if bright[i] > bright[peak]:
                peak = i
        ends = np.empty(2)
        for way in range(2):
            sign = -1 if way == 0 else 1
            base = (bright[at + sign * far] + bright[at + sign * (far + 1)] + bright[at + sign * (far + 2)]) / 3.0
            level = 0.5 * (base + bright[peak])
            i = peak
            while 0 < i + sign < count - 1 and bright[i] > level:
                i += sign
            before = bright[i - sign]
            part = (before - level) / (before - bright[i]) if before > bright[i] else 0.5
            ends[way] = first + (i - sign + sign * part) * step
        seen = ends[1] - ends[0]
        if 0.35 * width[n] - 0.5 < seen < 1.8 * width[n] + 2.0:
            offset[n] = 0.5 * (ends[0] + ends[1])
            contrast[n] = best
