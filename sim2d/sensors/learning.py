"""Learns the models of camera and range sensor from rendered runs whose truth is known."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from field_models import Field
from robocup_vision.camera import OmniCamera
from robocup_vision.mapping.occupancy import FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.sensor_model import SensorModel, SensorTally
from robocup_vision.vision import Vision
from sim2d.sensors.cell_truth import CellTruth
from sim2d.sensors.range_sensor import RangeSensor
from sim2d.sensors.runs import KINDS, map_vision, sensor_run

FLOOR, RANGE = "floor", "range"
KINDS_LEARNT = ("plain", "glare", "shadow", "glare_shadow")
# the farthest ring that is looked at is as deep as so many cells
_DEEPEST_CELLS = 3.0
# probabilities of a model before it is learnt: the evidence does not use them
_UNLEARNT = 0.6, 0.4


def sensor_reach(vision: Vision, scanner: RangeSensor, cell_m: float) -> dict[str, tuple[float, float]]:
    """Ranges (nearest, reach) between which each sensor resolves cells of this size, metres."""
    bounds = vision.grid.ring_bounds_m
    deep = np.flatnonzero(np.diff(bounds) > _DEEPEST_CELLS * cell_m)
    floor_m = float(bounds[deep[0]]) if len(deep) else float(bounds[-1])
    # beams no farther apart than a cell
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
    """Drive runs of each of `KINDS_LEARNT`, and yield the models as learnt so far after each run.

    Parameters
    ----------
    camera : OmniCamera
        With a known viewpoint height.
    seed : int
        Not negative; run k of a kind depends on it, k and the kind alone.
    runs : int
        Of each kind.
    frames : int
        Of each run.

    Notes
    -----
    P(O|E) and P(O|not E) are fractions of the cells that a profile observes, by the rule of the map itself, from the
    true pose of the robot. Cells that are covered by less than half do not count.
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
