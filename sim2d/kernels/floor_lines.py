"""Compiled: which rays of a match camera meet paint on the floor.

Along a bearing, a straight line covers one interval of distance and a circle two; both have a closed form. Only rays
whose patch of floor overlaps such an interval are computed.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.floor_paint import share_of_arc, share_of_line
from sim2d.kernels.frame_values import Bearings, MirrorView

# unsigned indices need no check for negative ones
ONE = np.uintp(1)
# rows of `PixelRays.rays`
X, Y, SLOPE_LOW, SLOPE_HIGH, GAIN, RADIAL, TANGENTIAL, NEAR, FAR = range(9)


@compiled(inline="always")
def _cut(speed: float, room: float, low: float, high: float) -> tuple[float, float]:
    """Reduce an interval [low, high] of distances d to where d * speed <= room."""
    if speed > 1e-9:
        high = min(high, room / speed)
    elif speed < -1e-9:
        low = max(low, room / speed)
    elif room < 0:
        high = -1.0
    return low, high


@compiled(inline="always")
def _seek(low_m: float, i: int, start: int, stop: int, far_of: Float32Array) -> int:
    """Return the first ray of a bearing whose patch reaches beyond a distance; the search starts at ray i."""
    limit = np.float32(low_m)
    i = min(max(i, start), stop)
    while i > start and far_of[np.uintp(i - 1)] >= limit:
        i -= 1
    while i < stop and far_of[np.uintp(i)] < limit:
        i += 1
    return i


@compiled(error_model="numpy")
def bearings_of(x: FloatArray, y: FloatArray, axis_rad: float, turns: int) -> tuple[int, int]:
    """Return the first and last of `turns` bearings that can meet an outline; both count modulo `turns`.

    Parameters
    ----------
    x, y : (K,) float64
        Corners of the outline relative to the eye, along an arbitrary axis and to its left, metres.
    axis_rad : float
        Direction of that axis in the eye's frame.
    """
    middle_x, middle_y = x.mean(), y.mean()
    low, high = 0.0, 0.0
    for corner in range(len(x)):
        aside, ahead = middle_x * y[corner] - middle_y * x[corner], middle_x * x[corner] + middle_y * y[corner]
        beside = math.atan2(aside, ahead)
        low, high = min(low, beside), max(high, beside)
    if high - low > 0.9 * math.pi:  # the eye is inside the outline, or nearly so
        return 0, turns - 1
    middle = math.atan2(middle_y, middle_x) + axis_rad
    return math.floor((middle + low) * turns / math.tau), math.ceil((middle + high) * turns / math.tau)


@compiled(inline="always")
def _mark(i: np.uintp, covered: np.float32, fraction: Float32Array, marked: Int32Array, count: int) -> int:
    """Raise the painted fraction of a ray's patch; return the number of marked rays."""
    if covered > fraction[i]:
        if fraction[i] == np.float32(0.0):
            marked[count] = i
            count += 1
        fraction[i] = covered
    return count


@compiled(error_model="numpy")
def mark_lines(view: MirrorView, marks: Bearings) -> int:
    """Raise the painted fractions of the patches that straight lines meet; return the number of marked rays."""
    eye, half, lines, farthest_m = view.eye, view.paint.half_m, view.paint.lines, view.farthest_m
    rays, first, directions, spread = view.pixels.rays, view.pixels.first, view.pixels.directions, view.pixels.spread
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    fraction, marked = marks.fraction, marks.marked
    x_of, y_of, radial_of, tangential_of = rays[X], rays[Y], rays[RADIAL], rays[TANGENTIAL]
    near_of, far_of, count = rays[NEAR], rays[FAR], 0
    turns = len(directions)
    corners, wide = np.empty((2, 4)), half + spread[0]
    half_width = np.float32(half)
    for line in range(len(lines)):
        tx, ty = c * lines[line, 2] + s * lines[line, 3], c * lines[line, 3] - s * lines[line, 2]
        half_length = lines[line, 4] / 2
        dx, dy = lines[line, 0] - eye.x_m, lines[line, 1] - eye.y_m
        x, y = c * dx + s * dy + half_length * tx, c * dy - s * dx + half_length * ty
        # the line's middle from the eye, along the line and to its left
        ahead, aside = x * tx + y * ty, y * tx - x * ty
        extra = wide + spread[1] * (math.hypot(x, y) + half_length)
        for corner in range(4):
            corners[0, corner] = ahead + (half_length + extra if corner & 1 else -half_length - extra)
            corners[1, corner] = aside + (extra if corner & 2 else -extra)
        from_k, until_k = bearings_of(corners[0], corners[1], math.atan2(ty, tx), turns)
        middle_x, middle_y = np.float32(x), np.float32(y)
        shape = np.float32(tx), np.float32(ty), np.float32(half_length), half_width
        guess = 0
        for turned in range(from_k, until_k + 1):
            k = turned % turns
            cos, sin = directions[k, 1], directions[k, 2]
            along, across = cos * tx + sin * ty, sin * tx - cos * ty
            near_m, far_m = _cut(across - spread[1], aside + wide, 0.0, farthest_m)
            near_m, far_m = _cut(-across - spread[1], wide - aside, near_m, far_m)
            near_m, far_m = _cut(along - spread[1], ahead + half_length + wide, near_m, far_m)
            near_m, far_m = _cut(-along - spread[1], half_length + wide - ahead, near_m, far_m)
            if near_m > far_m:
                continue
            start, stop = first[k], first[k + 1]
            begin = _seek(near_m, start + guess, start, stop, far_of)
            guess = begin - start
            limit = np.float32(far_m)
            along_ray, across_ray = np.float32(abs(along)), np.float32(abs(across))
            i, end = np.uintp(begin), np.uintp(stop)
            while i < end and near_of[i] <= limit:
                off_x, off_y = x_of[i] - middle_x, y_of[i] - middle_y
                covered = share_of_line(off_x, off_y, shape, along_ray, across_ray, radial_of[i], tangential_of[i])
                count = _mark(i, covered, fraction, marked, count)
                i += ONE
    return count


