"""Compiled drawing of field lines as a pinhole camera shows them, anti-aliased and blurred; light adds up at crossings.

Drawings have a margin of `MARGIN` pixels around the picture, so that no stroke is cut. They are zero before drawing,
and the caller clears the rows with paint.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera

MARGIN = 4
# distances between strokes along a line, where blur leaves no gap, and across it
_ALONG_PX, _ACROSS_PX = 1.2, 0.8
_REACH = 2
_WIDE = 2 * _REACH + 1
_PARTS = 64  # number of parts of a pixel for which strokes are made in advance


class LinePen(NamedTuple):
    """Lines, their width and the table of strokes.

    Parameters
    ----------
    points : (N, 2) float64
        Points along the lines, one line after the other, field frame, metres.
    starts : (L + 1,) int64
        Index of each line's first point, and N.
    width_m : float
        Width of the paint.
    strokes : (P, 5) float32
        See `stroke_table`.
    """

    points: FloatArray
    starts: Int64Array
    width_m: float
    strokes: Float32Array


def stroke_table(blur_px: float) -> Float32Array:
    """Return the light (65, 5) in five pixels of strokes that are -1/2 to 1/2 pixel off the middle one.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the picture's blur, including the pixel's own size.
    """
    off = np.arange(_PARTS + 1)[:, None] / _PARTS - 0.5
    at = np.arange(-_REACH, _REACH + 1)
    return np.asarray(np.exp(-0.5 * ((at - off) / blur_px) ** 2) / (math.sqrt(math.tau) * blur_px), np.float32)


@compiled(fastmath={"contract"})
def _draw_stroke(strokes: Float32Array, u: float, v: float, weight: float, drawing: Float32Array) -> None:
    """Add one stroke to a drawing, at least `_REACH` pixels inside it; coordinates include the margin."""
    iu, iv = int(u + 0.5), int(v + 0.5)
    at_u, at_v = (u - iu + 0.5) * _PARTS, (v - iv + 0.5) * _PARTS
    ku, kv = min(max(int(at_u), 0), _PARTS - 1), min(max(int(at_v), 0), _PARTS - 1)
    fu, fv = np.float32(at_u - ku), np.float32(at_v - kv)
    light = np.float32(weight)
    s0 = strokes[ku, 0] + fu * (strokes[ku + 1, 0] - strokes[ku, 0])
    s1 = strokes[ku, 1] + fu * (strokes[ku + 1, 1] - strokes[ku, 1])
    s2 = strokes[ku, 2] + fu * (strokes[ku + 1, 2] - strokes[ku, 2])
    s3 = strokes[ku, 3] + fu * (strokes[ku + 1, 3] - strokes[ku, 3])
    s4 = strokes[ku, 4] + fu * (strokes[ku + 1, 4] - strokes[ku, 4])
    left = iu - _REACH
    for j in range(_WIDE):
        row = iv + j - _REACH
        side = light * (strokes[kv, j] + fv * (strokes[kv + 1, j] - strokes[kv, j]))
        drawing[row, left] += side * s0
        drawing[row, left + 1] += side * s1
        drawing[row, left + 2] += side * s2
        drawing[row, left + 3] += side * s3
        drawing[row, left + 4] += side * s4


@compiled
def draw_lines(pen: LinePen, view: FloatArray, p: FloatArray, first_row: int, drawing: Float32Array) -> tuple[int, int]:
    """Draw lines: add the fraction of paint in each pixel, 0 to 1.

    Parameters
    ----------
    pen : LinePen
        Lines and strokes.
    view, p
        See `kernels.goal.picture.predict_goal`.
    first_row : int
        Row of the image with which the picture begins.
    drawing : (H + 2 MARGIN, W + 2 MARGIN) float32
        Picture to which paint is added.

    Returns
    -------
    (int, int)
        First row of the drawing that may hold paint, and the first one after it.
    """
    points = pen.points
    height, width = drawing.shape
    axes = camera_axes(p[2], p[3], p[4])
    (r00, r01, r02), (r10, r11, r12), _ = axes
    fu, fv = view[0] * math.exp(p[6]), view[1] * math.exp(p[6])
    middle_u, middle_v = view[2] + MARGIN, view[3] + MARGIN - first_row
    z = -p[5]
    low, high_u, high_v = float(_REACH), width - _REACH - 1.0, height - _REACH - 1.0
    min_v, max_v = 1e9, -1e9
    for line in range(pen.starts.shape[0] - 1):
        is_before = False
        before_u, before_v = 0.0, 0.0
        end = pen.starts[line + 1]
        for k in range(pen.starts[line], end):
            depth, left, up = in_camera(axes, points[k, 0] - p[0], points[k, 1] - p[1], z)
            if depth < 0.1:
                is_before = False
                continue
            u, v = ideal_pixel(fu, fv, middle_u, middle_v, depth, left, up)
            from_u, from_v, is_first = before_u, before_v, not is_before
            before_u, before_v, is_before = u, v, True
            length = math.hypot(u - from_u, v - from_v)
            if (
                is_first
                or length < 1e-6
                or max(u, from_u) < 0.0
                or min(u, from_u) > width
                or max(v, from_v) < 0.0
                or min(v, from_v) > height
            ):
                continue
            # width in the image, by a step across the line on the floor at the segment's end
            dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
            length_m = math.hypot(dx, dy)
            nx, ny = -dy / length_m, dx / length_m
            a, b = (middle_u - u) / fu, (middle_v - v) / fv
            across_u = -fu * (nx * (r01 - a * r00) + ny * (r11 - a * r10)) / depth
            across_v = -fv * (nx * (r02 - b * r00) + ny * (r12 - b * r10)) / depth
            wide = abs(across_u * (v - from_v) - across_v * (u - from_u)) / length * pen.width_m
            steps, strokes = int(length / _ALONG_PX) + 1, int(wide / _ACROSS_PX) + 1
            weight = wide / strokes * length / steps
            for s in range(strokes):
                off = ((s + 0.5) / strokes - 0.5) * pen.width_m
                for i in range(steps):
                    t = (i + 0.5) / steps
                    cu = from_u + t * (u - from_u) + off * across_u
                    cv = from_v + t * (v - from_v) + off * across_v
                    if cu >= low and cu < high_u and cv >= low and cv < high_v:
                        _draw_stroke(pen.strokes, cu, cv, weight, drawing)
                        min_v, max_v = min(min_v, cv), max(max_v, cv)
    if max_v < min_v:
        return 0, 0
    return int(min_v + 0.5) - _REACH, int(max_v + 0.5) + _REACH + 1
