"""Distances to a field's white lines: tabulated, or exact with normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.lines.lines import DistanceTable, nearest_lines
from robocup_vision.kernels.lines.rough_distances import count_marks_near_lines

# cell of the distance table, smaller than the step of a coarse search; distance at which the table is truncated, and
# its value there
CELL_M, _TRUNCATE_M, _FAR = 0.05, 0.4, 255


@dataclass(frozen=True, eq=False)
class NearestLine:
    """The nearest lines of N points."""

    distance_m: FloatArray  #: (N,) float64: unsigned distance to the line's centre
    normal: FloatArray  #: (N, 2) float64: unit vector from the line towards the point, field frame
    index: npt.NDArray[np.int64]  #: (N,) int64: index of the line, or, from `len(field.lines)` on, of the arc


class LineMap:
    """Distances to the lines of a field, which needs at least one line or arc."""

    def __init__(self, field: Field) -> None:
        self.field = field
        self.lines = read_only(np.ascontiguousarray(field.lines))
        self.arcs = read_only(np.ascontiguousarray(field.arcs))

    @cached_property
    def distances(self) -> DistanceTable:
        """Truncated distances at the centres of cells, rows along y; 255 if truncated."""
        points = self.field.line_points(0.1)
        low, top = np.zeros((2, 2))
        if len(points):
            low, top = points.min(axis=0) - _TRUNCATE_M, points.max(axis=0) + _TRUNCATE_M
        columns, rows = np.ceil((top - low) / CELL_M).astype(int) + 1
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        cells = np.stack([x.ravel(), y.ravel()], axis=1) * CELL_M + low
        units = np.minimum(self.nearest(cells).distance_m / _TRUNCATE_M, 1.0) * _FAR
        table = np.round(units).astype(np.uint8).reshape(rows, columns)
        return DistanceTable(table, (float(low[0]), float(low[1])), CELL_M, _FAR)

    def nearest(self, points_m: npt.ArrayLike) -> NearestLine:
        """Return the exact nearest lines of field points (N, 2), metres."""
        points = np.ascontiguousarray(np.asarray(points_m, dtype=np.float64).reshape(-1, 2))
        return NearestLine(*nearest_lines(points, self.lines, self.arcs))

    def count_near(self, pose: Pose2, marks: UInt8Array, mark: int, floor_m: FloatArray, near_m: FloatArray) -> int:
        """Count the samples (K, M) of a mark that are closer to a line than `near_m` (M,), metres, at a pose.

        `floor_m` (K, M, 2) are their places, robot frame, metres. Faster than `nearest`.
        """
        at = pose.x_m, pose.y_m, pose.theta_rad
        return int(
            count_marks_near_lines(marks, mark, floor_m, near_m, at, self.lines, self.arcs, self.distances, _TRUNCATE_M)
        )