@compiled(error_model="numpy")
def mark_arcs(view: MirrorView, marks: Bearings, count: int) -> int:
    """As `mark_lines` for arcs; `count` rays are marked already."""
    eye, half, arcs, farthest_m = view.eye, view.paint.half_m, view.paint.arcs, view.farthest_m
    rays, first, directions, spread = view.pixels.rays, view.pixels.first, view.pixels.directions, view.pixels.spread
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    fraction, marked = marks.fraction, marks.marked
    x_of, y_of, radial_of, tangential_of = rays[X], rays[Y], rays[RADIAL], rays[TANGENTIAL]
    near_of, far_of = rays[NEAR], rays[FAR]
    turns = len(directions)
    half_width = np.float32(half)
    for arc in range(len(arcs)):
        dx, dy = arcs[arc, 0] - eye.x_m, arcs[arc, 1] - eye.y_m
        x, y, radius = c * dx + s * dy, c * dy - s * dx, arcs[arc, 2]
        away = math.hypot(x, y)
        extra = half + spread[0] + spread[1] * (away + radius)
        outer, inner = radius + extra, max(radius - extra, 0.0)
        from_k, until_k = 0, turns - 1
        if away > outer:
            middle, beside = math.atan2(y, x), math.asin(outer / away)
            from_k = math.floor((middle - beside) * turns / math.tau)
            until_k = math.ceil((middle + beside) * turns / math.tau)
        center_x, center_y = np.float32(x), np.float32(y)
        aim_x = np.float32(c * arcs[arc, 3] + s * arcs[arc, 4])
        aim_y = np.float32(c * arcs[arc, 4] - s * arcs[arc, 3])
        shape = np.float32(radius), aim_x, aim_y, np.float32(arcs[arc, 5]), half_width
        near_guess, far_guess = 0, 0
        for turned in range(from_k, until_k + 1):
            k = turned % turns
            cos, sin = directions[k, 1], directions[k, 2]
            toward, aside = cos * x + sin * y, cos * y - sin * x
            root2 = outer * outer - aside * aside
            if root2 <= 0:
                continue
            root = math.sqrt(root2)
            gap = math.sqrt(max(inner * inner - aside * aside, 0.0))
            ray_cos, ray_sin = np.float32(cos), np.float32(sin)
            start, stop = first[k], first[k + 1]
            done = start
            for crossing in range(2):
                near_m = toward - root if crossing == 0 else toward + gap
                far_m = min(toward - gap if crossing == 0 else toward + root, farthest_m)
                if near_m > far_m or far_m < 0:
                    continue
                begin = _seek(near_m, start + (near_guess if crossing == 0 else far_guess), start, stop, far_of)
                if crossing == 0:
                    near_guess = begin - start
                else:
                    far_guess = begin - start
                limit = np.float32(far_m)
                i, end = np.uintp(max(begin, done)), np.uintp(stop)
                while i < end and near_of[i] <= limit:
                    off_x, off_y = x_of[i] - center_x, y_of[i] - center_y
                    covered = share_of_arc(off_x, off_y, shape, ray_cos, ray_sin, radial_of[i], tangential_of[i])
                    count = _mark(i, covered, fraction, marked, count)
                    i += ONE
                done = np.int64(i)
    return count
