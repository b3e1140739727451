"""Compiled loops that ask a table how far lines are: poses compared by it, and samples near lines counted."""

from __future__ import annotations

import math

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.lines.lines import DistanceTable, nearest_line

Vector = tuple[float, float, float]


@compiled
def mean_rough_distance(points: FloatArray, pose: Vector, distances: DistanceTable, far_m: float) -> float:
    """Mean of the tabulated distance, between cells bilinear, of points (N, 2) seen from a pose x, y, theta.

    Metres; `far_m` is the distance that the table's value `far` says, and that of points outside it.
    """
    table, (origin_x, origin_y), cell, far = distances
    rows, columns = table.shape
    c, s, total = math.cos(pose[2]), math.sin(pose[2]), 0.0
    for i in range(points.shape[0]):
        x = (pose[0] + c * points[i, 0] - s * points[i, 1] - origin_x) / cell
        y = (pose[1] + s * points[i, 0] + c * points[i, 1] - origin_y) / cell
        if not (0.0 <= x <= columns - 1 and 0.0 <= y <= rows - 1):
            total += far
            continue
        ix, iy = min(int(x), columns - 2), min(int(y), rows - 2)
        fx, fy = x - ix, y - iy
        above = table[iy, ix] * (1.0 - fx) + table[iy, ix + 1] * fx
        below = table[iy + 1, ix] * (1.0 - fx) + table[iy + 1, ix + 1] * fx
        total += above * (1.0 - fy) + below * fy
    return float(total * far_m / far / points.shape[0])


@compiled
def count_marks_near_lines(
    marks: UInt8Array,
    mark: int,
    floor_m: FloatArray,
    near_m: FloatArray,
    pose: Vector,
    lines: FloatArray,
    arcs: FloatArray,
    distances: DistanceTable,
    far_m: float,
) -> int:
    """Count the samples of a mark that a line is nearer to than so much.

    Parameters
    ----------
    marks : (K, M) uint8
        What samples show.
    mark : int
        Which of them count.
    floor_m : (K, M, 2) float64
        Where they lie, robot frame, metres.
    near_m : (M,) float64
        How near a line must be in each column; none is nearer than 0.
    pose : (float, float, float)
        x, y, theta of the robot.
    lines, arcs : (L, 4), (M, 5) float64
        Of the field.
    distances, far_m : DistanceTable, float
        As in `mean_rough_distance`: what it puts far off is not measured.
    """
    table, (origin_x, origin_y), cell, far = distances
    rows, columns = table.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    # values are rounded, and a point may lie in its cell's corner
    per_m, slack = far / far_m, 0.501 + (far / far_m) * math.sqrt(0.501) * cell
    count = 0
    for k in range(marks.shape[0]):
        for m in range(marks.shape[1]):
            if marks[k, m] != mark or not near_m[m] > 0.0:
                continue
            x = pose[0] + c * floor_m[k, m, 0] - s * floor_m[k, m, 1]
            y = pose[1] + s * floor_m[k, m, 0] + c * floor_m[k, m, 1]
            column, row = (x - origin_x) / cell + 0.5, (y - origin_y) / cell + 0.5
            if 0.0 <= column < columns and 0.0 <= row < rows:
                if table[int(row), int(column)] > per_m * near_m[m] + slack:
                    continue
            count += nearest_line(x, y, lines, arcs, near_m[m] * near_m[m])[3] >= 0
    return count
