"""The world of planning/speed.py for unknown surroundings: opponents behind others, and a robot that finds them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

from benchmarks.worlds.uncertain_robot import MATCHED, Errors
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion.path_following import drive, nearest_on_path
from robocup_vision.planning import (
    Disc,
    MotionLimits,
    PathFollower,
    PoseNoise,
    SpeedPlanner,
    UndecidedFloor,
    UndecidedSpeed,
    looks_to_decide,
)

RADIUS_M, LENGTH_M, WIDTH_M, CELL_M = 0.09, 6.0, 3.0, 0.06
PERIOD_S, EVERY = 1 / 30, 6
LIMITS = MotionLimits(1.5, 2.0)
# from that log-odds on a cell is decided: 1 in 50 is wrong
DECIDED = math.log(49.0)
FALSE_ALARM, SIGHT_M, MARGIN_M = 0.02, 2.5, 0.05
BEARINGS, PLACE_STD_M = 128, 0.01
# where it is, is not in question here
NOISE = PoseNoise(0.0, 0.02, 1e-6 * np.eye(3))
_X, _Y = np.meshgrid(
    (np.arange(round(LENGTH_M / CELL_M)) + 0.5) * CELL_M, (np.arange(round(WIDTH_M / CELL_M)) + 0.5) * CELL_M
)


def seen_ratio(range_m: FloatArray | float) -> FloatArray:
    """Probability that one look sees an opponent at this range."""
    return np.asarray(np.clip(0.9 - 0.2 * np.asarray(range_m), 0.35, 0.9))


def free_gain(range_m: FloatArray) -> FloatArray:
    """By how much a look that finds a cell free lowers its log-odds."""
    return np.asarray(np.log((1 - FALSE_ALARM) / (1 - seen_ratio(range_m))))


@dataclass(frozen=True)
class Run:
    """How a run went."""

    seconds: float
    collided: bool
    arrived: bool


def draw_opponents(rng: np.random.Generator) -> FloatArray:
    """Draw opponents (M, 3), x, y, radius: two or three on the way, behind each of which another one stands or two."""
    out: list[tuple[float, float, float]] = []

    def add(x: float, y: float) -> None:
        radius = float(rng.uniform(0.09, 0.13))
        apart = all(math.hypot(x - a, y - b) > radius + c + 0.02 for a, b, c in out)
        if apart and 0.9 < x < LENGTH_M - 0.9 and 0.2 < y < WIDTH_M - 0.2:
            out.append((x, y, radius))

    for x in np.linspace(1.5, 4.2, int(rng.integers(2, 4))).tolist():
        x, y = x + rng.uniform(-0.2, 0.2), WIDTH_M / 2 + rng.uniform(-0.15, 0.15)
        add(x, y)
        for _ in range(int(rng.integers(1, 3))):
            away, turned = rng.uniform(0.22, 0.5), rng.uniform(-1.3, 1.3)
            add(x + away * math.cos(turned), y + away * math.sin(turned))
    return np.array(out)


class Robot:
    """Estimates from its looks: cells' log-odds, and opponents found where cells are blocked."""

    def __init__(
        self,
        opponents: FloatArray,
        rule: str,
        constant_mps: float | None,
        rng: np.random.Generator,
        errors: Errors = MATCHED,
    ) -> None:
        self.missed = errors.missed
        off_m = PLACE_STD_M * errors.obstacle.draw(rng, 2 * len(opponents)).reshape(-1, 2)
        self.opponents, self.rule, self.constant_mps, self.rng = opponents, rule, constant_mps, rng
        # where a tracker has those that are found: their size is known, and their place up to its error
        self.tracked = opponents + np.pad(off_m, ((0, 0), (0, 1)))
        self.log_odds = np.zeros(_X.shape)
        self.found = np.zeros(len(opponents), dtype=int)
        self.follower, self.undecided = PathFollower(LIMITS), UndecidedSpeed(LIMITS, RADIUS_M, EVERY * PERIOD_S)
        self.path = np.array([[0.4, WIDTH_M / 2], [LENGTH_M - 0.4, WIDTH_M / 2]])
        self.among = SpeedPlanner(self.follower, RADIUS_M, NOISE, EVERY * PERIOD_S)
        self.velocity, self.pending = (0.0, 0.0), (0.0, 0.0)
        self.known, self.speed, self.reason = 0, 0.0, ""

    def look(self, place: FloatArray) -> None:
        """Update by one look around: what is hit by a ray, what lies before that, nothing of what lies behind."""
        away = np.hypot(self.opponents[:, 0] - place[0], self.opponents[:, 1] - place[1])
        towards = np.arctan2(self.opponents[:, 1] - place[1], self.opponents[:, 0] - place[0])
        rays = (np.arange(BEARINGS) + 0.5) * (math.tau / BEARINGS)
        off = np.abs((rays[:, None] - towards + math.pi) % math.tau - math.pi)
        sideways = away * np.sin(off)
        hits = (off < math.pi / 2) & (sideways < self.opponents[:, 2])
        depth = np.sqrt(np.maximum(self.opponents[:, 2] ** 2 - sideways**2, 0.0))
        real = np.where(hits, away * np.cos(off) - depth, np.inf)
        nearest = real.argmin(axis=1)
        front = real[np.arange(BEARINGS), nearest]
        noticed = self.rng.random(len(away)) < 1 - self.missed * (1 - seen_ratio(away))
        range_m = np.hypot(_X - place[0], _Y - place[1])
        ray = (np.arctan2(_Y - place[1], _X - place[0]) * (BEARINGS / math.tau)).astype(int) % BEARINGS
        # what is not noticed looks like floor, but hides what is behind it all the same
        gain = free_gain(range_m)
        lower = (range_m < np.minimum(front[ray], SIGHT_M)) * gain
        for k in np.unique(nearest[np.isfinite(front)]).tolist():
            # of an opponent that can be seen at all, all of its floor is shown
            under = np.hypot(_X - self.opponents[k, 0], _Y - self.opponents[k, 1]) <= self.opponents[k, 2]
            if away[k] > SIGHT_M:
                continue
            lower[under] = -math.log(float(seen_ratio(away[k])) / FALSE_ALARM) if noticed[k] else gain[under]
            self.found[k] += bool(noticed[k])
        lower[self.rng.random(_X.shape) < 1e-4] = -2.0
        self.log_odds = np.clip(self.log_odds - lower, -6.0, 6.0)
        self.looks = looks_to_decide(self.log_odds, gain, DECIDED)

    def plan(self, place: FloatArray) -> None:
        """Plan the path round what was found, and the speed along it."""
        known = self.tracked[self.found >= 2]
        if len(known) != self.known or self.speed == 0.0:
            self.known, self.path = len(known), way_round(place, np.array([LENGTH_M - 0.4, WIDTH_M / 2]), known)
        else:
            arc, _, _ = nearest_on_path(self.path, (float(place[0]), float(place[1])))
            ends = np.cumsum(np.hypot(*np.diff(self.path, axis=0).T))
            self.path = np.vstack([place, self.path[1:][ends > arc + 1e-6], self.path[-1:]])
        looks = self.looks.copy()
        if self.rule == "constant":
            looks[looks > 0] = -1
        elif self.rule == "stop":
            looks[looks > 0] = 0
        plan = self.undecided.plan(self.path, UndecidedFloor(looks, (0.0, 0.0), CELL_M))
        if self.constant_mps is None:
            # and no faster than the controller keeps off what is found
            discs = [Disc(x, y, radius, PLACE_STD_M**2 * np.eye(2)) for x, y, radius in known.tolist()]
            pose = Pose2(float(place[0]), float(place[1]), 0.0)
            other = self.among.plan(self.path, pose, NOISE.look_covariance, self.velocity, discs, self.pending)
            plan = min(plan, other, key=lambda p: p.speed_mps)
        self.speed, self.reason = plan.speed_mps, plan.reason
        if self.constant_mps is not None:
            self.speed = min(self.speed, self.constant_mps)


