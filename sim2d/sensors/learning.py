"""Learns the models of camera and range sensor from rendered runs, in whose scenes the occupied cells are known."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np

from field_models import Field
from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.sensor_model import SensorModel, SensorTally
from robocup_vision.vision import Vision
from sim2d.rendering.scene import Scene
from sim2d.sensors.range_sensor import RangeSensor
from sim2d.sensors.runs import KINDS, map_vision, sensor_run

FLOOR, RANGE = "floor", "range"
KINDS_LEARNT = ("plain", "glare", "shadow", "glare_shadow")
# depth, in cells, up to which rings are used
_DEEPEST_CELLS = 3.0
# placeholder probabilities before a model is learnt; the evidence does not depend on them
_UNLEARNT = 0.6, 0.4
# number of test points along each side of a cell
_POINTS = 5


class CellTruth:
    """Which cells of a field are truly occupied or free.

    Attributes
    ----------
    occupied : (A, B) bool
        Cells that are at least half covered, the cell of the ball's middle, and the cells of the field's walls: off the
        floor, next to cells with floor. Cells behind the walls are not occupied.
    free : (A, B) bool
        Cells that are not covered at all. Cells that are neither are partly covered.
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
        """Occupied and free cells (N, N) in the present window of a map."""
        return self.cut(self.occupied, grid), self.cut(self.free, grid)

    def cut(self, cells: BoolArray, grid: FreeSpaceMap) -> BoolArray:
        """Cut a map's window (N, N) out of an array of the field's cells; false outside of the field."""
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


def sensor_reach(vision: Vision, scanner: RangeSensor, cell_m: float) -> dict[str, tuple[float, float]]:
    """Nearest and farthest range, metres, between which each sensor resolves cells of this size."""
    bounds = vision.grid.ring_bounds_m
    deep = np.flatnonzero(np.diff(bounds) > _DEEPEST_CELLS * cell_m)
    floor_m = float(bounds[deep[0]]) if len(deep) else float(bounds[-1])
    # up to where neighbouring beams are one cell apart
    range_m = min(scanner.reach_m, cell_m * scanner.beams / math.tau)
    return {FLOOR: (round(float(bounds[0]), 3), round(floor_m, 3)), RANGE: (0.0, round(range_m, 3))}


def learn_sensors(
    field: Field,
    camera: OmniCamera,
    seed: int,
    *,
    runs: int,
    frames: int,
    cell_m: float = 0.04,
    scanner: RangeSensor | None = None,
) -> Iterator[dict[str, SensorModel]]:
    """Drive runs of each of `KINDS_LEARNT`, and yield the models learnt so far after each run.

    Parameters
    ----------
    camera : OmniCamera
        Camera with a known viewpoint height.
    seed : int
        Not negative; run k of a kind depends only on the seed, k and the kind.
    runs : int
        Number of runs of each kind.
    frames : int
        Number of frames of each run.

    Notes
    -----
    P(O|E) and P(O|not E) are fractions of the cells that a profile observes from the robot's true pose, by the map's
    own rule. Partly covered cells do not count.
    """
    scanner = scanner or RangeSensor()
    vision = map_vision(field, camera)
    reach = sensor_reach(vision, scanner, cell_m)
    unlearnt = {name: SensorModel(*_UNLEARNT, *span) for name, span in reach.items()}
    grid = FreeSpaceMap(unlearnt, FreeSpaceMapSettings(cell_m=cell_m))
    tallies = {name: SensorTally() for name in reach}
    for run in range(runs):
        for number, kind in enumerate(KINDS_LEARNT):
            rng = np.random.default_rng([seed, run, number])
            truth: CellTruth | None = None
            seen = sensor_run(field, camera, KINDS[kind], rng, frames=frames, scanner=scanner, vision=vision)
            for frame in seen:
                if truth is None:
                    truth = CellTruth(frame.scene, cell_m)
                grid.move(frame.pose)
                occupied, free = truth.window(grid)
                for name, profile in ((FLOOR, frame.floor), (RANGE, frame.scan)):
                    tallies[name].add(grid.evidence(name, profile), occupied, free)
            yield {name: tally.model(*reach[name]) for name, tally in tallies.items()}
