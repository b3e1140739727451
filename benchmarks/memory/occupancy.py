"""The free-space map from two sensors against truth: what stands there and is called free, what is free and called so.

A robot drives in the 2D simulation among boxes, robots, fallen robots that the range sensor looks over, and a ball,
under reflections of lamps that move with the viewpoint, sun patches and hard shadows; it is located by its own
camera and odometry. Four methods see the same evidence with the same learnt probabilities: the map's rule, "both
free", log-odds of both sensors summed in one grid, and each sensor alone. A cell counts as occupied if it is covered
by half or more, has a wall in it, or holds the ball's middle, and lies within the camera's reach of the way so far; as
free if nothing covers any of it and it has been in sight. Counted every fifth frame from the first second on.
"""

from __future__ import annotations

import dataclasses
import math
from argparse import Namespace
from collections.abc import Iterator
from time import perf_counter

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Kind, Pool, Table, percent, program, verdict
from field_models import load_field
from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.kernels.mapping import occupancy as kernel
from robocup_vision.mapping.occupancy import FREE, NO_GO, FreeSpaceMap
from robocup_vision.mapping.range_profile import RangeProfile
from robocup_vision.mapping.sensor_model import default_sensors
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.scene import Robot
from sim2d.sensors.learning import CellTruth
from sim2d.sensors.runs import KINDS, SensorFrame, map_vision, sensor_run

FIELD, CAMERA = "ssl_2001", sekimori_camera()
LIGHTS = ("plain", "glare", "shadow", "glare_shadow")
GLARE = ("glare", "glare_shadow")
METHODS = ("map", "both free", "summed", "floor alone", "range alone")
FIELDS_TIMED = ("ssl_2001", "ssl_division_a")
FIRST_COUNTED, COUNTED_EVERY = 10, 5
# light that hides the floor's colour
GLARE_LEVEL = 20.0
# as many independent samples as the cells of the runs are worth: neighbours are seen together
CELL_SAMPLES = 1000
MAX_CALLED_FREE, MIN_POINTS, MAX_TIME_RATIO = 0.2, 3.0, 1.25
# how far off tracks are, and what a mask is larger by
TRACK_STD_M, MASK_MARGIN_M = 0.03, 0.06


class SummedGrid:
    """The baseline: one grid, to which both sensors' log-odds are added by the same evidence."""

    def __init__(self, own: FreeSpaceMap) -> None:
        self._map, self._corner = own, own.corner_m
        self._log_odds = np.zeros((own.cells, own.cells), dtype=np.float32)
        self._counts = np.zeros(self._log_odds.shape, dtype=np.int32)

    def follow(self) -> None:
        """Move the window to where the map's is."""
        now = self._map.corner_m
        shift = [round((a - b) / self._map.cell_m) for a, b in zip(now, self._corner, strict=True)]
        size = self._map.cells
        padded = np.pad(self._log_odds, size)
        first_i, first_j = (size + min(max(s, -size), size) for s in shift)
        self._log_odds = np.ascontiguousarray(padded[first_i : first_i + size, first_j : first_j + size])
        self._corner = now

    def update(self, name: str, profile: RangeProfile) -> None:
        """Add a profile's evidence."""
        model = self._map.sensors[name]
        most = math.log(0.98 / 0.02)
        evidence = self._map.evidence(name, profile)
        kernel.add_evidence(evidence, model.hit_step, model.crossed_step, most, self._log_odds, self._counts)

    @property
    def free(self) -> BoolArray:
        """(N, N) bool: free by the map's own threshold."""
        return self._log_odds < math.log(0.1 / 0.9)


def profiles(frame: SensorFrame) -> tuple[tuple[str, RangeProfile], ...]:
    """Both sensors' profiles by name."""
    return ("floor", frame.floor), ("range", frame.scan)


