"""Compiled bounds of where a forward camera's image may show lines and things, so that a tile draws only its own.

A thing's outline is the convex hull of a few points around it. The hull is bounded along four axes in the plane of
slopes, in which straight edges stay straight whatever the lens's distortion.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.floor_paint import SHADE_REACH
from sim2d.kernels.forward.values import ForwardEye, Outlines
from sim2d.kernels.frame_values import FloorPaint, Nets, UprightThings
from sim2d.kernels.things import BALL, BAR, BOX, CYLINDER, HEIGHT, KIND, OTHER, RADIUS, X0, X1, Y0, Y1

# kinds of owners
EDGE, LINE, ARC, SHADE, THING, NET = range(6)
# rows of `Tile.seen` after those of the kinds: outline numbers of the things, lines and nets that a tile may show
THING_ROWS, LINE_ROWS, NET_ROWS = NET + 1, NET + 2, NET + 3
# number of pieces, per full turn, in which an arc is bounded
ARC_PIECES = 24
_NEAR_M = 0.01  # points nearer to the camera's plane are clipped
_POINTS = 8


@compiled(error_model="numpy")
def bound_hull(points: FloatArray, count: int, eye: ForwardEye, thin: float, out: Float32Array) -> int:
    """Bound the convex hull of points in the camera's view.

    Parameters
    ----------
    points : (P, 3) float64
        Points relative to the eye, field axes, metres; only the first `count` are used.
    count : int
        At most 8.
    thin : float
        Width, in slope, below which a hull is called thin.
    out : (10,) float32
        A row of `Outlines.bounds`; overwritten.

    Returns
    -------
    int
        -1: entirely behind the camera; 1: thin; 0 otherwise.
    """
    rotation = eye.rotation
    camera = np.empty((_POINTS, 3))
    seen = np.empty((_POINTS + _POINTS * _POINTS // 4, 2))
    n = 0
    for i in range(count):
        for axis in range(3):
            camera[i, axis] = (
                rotation[0, axis] * points[i, 0] + rotation[1, axis] * points[i, 1] + rotation[2, axis] * points[i, 2]
            )
        if camera[i, 0] >= _NEAR_M:
            seen[n, 0], seen[n, 1] = -camera[i, 1] / camera[i, 0], -camera[i, 2] / camera[i, 0]
            n += 1
    if n == 0:
        return -1
    if n < count:
        for i in range(count):
            for j in range(count):
                if camera[i, 0] >= _NEAR_M and camera[j, 0] < _NEAR_M:
                    part = (camera[i, 0] - _NEAR_M) / (camera[i, 0] - camera[j, 0])
                    left = camera[i, 1] + part * (camera[j, 1] - camera[i, 1])
                    up = camera[i, 2] + part * (camera[j, 2] - camera[i, 2])
                    seen[n, 0], seen[n, 1] = -left / _NEAR_M, -up / _NEAR_M
                    n += 1
    mean_x, mean_y = seen[:n, 0].mean(), seen[:n, 1].mean()
    xx, xy, yy = 0.0, 0.0, 0.0
    for i in range(n):
        x, y = seen[i, 0] - mean_x, seen[i, 1] - mean_y
        xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
    turn = 0.5 * math.atan2(2 * xy, xx - yy)
    c, s = math.cos(turn), math.sin(turn)
    for axis in range(4):
        a, b = (1.0, 0.0) if axis == 0 else (0.0, 1.0) if axis == 1 else (c, s) if axis == 2 else (-s, c)
        low, high = math.inf, -math.inf
        for i in range(n):
            at = a * seen[i, 0] + b * seen[i, 1]
            low, high = min(low, at), max(high, at)
        out[2 * axis], out[2 * axis + 1] = low, high
    out[8], out[9] = c, s
    return 1 if out[7] - out[6] < thin else 0


@compiled(inline="always")
def _add(points: FloatArray, count: int, eye: ForwardEye, thin: float, kind: int, k: int, n: int, to: Outlines) -> int:
    """Append the outline of points to `to`, which has n outlines; return the new n."""
    found = bound_hull(points, count, eye, thin, to.bounds[n])
    if found < 0:
        return n
    to.owners[n, 0], to.owners[n, 1], to.owners[n, 2] = kind, k, found
    return n + 1


@compiled(error_model="numpy")
def outline_floor(paint: FloorPaint, eye: ForwardEye, thin: float, to: Outlines) -> int:
    """Write the outlines of the carpet's edges, of lines and of arcs; return their number.

    Parameters
    ----------
    thin : float
        As in `bound_hull`.
    to : Outlines
        Overwritten from row 0 on.
    """
    points = np.empty((_POINTS, 3))
    points[:, 2] = -eye.height_m
    n, half = 0, paint.half_m
    for k in range(len(paint.edges)):
        for end in range(2):
            points[end, 0] = paint.edges[k, 2 * end] - eye.x_m
            points[end, 1] = paint.edges[k, 2 * end + 1] - eye.y_m
        n = _add(points, 2, eye, thin, EDGE, k, n, to)
    for k in range(len(paint.lines)):
        x, y, tx, ty, length = paint.lines[k]
        for corner in range(4):
            along = length + half if corner & 1 else -half
            aside = half if corner & 2 else -half
            points[corner, 0] = x + along * tx - aside * ty - eye.x_m
            points[corner, 1] = y + along * ty + aside * tx - eye.y_m
        n = _add(points, 4, eye, thin, LINE, k, n, to)
    for k in range(len(paint.arcs)):
        x, y, radius, aim_x, aim_y, sweep = paint.arcs[k]
        half_sweep = math.pi if sweep < -1 else math.acos(sweep)
        aim = math.atan2(aim_y, aim_x)
        pieces = max(1, math.ceil(half_sweep / math.pi * ARC_PIECES))
        step = 2 * half_sweep / pieces
        outer, inner = (radius + half) / math.cos(step / 2), max(radius - half, 0.0)
        for piece in range(pieces):
            for corner in range(4):
                angle = aim - half_sweep + step * (piece + (corner & 1))
                away = outer if corner & 2 else inner
                points[corner, 0] = x + away * math.cos(angle) - eye.x_m
                points[corner, 1] = y + away * math.sin(angle) - eye.y_m
            n = _add(points, 4, eye, thin, ARC, k, n, to)
    return n


@compiled(inline="always")
def _square(x: float, y: float, half: float, low: float, high: float, points: FloatArray) -> None:
    """Write the corners of an upright block around (x, y) into `points`."""
    for corner in range(8):
        points[corner, 0] = x + (half if corner & 1 else -half)
        points[corner, 1] = y + (half if corner & 2 else -half)
        points[corner, 2] = high if corner & 4 else low


@compiled(error_model="numpy")
def outline_things(things: UprightThings, eye: ForwardEye, thin: float, n: int, to: Outlines) -> int:
    """Append the outlines of things and of balls' shadows to n outlines; return the new number.

    Parameters
    ----------
    thin : float
        As in `bound_hull`.
    to : Outlines
        Overwritten from row n on.
    """
    points = np.empty((_POINTS, 3))
    for k in range(len(things.rows)):
        row = things.rows[k]
        kind, foot, x, y = int(row[KIND]), -eye.height_m, row[X0] - eye.x_m, row[Y0] - eye.y_m
        top, radius = foot + row[HEIGHT], row[RADIUS]
        if kind == CYLINDER:
            # the circumscribed square with one side facing the eye
            away = max(math.hypot(x, y), 1e-9)
            ax, ay = x / away * radius, y / away * radius
            for corner in range(8):
                ahead, left = 1.0 if corner & 1 else -1.0, 1.0 if corner & 2 else -1.0
                points[corner, 0] = x + ahead * ax - left * ay
                points[corner, 1] = y + ahead * ay + left * ax
                points[corner, 2] = top if corner & 4 else foot
        elif kind == BALL:
            _square(x, y, SHADE_REACH * radius, foot, foot, points)
            n = _add(points, 4, eye, thin, SHADE, k, n, to)
            _square(x, y, radius, foot, top, points)
        elif kind == BOX:
            for corner in range(8):
                along = radius if corner & 1 else -radius
                aside = row[OTHER] if corner & 2 else -row[OTHER]
                points[corner, 0] = x + along * row[X1] - aside * row[Y1]
                points[corner, 1] = y + along * row[Y1] + aside * row[X1]
                points[corner, 2] = top if corner & 4 else foot
        else:  # a sheet or a bar
            end_x, end_y = row[X1] - eye.x_m, row[Y1] - eye.y_m
            length = max(math.hypot(end_x - x, end_y - y), 1e-9)
            left_x, left_y = -(end_y - y) / length, (end_x - x) / length
            aside = radius if kind == BAR else 0.0
            low = top - radius if kind == BAR else foot
            high = top + radius if kind == BAR else top
            for corner in range(8):
                is_end, left = corner & 1, aside if corner & 2 else -aside
                points[corner, 0] = (end_x if is_end else x) + left * left_x
                points[corner, 1] = (end_y if is_end else y) + left * left_y
                points[corner, 2] = high if corner & 4 else low
        n = _add(points, 8, eye, thin, THING, k, n, to)
    return n


@compiled(error_model="numpy")
def outline_nets(nets: Nets, eye: ForwardEye, n: int, to: Outlines) -> int:
    """Append the outlines of nets to n outlines; return the new number.

    Parameters
    ----------
    to : Outlines
        Overwritten from row n on.
    """
    points = np.empty((_POINTS, 3))
    at = eye.x_m, eye.y_m, eye.height_m
    for k in range(len(nets.rows)):
        row, is_ahead = nets.rows[k], False
        for corner in range(4):
            first, second = row[9] if corner & 1 else 0.0, row[10] if corner & 2 else 0.0
            for axis in range(3):
                points[corner, axis] = row[axis] + first * row[3 + axis] + second * row[6 + axis] - at[axis]
            ahead = eye.rotation[0, 0] * points[corner, 0] + eye.rotation[1, 0] * points[corner, 1]
            is_ahead |= ahead + eye.rotation[2, 0] * points[corner, 2] >= _NEAR_M
        if is_ahead:
            n = _add(points, 4, eye, 0.0, NET, k, n, to)
    return n


@compiled(inline="always")
def overlaps(bounds: Float32Array, left: float, right: float, upper: float, lower: float) -> bool:
    """Return whether a rectangle of slopes may overlap an outline, a row of `Outlines.bounds`."""
    if bounds[0] > right or bounds[1] < left or bounds[2] > lower or bounds[3] < upper:
        return False
    x, y, half_x, half_y = (left + right) / 2, (upper + lower) / 2, (right - left) / 2, (lower - upper) / 2
    c, s = bounds[8], bounds[9]
    at, reach = c * x + s * y, abs(c) * half_x + abs(s) * half_y
    if bounds[4] > at + reach or bounds[5] < at - reach:
        return False
    at, reach = c * y - s * x, abs(c) * half_y + abs(s) * half_x
    return not (bounds[6] > at + reach or bounds[7] < at - reach)
