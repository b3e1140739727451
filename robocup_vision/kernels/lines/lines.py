"""Compiled distances to the lines of a field, and scoring and refinement of poses by them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int32Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.three import solve_3x3

# value of `within2` in `nearest_line` that sets no bound
ANYWHERE2 = 1e30


@compiled
def nearest_line(
    x: float, y: float, lines: FloatArray, arcs: FloatArray, within2: float
) -> tuple[float, float, float, int]:
    """Return distance, unit normal (from the line towards the point) and index of the nearest line or arc.

    If none is closer than the root of `within2`, the distance is that root and the index -1.
    """
    best, foot_x, foot_y, index = within2, 0.0, 0.0, -1
    for i in range(lines.shape[0]):
        x0, y0 = lines[i, 0], lines[i, 1]
        dx, dy = lines[i, 2] - x0, lines[i, 3] - y0
        length2 = dx * dx + dy * dy
        aside = (x - x0) * dy - (y - y0) * dx
        # a line is never closer than its continuation
        if aside * aside >= best * length2 > 0.0:
            continue
        t = ((x - x0) * dx + (y - y0) * dy) / length2 if length2 > 0.0 else 0.0
        t = min(1.0, max(0.0, t))
        fx, fy = x0 + t * dx, y0 + t * dy
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, i
    for j in range(arcs.shape[0]):
        cx, cy, radius, start, sweep = arcs[j, 0], arcs[j, 1], arcs[j, 2], arcs[j, 3], arcs[j, 4]
        away = math.sqrt((x - cx) * (x - cx) + (y - cy) * (y - cy))
        # an arc is never closer than its circle
        if (away - radius) * (away - radius) >= best:
            continue
        if sweep < 0.0:
            start, sweep = start + sweep, -sweep
        angle = math.atan2(y - cy, x - cx)
        if sweep < 2.0 * math.pi:
            past = (angle - start) % (2.0 * math.pi)
            if past > sweep:
                # outside the sweep: the nearer end
                angle = start + sweep if past - sweep < 2.0 * math.pi - past else start
        fx, fy = cx + radius * math.cos(angle), cy + radius * math.sin(angle)
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, lines.shape[0] + j
    distance = math.sqrt(best)
    if index < 0:
        return distance, 0.0, 0.0, index
    if distance > 1e-9:
        return distance, (x - foot_x) / distance, (y - foot_y) / distance, index
    # a point on the line: any unit normal
    if index < lines.shape[0]:
        dx, dy = lines[index, 2] - lines[index, 0], lines[index, 3] - lines[index, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length > 0.0:
            return distance, -dy / length, dx / length, index
        return distance, 1.0, 0.0, index
    j = index - lines.shape[0]
    dx, dy = foot_x - arcs[j, 0], foot_y - arcs[j, 1]
    length = max(1e-12, math.sqrt(dx * dx + dy * dy))
    return distance, dx / length, dy / length, index


@compiled
def nearest_lines(points: FloatArray, lines: FloatArray, arcs: FloatArray) -> tuple[FloatArray, FloatArray, Int64Array]:
    """Find the nearest field line of each point (N, 2).

    Returns distance (N,), unit normal (N, 2) from the line towards the point, and index (N,): lines first, then arcs.
    """
    count = points.shape[0]
    distance, normal, index = np.empty(count), np.empty((count, 2)), np.empty(count, dtype=np.int64)
    for i in range(count):
        distance[i], normal[i, 0], normal[i, 1], index[i] = nearest_line(
            points[i, 0], points[i, 1], lines, arcs, ANYWHERE2
        )
    return distance, normal, index


class DistanceTable(NamedTuple):
    """Table of distances to the nearest line.

    Parameters
    ----------
    values : (H, W) uint8
        Distances in cells, rows along y.
    origin_m : (float, float)
        Middle of the first cell, metres.
    cell_m : float
        Side of a cell.
    far : int
        Value outside the table.
    """

    values: UInt8Array
    origin_m: tuple[float, float]
    cell_m: float
    far: int


class PoseGrid(NamedTuple):
    """Grid of poses, in cells of a table.

    Parameters
    ----------
    headings : (K,) float64
        Radians.
    first : (int, int)
        Cell of the first position, x and y.
    step : int
        Step between positions.
    size : (int, int)
        Number of positions along x and y.
    """

    headings: FloatArray
    first: tuple[int, int]
    step: int
    size: tuple[int, int]


@compiled
def score_pose_grid(points: FloatArray, distances: DistanceTable, grid: PoseGrid) -> Int32Array:
    """Sum the tabulated distances of points at every pose of a grid. Returns (K, count_y, count_x) int32.

    Positions are first + i * step in cells of the table, so that a position only shifts the points' cells. Points
    outside the table have the distance `far`.
    """
    table, (origin_x, origin_y), cell, far = distances
    headings, (first_x, first_y), step, (count_x, count_y) = grid
    rows, columns = table.shape
    number = points.shape[0]
    cost = np.zeros((headings.shape[0], count_y, count_x), dtype=np.int32)
    for k in range(headings.shape[0]):
        c, s = math.cos(headings[k]), math.sin(headings[k])
        for i in range(number):
            px = math.floor((c * points[i, 0] - s * points[i, 1] - origin_x) / cell + 0.5) + first_x
            py = math.floor((s * points[i, 0] + c * points[i, 1] - origin_y) / cell + 0.5) + first_y
            for iy in range(count_y):
                y = py + iy * step
                if y < 0 or y >= rows:
                    for ix in range(count_x):
                        cost[k, iy, ix] += far
                    continue
                for ix in range(count_x):
                    x = px + ix * step
                    cost[k, iy, ix] += table[y, x] if 0 <= x < columns else far
    return cost


@compiled
def refine_line_poses(
    poses: FloatArray,
    points: FloatArray,
    noise_m: FloatArray,
    weight: FloatArray,
    lines: FloatArray,
    arcs: FloatArray,
    scales_m: FloatArray,
) -> FloatArray:
    """Refine poses by Gauss-Newton on point-to-line distances with a Cauchy loss whose scale decreases.

    Parameters
    ----------
    poses : (K, 3) float64
        Starts x, y, theta; refined in place.
    points : (N, 2) float64
        Line points in the robot frame, metres.
    noise_m, weight : (N,) float64
        Standard deviation of each point on the floor, added in quadrature to the loss's scale, and its weight.
    lines, arcs : (L, 4), (M, 5) float64
        Lines and arcs of the field.
    scales_m : (T,) float64
        Scale of the loss at each step.

    Returns
    -------
    (K,) float64
        Mean loss at the last scale: weighted mean of log(1 + (d/scale)^2).
    """
    total = max(weight.sum(), 1e-12)
    loss = np.empty(poses.shape[0])
    a, b, work, step = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    for k in range(poses.shape[0]):
        for turn in range(scales_m.shape[0] + 1):
            scale = scales_m[min(turn, scales_m.shape[0] - 1)]
            c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
            a[:] = 0.0
            b[:] = 0.0
            loss[k] = 0.0
            for i in range(points.shape[0]):
                rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
                d, nx, ny, _ = nearest_line(poses[k, 0] + rx, poses[k, 1] + ry, lines, arcs, ANYWHERE2)
                v2 = scale * scale + noise_m[i] * noise_m[i]
                loss[k] += weight[i] * math.log(1.0 + d * d / v2)
                w = weight[i] / (v2 + d * d)
                jt = ny * rx - nx * ry
                a[0, 0] += w * nx * nx
                a[1, 0] += w * nx * ny
                a[1, 1] += w * ny * ny
                a[2, 0] += w * nx * jt
                a[2, 1] += w * ny * jt
                a[2, 2] += w * jt * jt
                b[0] -= w * nx * d
                b[1] -= w * ny * d
                b[2] -= w * jt * d
            if turn == scales_m.shape[0]:
                break
            damping = 1e-3 * (a[0, 0] + a[1, 1]) + 1e-9
            a[0, 0] += damping
            a[1, 1] += damping
            a[2, 2] += damping
            a[0, 1], a[0, 2], a[1, 2] = a[1, 0], a[2, 0], a[2, 1]
            if not solve_3x3(a, b, work, step):
                break
            dx, dy, dt = step
            reach = math.sqrt(dx * dx + dy * dy)
            if not (reach < 1e3 and abs(dt) < 1e3):
                break
            shrink = min(1.0, 0.5 / max(reach, 1e-12), 0.2 / max(abs(dt), 1e-12))
            poses[k, 0] += shrink * dx
            poses[k, 1] += shrink * dy
            poses[k, 2] += shrink * dt
        loss[k] /= total
    return loss