def in_sight(frame: SensorFrame, centers_m: FloatArray, reach_m: float) -> tuple[BoolArray, BoolArray]:
    """Cells within reach, and those of them in the robot's line of sight."""
    pose = frame.pose
    offset = centers_m - (pose.x_m, pose.y_m)
    away = np.hypot(offset[..., 0], offset[..., 1])
    bearing = np.arctan2(offset[..., 1], offset[..., 0]) - pose.theta_rad
    free_m = true_ranges(frame, bearing.ravel()).reshape(away.shape)
    return away < reach_m, (away < np.minimum(free_m, reach_m)) & (away > frame.scene.field.robot_radius_m)


def glaring(frame: SensorFrame, centers_m: FloatArray) -> BoolArray:
    """Cells in a lamp's or the sun's glare."""
    glare = np.zeros(centers_m.shape[:2], dtype=np.bool_)
    for spot in frame.scene.light.highlights:
        squared = ((centers_m - (spot.x_m, spot.y_m)) ** 2).sum(axis=-1)
        glare |= spot.amplitude * np.exp(-0.5 * squared / spot.sigma_m**2) > GLARE_LEVEL
    return glare


def drive(job: tuple[str, int, int, int]) -> tuple[str, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """One run: per method (occupied called free, occupied, free called free, free, the same two in glare).

    And of the map's free ranges: how many lead farther than a cell's diagonal into something, how many there are, and
    the sums of theirs and of the true ones up to the camera's reach, millimetres.
    """
    kind, seed, number, frames = job
    own = FreeSpaceMap()
    summed = SummedGrid(own)
    field = load_field(FIELD)
    rng = np.random.default_rng([seed, LIGHTS.index(kind), number])
    reach_m = own.sensors["floor"].reach_m
    counts = np.zeros((len(METHODS), 6), dtype=np.int64)
    ranges = np.zeros(4, dtype=np.int64)
    truth: CellTruth | None = None
    for index, frame in enumerate(sensor_run(field, CAMERA, KINDS[kind], rng, frames=frames)):
        if truth is None:
            truth = CellTruth(frame.scene, own.cell_m)
            near, seen, glare = (np.zeros(truth.free.shape, dtype=np.bool_) for _ in range(3))
        if frame.estimated is not None:
            own.move(frame.estimated)
            summed.follow()
            for name, profile in profiles(frame):
                own.update(name, profile)
                summed.update(name, profile)
        here, visible = in_sight(frame, truth.centers_m, reach_m)
        near |= here
        seen |= visible
        glare |= glaring(frame, truth.centers_m)
        if index < FIRST_COUNTED or index % COUNTED_EVERY or frame.estimated is None:
            continue
        occupied, free = truth.window(own)
        occupied &= truth.cut(near, own)
        free &= truth.cut(seen, own)
        dazzled = free & truth.cut(glare, own)
        floor, scan = (own.sensor_state(name) == FREE for name in ("floor", "range"))
        for row, called in enumerate((own.state == FREE, floor & scan, summed.free, floor, scan)):
            cells = (occupied & called, occupied, free & called, free, dazzled & called, dazzled)
            counts[row] += [np.count_nonzero(c) for c in cells]
        bearing = frame.floor.bearing_rad
        reach = own.free_space(frame.estimated, bearing, nearest_m=own.sensors["floor"].nearest_m).range_m
        true_m = true_ranges(frame, bearing)
        too_far = np.count_nonzero(reach > true_m + math.sqrt(2) * own.cell_m)
        sums = (1e3 * np.minimum(r, reach_m).sum() for r in (reach, true_m))
        ranges += np.array([too_far, len(bearing), *sums], dtype=np.int64)
    return kind, counts, ranges


def true_ranges(frame: SensorFrame, bearing_rad: FloatArray) -> FloatArray:
    """Free ranges from the truth, the ball among what stands there."""
    scene = frame.scene
    if scene.ball is not None:
        ball = scene.ball
        scene = dataclasses.replace(scene, robots=(*scene.robots, Robot(ball.x_m, ball.y_m, ball.radius_m)))
    return scene.free_range_m(frame.pose, bearing_rad)


def smear(job: tuple[int, int, int]) -> npt.NDArray[np.int64]:
    """One run with movers, with masks and without: cells that a mover has left, of them not free, of them no-go."""
    seed, number, frames = job
    maps = [FreeSpaceMap(), FreeSpaceMap()]
    rng = np.random.default_rng([seed, len(LIGHTS), number])
    tracks = np.random.default_rng([seed, len(LIGHTS), number, 1])
    counts = np.zeros((2, 3), dtype=np.int64)
    truth: CellTruth | None = None
    reach_m = maps[0].sensors["floor"].reach_m
    for index, frame in enumerate(sensor_run(load_field(FIELD), CAMERA, KINDS["movers"], rng, frames=frames)):
        if truth is None:
            truth = CellTruth(frame.scene, maps[0].cell_m)
            centers = truth.centers_m
            swept, seen = (np.zeros(truth.free.shape, dtype=np.bool_) for _ in range(2))
        if frame.estimated is None:
            continue
        mask = frame.movers_m + np.array([0.0, 0.0, MASK_MARGIN_M])
        mask[:, :2] += TRACK_STD_M * tracks.standard_normal((len(mask), 2))
        for own, discs in zip(maps, (mask, None), strict=True):
            own.move(frame.estimated)
            for name, profile in profiles(frame):
                own.update(name, profile, mask=discs)
        seen |= in_sight(frame, centers, reach_m)[1]
        away = np.linalg.norm(centers[:, :, None] - frame.movers_m[:, :2], axis=-1) - frame.movers_m[:, 2]
        swept |= (away < 0).any(axis=-1)
        left = swept & seen & (away > 2 * maps[0].cell_m).all(axis=-1) & truth.free
        if index < FIRST_COUNTED or index % COUNTED_EVERY:
            continue
        for row, own in enumerate(maps):
            cells = truth.cut(left, own)
            counts[row] += [
                np.count_nonzero(c) for c in (cells, cells & (own.state != FREE), cells & (own.state == NO_GO))
            ]
    return counts


def seconds_per_update(seed: int, rounds: int) -> tuple[dict[str, float], float]:
    """Least time of a move and an update by both sensors on fields of two sizes, and of asking for free ranges."""
    made = {}
    for name in FIELDS_TIMED:
        field = load_field(name)
        vision = map_vision(field, CAMERA)
        rng = np.random.default_rng([seed, 99])
        frames = list(sensor_run(field, CAMERA, KINDS["plain"], rng, frames=30, vision=vision))
        made[name] = FreeSpaceMap(), frames
    best = {name: np.full(len(frames), np.inf) for name, (_, frames) in made.items()}
    for _ in range(rounds):
        # turn about, so that what else the machine does hits both; each frame's least time of all rounds counts
        for name, (own, frames) in made.items():
            for index, frame in enumerate(frames):
                begin = perf_counter()
                own.move(frame.pose)
                for sensor, profile in profiles(frame):
                    own.update(sensor, profile)
                best[name][index] = min(best[name][index], perf_counter() - begin)
    own, frames = made[FIELDS_TIMED[0]]
    asking = math.inf
    for _ in range(rounds):
        own.update("range", frames[-1].scan)
        begin = perf_counter()
        own.free_space(own.robot, frames[-1].floor.bearing_rad, nearest_m=0.11)
        asking = min(asking, perf_counter() - begin)
    return {name: float(times.mean()) for name, times in best.items()}, asking


def ratio(counts: npt.NDArray[np.int64], row: int, column: int) -> float:
    """Ratio that a method gets right, or wrong, of what there is."""
    return float(counts[row, column] / max(counts[row, column + 1], 1))


def accuracy(runs: Iterator[tuple[str, npt.NDArray[np.int64], npt.NDArray[np.int64]]]) -> None:
    """Print what the methods do under each light."""
    by_light = {kind: np.zeros((len(METHODS), 6), dtype=np.int64) for kind in LIGHTS}
    ranges = np.zeros(4, dtype=np.int64)
    for kind, counts, of_run in runs:
        by_light[kind] += counts
        ranges += of_run
    table = Table(
        (
            "light        | method: label | occupied called free %: loss | of cells | free called free %: rate | "
            "in glare %: rate"
        ),
        name="light",
        # the cells of a run are no independent samples
        samples=CELL_SAMPLES,
    )
    for kind, counts in by_light.items():
        for row, method in enumerate(METHODS):
            dazzled = percent(ratio(counts, row, 4)) if counts[row, 5] else None
            ratios = percent(ratio(counts, row, 0)), int(counts[row, 1]), percent(ratio(counts, row, 2)), dazzled
            table.row(kind if row == 0 else "", method, *ratios)
    total, glare = (np.sum([by_light[kind] for kind in kinds], axis=0) for kinds in (LIGHTS, GLARE))
    columns = "figure                                                     | target | measured: by row | verdict"
    judged = Table(columns, name="figures")
    called_free = float(total[0, 0] / max(total[2, 0], 1))
    points = 100 * (ratio(glare, 0, 2) - ratio(glare, 1, 2))
    in_glare = 100 * (ratio(glare, 0, 4) - ratio(glare, 1, 4))
    is_safe, is_open = called_free <= MAX_CALLED_FREE, points >= MIN_POINTS
    judged.row("occupied called free, map / summed log-odds", "<= 0.2", called_free, verdict(is_safe), kind=Kind.ERROR)
    judged.row(
        "free recall in runs with glare, map - both free, points", ">= 3", points, verdict(is_open), kind=Kind.SCORE
    )
    judged.row("the same, only cells that have been in glare", None, in_glare, None, kind=Kind.SCORE)
    into, of_true = 100 * float(ranges[0] / ranges[1]), 100 * float(ranges[2] / ranges[3])
    judged.row("free ranges that lead into something, %", None, into, None, kind=Kind.LOSS, samples=CELL_SAMPLES)
    judged.row("free ranges of the true ones, %", None, of_true, None, kind=Kind.RATE, samples=CELL_SAMPLES)


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    runs, frames = (1, 26) if arguments.quick else (20, 80) if arguments.full else (6, 80)
    for name, model in default_sensors().items():
        print(
            f"{name}: P(O|E) {model.hit_if_occupied:.3f}, P(O|not E) {model.hit_if_free:.3f}, "
            f"n_req {model.observations_needed(0.1)}, reach {model.reach_m} m"
        )
    jobs = [(kind, arguments.seed, number, frames) for kind in LIGHTS for number in range(runs)]
    accuracy(pool.map(drive, jobs))
    swept = np.sum(list(pool.map(smear, [(arguments.seed, number, frames) for number in range(runs)])), axis=0)
    columns = "cells that moving robots have left | cells | not free %: loss | no-go %: loss | verdict"
    table = Table(columns, name="smear", samples=CELL_SAMPLES)
    masked, plain = (row / max(int(row[0]), 1) for row in swept)
    is_clean = bool(masked[2] <= 0.2 * plain[2])
    for name, row, part in (("masked by tracks", swept[0], masked), ("not masked", swept[1], plain)):
        table.row(name, int(row[0]), percent(part[1]), percent(part[2]), verdict(is_clean) if part is masked else None)
    best, asking = seconds_per_update(arguments.seed, 3 if arguments.quick else 20)
    table = Table("a move and an update by both sensors | ms | ratio: time ratio | verdict", name="time")
    small, large = (best[name] for name in FIELDS_TIMED)
    is_level = large / small <= MAX_TIME_RATIO
    table.row(FIELDS_TIMED[0], 1e3 * small, None, None)
    table.row(FIELDS_TIMED[1], 1e3 * large, large / small, verdict(is_level))
    table.row("free ranges asked of the map", 1e3 * asking, asking / small, None)
