"""A row of opponents across the way, driven through by the gap that a rule takes: for gaps.py.

Two or three gaps of uncertain width, each between two opponents, and a sure way round the row, 20 to 150 % longer than
the straight one (as at the gate). The robot is that of uncertain_robot.py. At each look it sees all opponents again,
the nearer and the straighter the better; where no speed is safe for 4 s it takes a gap to be blocked, and turns back.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.uncertain_robot import (
    DISC_STD_M,
    LATEST_S,
    LIMITS,
    MATCHED,
    PATIENCE_S,
    PERIOD_S,
    PLAN_EVERY,
    PLANNER,
    RADIUS_M,
    Errors,
    UncertainRobot,
)
from robocup_vision.arrays import FloatArray
from robocup_vision.planning import Disc, Gap, PassageTimes, WidthSensor, choose_gap
from robocup_vision.planning.gaps.gap_choice import Point, gap_between

GOAL_M = (4.0, 0.0)
# when a rule is asked again: at each look; once the gap is known to be blocked; once no speed has been safe for long
AGAIN, JUDGED = ("at each look", "if blocked", "if stuck"), "if blocked"
# a gap is known to be blocked if it is so much at least; the way through is straight so far before and after
BLOCKED, STRAIGHT_M = 0.95, 0.45
HERE_M = 0.05
# how wide the open floor beside the row is, at least
_ROUND_M = 1.2


@dataclass(frozen=True)
class Row:
    """Gaps side by side, as estimated from the start, and the sure way round: the last one."""

    gaps: tuple[Gap, ...]
    sensor: WidthSensor

    @property
    def x_m(self) -> float:
        """Where the row stands."""
        return self.gaps[0].center_m[0]


@functools.cache
def passage_times() -> PassageTimes:
    """Return what gaps cost the robot, by their width."""
    return PassageTimes(PLANNER, RADIUS_M, DISC_STD_M)


def draw_sensor(rng: np.random.Generator) -> WidthSensor:
    """Draw a camera: a third of a pixel to a pixel, 0.2 to 0.6 m high; opponents that drift by up to 30 mm/s."""
    return WidthSensor(rng.uniform(0.003, 0.01), rng.uniform(0.2, 0.6), 0.01, rng.uniform(0.0, 0.03))


def draw_row(narrowest_m: float, aside_m: float, sensor: WidthSensor, rng: np.random.Generator) -> Row:
    """Draw gaps 1.5 to 2.5 m ahead, so far aside at the most, from just too narrow to wide.

    Each is as certain as 1 to 4 looks from the start make it.
    """
    x, count = rng.uniform(1.5, 2.5), int(rng.integers(2, 4))
    while True:
        sides, widths = np.sort(rng.uniform(-aside_m, aside_m, count)), narrowest_m + rng.uniform(-0.05, 0.3, count)
        if (np.diff(sides) > 0.5 * (widths[1:] + widths[:-1]) + 4 * RADIUS_M).all():
            break
    gaps = []
    for y, width in zip(sides.tolist(), widths.tolist(), strict=True):
        gap = Gap((x, y), 0.0, width, 1.0)
        sigma = sensor.sigma_m(gap, (0.0, 0.0)) / math.sqrt(rng.integers(1, 5))
        gaps.append(dataclasses.replace(gap, sigma_m=sigma))
    length = GOAL_M[0] * rng.uniform(1.2, 2.5)
    low, high = 0.0, length
    for _ in range(50):
        y = 0.5 * (low + high)
        low, high = (y, high) if math.hypot(x, y) + math.hypot(GOAL_M[0] - x, y) < length else (low, y)
    side = 1 if rng.uniform() < 0.5 else -1
    # beyond the last opponent of the row
    end = float((side * sides + 0.5 * widths).max()) + 2 * RADIUS_M + 0.5 * _ROUND_M
    return Row((*gaps, Gap((x, side * max(low, end)), 0.0, _ROUND_M, 1e-3)), sensor)


def draw_widths(row: Row, rng: np.random.Generator, errors: Errors = MATCHED) -> FloatArray:
    """Draw the true widths from their estimates."""
    width, sigma = np.array([(gap.width_m, gap.sigma_m) for gap in row.gaps]).T
    return np.array(width + sigma * errors.obstacle.draw(rng, len(width)))


def pick(rule: str, times: PassageTimes, place_m: Point, gaps: Sequence[Gap]) -> int:
    """Which of these gaps a rule takes: by expected time, by the time of the mean width, or by the way."""
    if rule == "expected time":
        return choose_gap(times, place_m, GOAL_M, gaps).index
    travel = LIMITS.travel_s
    ways = [travel(math.dist(place_m, gap.center_m) + math.dist(gap.center_m, GOAL_M)) for gap in gaps]
    if rule == "mean width":
        ways = [way + min(times.extra_s(gap.width_m), 1e3) for way, gap in zip(ways, gaps, strict=True)]
    return int(np.argmin(ways))


class _Opponents:
    """The opponents that make the gaps: where they stand, and where they are estimated to."""

    def __init__(self, row: Row, widths_m: FloatArray, rng: np.random.Generator, errors: Errors) -> None:
        self._row, self._rng, self._law = row, rng, errors.obstacle
        believed, truth, variance = [], [], []
        for gap, width in zip(row.gaps[:-1], widths_m.tolist(), strict=False):
            # errors of the two are independent: that of their middle is not that of the width
            middle = 0.5 * gap.sigma_m * float(self._law.draw(rng, 1)[0])
            for side in (-1, 1):
                y = gap.center_m[1] + side * (0.5 * gap.width_m + RADIUS_M)
                believed.append(y)
                truth.append(y + side * 0.5 * (width - gap.width_m) + middle)
                variance.append(0.5 * gap.sigma_m**2)
        self._y, self._variance = np.array(believed), np.array(variance)
        self.truth_m = np.array([(row.x_m, y, RADIUS_M) for y in truth])

    def see(self, eye_m: Point) -> None:
        """Measure them all from there."""
        for k, gap in enumerate(self.gaps()[:-1]):
            one = slice(2 * k, 2 * k + 2)
            variance = 0.5 * self._row.sensor.sigma_m(gap, eye_m) ** 2
            seen = self.truth_m[one, 1] + math.sqrt(variance) * self._law.draw(self._rng, 2)
            gain = self._variance[one] / (self._variance[one] + variance)
            self._y[one] += gain * (seen - self._y[one])
            self._variance[one] *= 1 - gain

    def discs(self) -> tuple[Disc, ...]:
        """Estimates, never better than opponents are placed from nearby."""
        variances = np.maximum(self._variance, DISC_STD_M**2).tolist()
        return tuple(
            Disc(self._row.x_m, y, RADIUS_M, variance * np.eye(2))
            for y, variance in zip(self._y.tolist(), variances, strict=True)
        )

    def gaps(self) -> list[Gap]:
        """Estimates, and the way round."""
        covariances = [variance * np.eye(2) for variance in self._variance.tolist()]
        discs = [Disc(self._row.x_m, y, RADIUS_M, d) for y, d in zip(self._y.tolist(), covariances, strict=True)]
        return [gap_between(a, b) for a, b in zip(discs[::2], discs[1::2], strict=True)] + [self._row.gaps[-1]]


def _path(here: Point, gap: Gap) -> FloatArray:
    """Return the way to the goal through a gap, straight where it is narrow."""
    x, y = gap.center_m
    before, after = (x - STRAIGHT_M, y), (x + STRAIGHT_M, y)
    if here[0] >= after[0]:
        return np.array([here, GOAL_M])
    if here[0] <= before[0]:
        return np.array([here, before, after, GOAL_M])
    if abs(here[1] - y) < 0.5 * gap.width_m:
        return np.array([before, after, GOAL_M])
    # back from before another gap, and along the row
    return np.array([here, (before[0], here[1]), before, after, GOAL_M])


@dataclass(frozen=True)
class RowDrive:
    """How a drive through a row went."""

    seconds: float
    collided: bool
    turned_back: int
    places_m: FloatArray


def drive_row(
    row: Row,
    widths_m: FloatArray,
    rule: str,
    again: str,
    times: PassageTimes,
    rng: np.random.Generator,
    first: int | None = None,
    errors: Errors = MATCHED,
) -> RowDrive:
    """Drive to the goal by a rule, asked again as `again` says; `first` is the gap taken first if that is given."""
    opponents = _Opponents(row, widths_m, np.random.default_rng(rng.integers(2**32)), errors)
    robot = UncertainRobot(rng, errors)
    round_it, collided, missed_s, speed = len(row.gaps) - 1, False, 0.0, 0.0
    blocked: set[int] = set()
    taken, path, stuck, places = -1, np.empty((0, 2)), False, [robot.place_m]
    while robot.seconds < LATEST_S:
        here = (robot.pose.x_m, robot.pose.y_m)
        if math.dist(here, GOAL_M) < HERE_M:
            break
        looked = robot.look()
        here = (robot.pose.x_m, robot.pose.y_m)
        if looked and here[0] < row.x_m:
            opponents.see(here)
        if looked or stuck or taken < 0:
            gaps = opponents.gaps()
            # in the gap it is too late to choose
            if here[0] < row.x_m - RADIUS_M or taken in blocked:
                if again == "if blocked" and taken >= 0 and gaps[taken].wide_enough(times.narrowest_m) < 1 - BLOCKED:
                    blocked.add(taken)
                if taken < 0 or taken in blocked or again == "at each look":
                    left = [k for k in range(len(gaps)) if k not in blocked]
                    choice = left[pick(rule, times, here, [gaps[k] for k in left])]
                    choice = first if taken < 0 and first is not None else choice
                    taken, missed_s = choice, missed_s if choice == taken else 0.0
            path, stuck = _path(here, gaps[taken]), False
        if robot.plans_now:
            plan = robot.plan(path, opponents.discs())
            speed, missed_s = plan.speed_mps, 0.0 if plan.safe else missed_s + PLAN_EVERY * PERIOD_S
            if missed_s > PATIENCE_S and taken != round_it and here[0] < row.x_m:
                blocked.add(taken)
                stuck = True
        robot.follow(path, speed)
        collided |= robot.touches(opponents.truth_m)
        places.append(robot.place_m)
    return RowDrive(robot.seconds, collided, len(blocked), np.array(places))


@dataclass(frozen=True)
class RowJob:
    """What one process drives: a row of gaps, by its number; the rule compared with, and when both are asked again."""

    seed: int
    number: int
    aside_m: float
    rule: str
    again: tuple[str, ...]
    draws: int
    errors: Errors = MATCHED


def row_seconds(job: RowJob) -> FloatArray | None:
    """Mean seconds of one row: for each way of asking again the rule and ours, the oracle; and touches.

    All have the same true widths and errors. The oracle gets the widths at the start, and takes the gap that is
    quickest by them. None if the two rules do not differ.
    """
    times = passage_times()
    rng = np.random.default_rng([job.seed, 6, round(10 * job.aside_m), job.number])
    row = draw_row(times.narrowest_m, job.aside_m, draw_sensor(rng), rng)
    start, rules = (0.0, 0.0), (job.rule, "expected time")
    if len({pick(rule, times, start, row.gaps) for rule in rules}) == 1:
        return None
    found = []
    for _ in range(job.draws):
        widths, drive_seed = draw_widths(row, rng, job.errors), int(rng.integers(2**32))
        known = [dataclasses.replace(gap, width_m=w) for gap, w in zip(row.gaps, widths.tolist(), strict=True)]
        best = pick("mean width", times, start, known)
        drives = [
            drive_row(row, widths, rule, again, times, np.random.default_rng(drive_seed), errors=job.errors)
            for again in job.again
            for rule in rules
        ]
        oracle_rng = np.random.default_rng(drive_seed)
        drives.append(drive_row(row, widths, "mean width", "if blocked", times, oracle_rng, best, job.errors))
        found.append([drive.seconds for drive in drives] + [float(any(drive.collided for drive in drives))])
    return np.array(np.mean(found, axis=0))
