"""Compiled count of samples near field lines, with a table of distances for rejection."""

from __future__ import annotations

import math

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.lines.lines import DistanceTable, nearest_line

Vector = tuple[float, float, float]


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
    """Count the samples of one mark that are closer to a line than a bound.

    Parameters
    ----------
    marks : (K, M) uint8
        Marks of the samples.
    mark : int
        The mark to count.
    floor_m : (K, M, 2) float64
        Positions of the samples, robot frame, metres.
    near_m : (M,) float64
        Bound on the distance in each column; 0 excludes the column.
    pose : (float, float, float)
        x, y, theta of the robot.
    lines, arcs : (L, 4), (M, 5) float64
        Lines and arcs of the field.
    distances, far_m : DistanceTable, float
        The table of a `LineMap`, and the distance, metres, of its value `far`. Samples that are too far by the table
        are not measured exactly.
    """
    table, (origin_x, origin_y), cell, far = distances
    rows, columns = table.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    # rounding of the values, and half the diagonal of a cell
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
