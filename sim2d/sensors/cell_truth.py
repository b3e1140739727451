"""Which cells of a map on the field are free and which occupied, by the scene itself."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FreeSpaceMap
from sim2d.rendering.scene import Scene

# points along each side of a cell at which its cover is tested
_POINTS = 5


class CellTruth:
    """The cells of a field.

    Attributes
    ----------
    occupied : (A, B) bool
        Cells covered by half or more, that of the ball's middle, and those in which the field's walls stand: off the
        floor, next to cells with floor. Cells behind the walls are not occupied.
    free : (A, B) bool
        Cells of which nothing covers any part. Cells that are neither are partly covered.
    """

    def __init__(self, scene: Scene, cell_m: float) -> None:
        self.cell_m = cell_m
        field = scene.field
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        self.first = np.floor(low / cell_m).astype(int) - 1
        size = np.ceil(high / cell_m).astype(int) + 1 - self.first
        parts = (np.arange(_POINTS) + 0.5) / _POINTS
        along = [((np.arange(n) + f)[:, None] + parts).ravel() * cell_m for n, f in zip(size, self.first, strict=True)]
        points = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1)
        off_floor = ~field.contains(points.reshape(-1, 2)).reshape(points.shape[:2])
        covered = np.zeros_like(off_floor)
        for box in scene.boxes:
            local = np.abs(Pose2(box.x_m, box.y_m, box.yaw_rad).inverse().transform(points))
            covered |= (local[..., 0] <= box.width_m / 2) & (local[..., 1] <= box.depth_m / 2)
        round_things = scene.footprint_circles().tolist()
        if scene.ball is not None:
            round_things.append([scene.ball.x_m, scene.ball.y_m, scene.ball.radius_m])
        for x, y, radius in round_things:
            covered |= np.hypot(points[..., 0] - x, points[..., 1] - y) <= radius

        def covered_part(blocked: BoolArray) -> FloatArray:
            return np.asarray(blocked.reshape(size[0], _POINTS, size[1], _POINTS).mean(axis=(1, 3)))

        off = covered_part(off_floor)
        next_to_floor = cv2.dilate((off < 0.5).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        self.free: BoolArray = covered_part(off_floor | covered) == 0.0
        self.occupied: BoolArray = covered_part(covered) >= 0.5
        if field.is_bounded:
            self.occupied |= (off >= 0.5) & next_to_floor
        if scene.ball is not None:
            i, j = np.floor(np.array([scene.ball.x_m, scene.ball.y_m]) / cell_m).astype(int) - self.first
            self.occupied[i, j] = True
        self._clear_of_panels(scene)

    def _clear_of_panels(self, scene: Scene) -> None:
        """Mark cells with a thin wall in them as not free."""
        for wall in scene.walls():
            ends = np.array([[wall.x0_m, wall.y0_m], [wall.x1_m, wall.y1_m]])
            count = 2 + int(np.linalg.norm(ends[1] - ends[0]) / self.cell_m * _POINTS)
            along = ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])
            i, j = np.floor(along / self.cell_m).astype(int).T - self.first[:, None]
            self.free[i, j] = False

    def window(self, grid: FreeSpaceMap) -> tuple[BoolArray, BoolArray]:
        """Occupied and free cells (N, N) of a map as it lies now."""
        return self.cut(self.occupied, grid), self.cut(self.free, grid)

    def cut(self, cells: BoolArray, grid: FreeSpaceMap) -> BoolArray:
        """Cut a map's window (N, N) out of values of the field's cells; false off the field."""
        offset = np.rint(np.array(grid.corner_m) / self.cell_m).astype(int) - self.first
        along = [o + np.arange(grid.cells) for o in offset]
        inside = [(i >= 0) & (i < n) for i, n in zip(along, cells.shape, strict=True)]
        window = cells[np.ix_(*(np.clip(i, 0, n - 1) for i, n in zip(along, cells.shape, strict=True)))]
        return np.asarray(window & inside[0][:, None] & inside[1][None, :])

    @property
    def centers_m(self) -> FloatArray:
        """(A, B, 2) float64: middles of the cells, field frame, metres."""
        along = [(np.arange(n) + f + 0.5) * self.cell_m for n, f in zip(self.free.shape, self.first, strict=True)]
        return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1)
