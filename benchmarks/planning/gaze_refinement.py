"""Which region of a coarse scan to look at again: the first undecided place on the path beside two simpler orders.

Miura and Shirai 2004, section 4.1. A coarse scan leaves undecided what lies behind the nearest thing in its bearing. A
look settles 20 degrees, and one in ten looks shows nothing. Every rule stops when the shortest path is decided. The
best path is the one planned when everything in sight has been looked at.
"""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Pool, Table, program, verdict
from robocup_vision.arrays import FloatArray
from robocup_vision.planning.gaze.selective_look import SelectiveLook, is_in_sight

LENGTH_M, WIDTH_M, CELL_M = 5.4, 3.6, 0.06
SHAPE = (round(LENGTH_M / CELL_M), round(WIDTH_M / CELL_M))
CORNER_M = (-LENGTH_M / 2, -WIDTH_M / 2)
RADIUS_M = 0.15
OTHERS = (8, 16)
# bearings of the coarse scan, and rays in each of them that a look at full resolution separates
BINS, RAYS = 36, 16
LOOK_RAD = math.radians(10.0)  # to either side of what is looked at
EMPTY_RATIO = 0.1  # ratio of looks that show nothing
MAX_LOOKS = 80
RULES = ("first on the path", "nearest first", "along the straight line")
MAX_OF_NEAREST = 0.5


class World:
    """Robots on a field, as one scan from the start shows them."""

    def __init__(self, seed: list[int]) -> None:
        rng = np.random.default_rng(seed)
        self.start = (-2.3, float(rng.uniform(-1.2, 1.2)))
        self.goal = (2.3, float(rng.uniform(-1.2, 1.2)))
        discs: list[tuple[float, float]] = []
        for _ in range(int(rng.integers(OTHERS[0], OTHERS[1] + 1))):
            place = (float(rng.uniform(-1.7, 1.9)), float(rng.uniform(-1.7, 1.7)))
            if all(math.dist(place, p) > 2 * RADIUS_M for p in (*discs, self.start, self.goal)):
                discs.append(place)
        self.discs = np.array(discs).reshape(-1, 2)
        i, j = np.mgrid[: SHAPE[0], : SHAPE[1]]
        x, y = CORNER_M[0] + (i + 0.5) * CELL_M, CORNER_M[1] + (j + 0.5) * CELL_M
        dx, dy = x - self.start[0], y - self.start[1]
        self._range_m, self._bearing = np.hypot(dx, dy), np.arctan2(dy, dx)
        count = BINS * RAYS
        self._ray_of = np.floor((self._bearing + math.pi) / math.tau * count).astype(np.int64) % count
        self._hit_m = self._hits((np.arange(count) + 0.5) / count * math.tau - math.pi)
        self.free, self.no_go = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
        self._scan()

    def _hits(self, bearing: FloatArray) -> FloatArray:
        """How far each ray reaches, metres."""
        to = self.discs - self.start
        along = np.cos(bearing)[:, None] * to[:, 0] + np.sin(bearing)[:, None] * to[:, 1]
        aside = np.cos(bearing)[:, None] * to[:, 1] - np.sin(bearing)[:, None] * to[:, 0]
        deep = RADIUS_M**2 - aside**2
        hit = np.where((deep > 0) & (along > 0), along - np.sqrt(np.maximum(deep, 0)), np.inf)
        return np.asarray(hit.min(axis=1, initial=np.inf))

    def _scan(self) -> None:
        """See coarsely: behind the nearest thing of a bearing that fills it only in part, nothing is known."""
        hits = self._hit_m.reshape(BINS, RAYS)
        nearest = hits.min(axis=1)
        full = (hits < nearest[:, None] + 2 * RADIUS_M).all(axis=1)
        of = self._ray_of // RAYS
        self.free |= self._range_m < nearest[of] - CELL_M
        self.no_go |= full[of] & (np.abs(self._range_m - nearest[of] - RADIUS_M) <= RADIUS_M) & ~self.free

    def look(self, at_m: tuple[float, float]) -> None:
        """See one direction at full resolution, and fuse it with what is known."""
        bearing = math.atan2(at_m[1] - self.start[1], at_m[0] - self.start[0])
        off = np.remainder(self._bearing - bearing + math.pi, math.tau) - math.pi
        self._fuse(np.abs(off) <= LOOK_RAD)

    def look_everywhere(self) -> None:
        """See everything that can be seen from the start."""
        self._fuse(np.ones(SHAPE, bool))

    def _fuse(self, seen: npt.NDArray[np.bool_]) -> None:
        hit = self._hit_m[self._ray_of]
        undecided = ~self.free & ~self.no_go & seen
        self.free |= undecided & (self._range_m < hit - CELL_M / 2)
        self.no_go |= undecided & ~self.free & (self._range_m < hit + 1.5 * CELL_M)