def way_round(start: FloatArray, goal: FloatArray, known: FloatArray) -> FloatArray:
    """Return the shortest path (P, 2) by corners around the known opponents: Dijkstra over what sees each other."""
    room = known[:, 2] + RADIUS_M + MARGIN_M
    angles = (np.arange(10) + 0.5) * (math.tau / 10)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1) / math.cos(math.pi / 10)
    corners = (known[:, None, :2] + (room[:, None, None] + 1e-3) * ring).reshape(-1, 2)
    clear = np.hypot(*(corners[:, None] - known[:, :2]).transpose(2, 0, 1)) >= room
    inside = (corners[:, 1] > 0.15) & (corners[:, 1] < WIDTH_M - 0.15)
    nodes = np.vstack([start, goal, corners[clear.all(axis=1) & inside]])
    step = nodes[None] - nodes[:, None]
    length = np.hypot(step[..., 0], step[..., 1])
    for (x, y, _), off in zip(known.tolist(), room.tolist(), strict=True):
        to = np.array([x, y]) - nodes
        fraction = np.clip((step * to[:, None]).sum(axis=2) / np.maximum(length**2, 1e-12), 0.0, 1.0)
        away = np.hypot(fraction * step[..., 0] - to[:, None, 0], fraction * step[..., 1] - to[:, None, 1])
        # whoever is too near already may leave
        own = np.minimum(np.hypot(to[:, 0], to[:, 1]), off)[:, None]
        length[away < own - 1e-6] = np.inf
    cost, before = dijkstra(csgraph_from_dense(length, null_value=np.inf), indices=0, return_predecessors=True)
    if not np.isfinite(cost[1]):
        return np.array([start, goal])
    path = [1]
    while path[-1] != 0:
        path.append(int(before[path[-1]]))
    return np.asarray(nodes[path[::-1]])


def run(seed: tuple[int, int], rule: str, constant_mps: float | None, errors: Errors = MATCHED) -> Run:
    """Drive from end to end among hidden opponents."""
    opponents = draw_opponents(np.random.default_rng([*seed, 0]))
    robot = Robot(opponents, rule, constant_mps, np.random.default_rng([*seed, 1]), errors)
    place, velocity, pending = (0.4, WIDTH_M / 2), (0.0, 0.0), (0.0, 0.0)
    collided = False
    for step in range(int(40 / PERIOD_S)):
        if step % EVERY == 0:
            robot.velocity, robot.pending = velocity, pending
            robot.look(np.array(place))
            robot.plan(np.array(place))
        if place[0] > LENGTH_M - 0.45:
            return Run(step * PERIOD_S, collided, True)
        x, y = robot.follower.command(robot.path, Pose2(*place, 0.0), robot.speed).tolist()
        place, velocity = drive(
            place, velocity, pending, (x, y), LIMITS.acceleration_mps2, LIMITS.dead_time_s, PERIOD_S
        )
        pending = (x, y)
        clear = np.hypot(opponents[:, 0] - place[0], opponents[:, 1] - place[1]) - opponents[:, 2] - RADIUS_M
        collided |= bool(clear.min() < 0)
    return Run(40.0, collided, False)