@dataclass(frozen=True)
class Found:
    """Looks taken, and the path's length; infinite where none is left."""

    looks: int
    length_m: float


def find_way(job: tuple[list[int], str]) -> Found:
    """Look in one rule's order until the shortest path is decided."""
    seed, rule = job
    world, planner = World(seed), SelectiveLook(CELL_M, RADIUS_M, LOOK_RAD)
    rng = np.random.default_rng([*seed, 3])
    tried: list[tuple[float, float]] = []
    for looks in range(MAX_LOOKS):
        chosen = planner.choose(world.free, world.no_go, CORNER_M, world.start, world.goal)
        if chosen.at_m is None:
            return Found(looks, chosen.length_m)
        at = chosen.at_m if rule == RULES[0] else other_place(world, rule, tried)
        if at is None:
            at = chosen.at_m
        tried.append(at)
        planner.observe(at, world.start)
        if rng.random() >= EMPTY_RATIO:
            world.look(at)
    return Found(MAX_LOOKS, math.inf)


def other_place(world: World, rule: str, tried: list[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the undecided place in sight that comes first by another rule."""
    cells = np.argwhere(~world.free & ~world.no_go)
    places = np.array(CORNER_M) + (cells + 0.5) * CELL_M
    away = np.hypot(*(places - world.start).T)
    key = away
    if rule == "along the straight line":
        line = np.array(world.goal) - world.start
        length = float(np.hypot(*line))
        along = np.clip((places - world.start) @ line / length, 0, length)
        key = np.hypot(*(places - (world.start + along[:, None] * line / length)).T) + 1e-3 * along
    start = (int((world.start[0] - CORNER_M[0]) / CELL_M), int((world.start[1] - CORNER_M[1]) / CELL_M))
    # as the planner, no rule looks at anything a third time
    bearing = np.arctan2(*(places - world.start).T[::-1])
    turned = np.array([math.atan2(y - world.start[1], x - world.start[0]) for x, y in tried]).reshape(-1, 1)
    off = np.remainder(bearing - turned + math.pi, math.tau) - math.pi
    fresh = (np.abs(off) < LOOK_RAD).sum(axis=0) < 2
    for k in np.argsort(key, kind="stable").tolist():
        if fresh[k] and is_in_sight(world.no_go, start, (int(cells[k, 0]), int(cells[k, 1]))):
            return float(places[k, 0]), float(places[k, 1])
    return None


def best_length_m(seed: list[int]) -> float:
    """Length of the path when everything has been looked at."""
    world = World(seed)
    world.look_everywhere()
    return (
        SelectiveLook(CELL_M, RADIUS_M, LOOK_RAD)
        .choose(world.free, world.no_go, CORNER_M, world.start, world.goal)
        .length_m
    )


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    maps = 40 if arguments.quick else 1000 if arguments.full else 200
    seeds = [[arguments.seed, 13, i] for i in range(maps)]
    best = list(pool.map(best_length_m, seeds, chunksize=10))
    found = {rule: list(pool.map(find_way, [(seed, rule) for seed in seeds], chunksize=5)) for rule in RULES}
    table = Table(
        (
            "order                   | looks: error | of nearest first | longest | "
            "paths longer than best: count | target | verdict"
        ),
        f"selective refinement, {maps} maps, {sum(map(math.isfinite, best))} with a way",
        name="looks",
        samples=maps,
    )
    looks = {rule: float(np.mean([f.looks for f in runs])) for rule, runs in found.items()}
    ours, nearest, straight = (looks[rule] for rule in RULES)
    for rule, runs in found.items():
        longer = sum(f.length_m > b * (1 + 1e-3) for f, b in zip(runs, best, strict=True) if math.isfinite(b))
        text = target = ""
        if rule == RULES[0]:
            ok = ours <= MAX_OF_NEAREST * nearest and ours <= straight and longer == 0
            target, text = f"<= {MAX_OF_NEAREST}, <= straight, 0", verdict(ok)
        table.row(rule, looks[rule], looks[rule] / nearest, max(f.looks for f in runs), longer, target, text)
