"""Gaps that may be too narrow: when to go round, to go through, and whence to look first.

The gate problem (Miura 2004, section 5): robot, gap, target and detour are drawn, and the belief of the width; the
true width is drawn from that belief. The plan by branch and bound against all plans (plain NumPy, the whole tree), and
against three simple ones: the detour at once; one look from the start; one look from before the gap; after the look the
gap if it is confirmed, else the detour. Expected times are the model's; driven times come from drawn widths and
readings, planned again after each look.

Expected passage times (section 6.2): of two or three gaps and a way round (gap_choices.py) the one with the least
expected time, by the speeds that are safe at each width; against the one that would be quickest if each were as wide as
it is on the average. All is driven, turning back with it. The rules are asked again at each look; or only once the gap
taken is known to be blocked (judged); or only once the robot is stuck. An oracle gets the widths at the start.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from argparse import Namespace
from dataclasses import dataclass

import numpy as np

from benchmarks.harness import Kind, Pool, Table, percent, program, verdict
from benchmarks.worlds import gap_choices
from robocup_vision.arrays import FloatArray
from robocup_vision.planning import (
    Gap,
    GatePlan,
    GatePlanner,
    MotionLimits,
    WidthSensor,
)
from robocup_vision.planning.gaps.gap_choice import Point
from robocup_vision.planning.gaps.gate_planner import GatePlannerSettings, GateTables

CONFIRMED, LOOK_S, FAILURE_S, LOOKS = 0.95, 0.2, 2.0, 3
ROBOT_M = 0.18
# m/s, m/s2: slow, quick and fast robots
MOTIONS = ((0.4, 0.3), (1.0, 1.2), (1.5, 4.0))
SINGLE = ("detour", "look now", "go and look")


@dataclass(frozen=True)
class Case:
    """A gap on the way, and a way round it."""

    limits: MotionLimits
    sensor: WidthSensor
    needed_m: float
    robot_m: Point
    gap: Gap
    target_m: Point
    detour_m: tuple[Point, ...]

    @property
    def planner(self) -> GatePlanner:
        """Who plans it."""
        return GatePlanner(
            self.limits,
            self.sensor,
            self.needed_m,
            GatePlannerSettings(confirmed=CONFIRMED, look_s=LOOK_S, failure_s=FAILURE_S, looks=LOOKS),
        )

    def tables(self, gap: Gap, robot_m: Point) -> GateTables:
        """Return the problem in numbers."""
        return self.planner.tables(robot_m, gap, self.target_m, self.detour_m)


def draw_case(rng: np.random.Generator) -> Case:
    """Draw a case whose outcome is open: width needed within 2 standard deviations of the one believed.

    The gap is 1 to 4 m ahead and up to 60 degrees askew, as certain as 1 to 4 looks from the start would make it;
    the detour is 20 to 150 % longer.
    """
    speed, acceleration = MOTIONS[int(rng.integers(len(MOTIONS)))]
    ahead, aside = rng.uniform(1.0, 4.0), rng.uniform(-1.0, 1.0)
    beyond = rng.uniform(0.5, 2.0)
    needed = ROBOT_M * rng.uniform(1.1, 1.4)
    limits = MotionLimits(speed, acceleration)
    sensor = gap_choices.draw_sensor(rng)
    gap = Gap((ahead, aside), rng.uniform(-1.0, 1.0), needed, 1.0)
    one_look = sensor.sigma_m(gap, (0.0, 0.0), limits.travel_s(math.hypot(ahead, aside)))
    sigma = one_look / math.sqrt(rng.integers(1, 5))
    gap = dataclasses.replace(gap, width_m=needed + sigma * rng.uniform(-2.0, 2.0), sigma_m=sigma)
    straight = math.hypot(ahead, aside) + math.hypot(beyond, aside)
    longer = straight * rng.uniform(1.2, 2.5)
    # the detour's corner beside the gap, where the way round has that length
    low, high = 0.0, longer
    for _ in range(50):
        side = 0.5 * (low + high)
        length = math.hypot(ahead, aside - side) + math.hypot(beyond, aside - side)
        low, high = (side, high) if length < longer else (low, side)
    corner = (ahead, aside - math.copysign(side, aside))
    return Case(limits, sensor, needed, (0.0, 0.0), gap, (ahead + beyond, 0.0), (corner,))


def every_plan_s(tables: GateTables, looks: int) -> tuple[float, int]:
    """Least expected time by the whole tree, and its number of beliefs: level by level, in plain NumPy."""
    count, readings = tables.likelihood.shape[:2]
    total = sum((count * readings) ** depth for depth in range(looks + 1))

    def least(joint: FloatArray, place: int, left: int) -> FloatArray:
        """Costs (M,) of joint masses (M, W) at a place."""
        narrow, wide = joint[:, : tables.first_wide].sum(axis=1), joint[:, tables.first_wide :].sum(axis=1)
        cost = (narrow + wide) * tables.detour_s[place]
        through = wide * tables.pass_s[place] + narrow * tables.fail_s[place]
        cost = np.where(wide >= CONFIRMED * (narrow + wide), np.minimum(cost, through), cost)
        if left:
            for x in range(count):
                after = (joint[:, None, :] * tables.likelihood[x]).reshape(-1, joint.shape[1])
                seen = least(after, x, left - 1).reshape(-1, readings).sum(axis=1)
                cost = np.minimum(cost, (narrow + wide) * (tables.move_s[place, x] + LOOK_S) + seen)
        return np.asarray(cost)

    return float(least(tables.prior[None], 0, looks)[0]), total


def driven_s(case: Case, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Seconds of our plan and of the three simple ones, for one true width."""
    width = case.gap.width_m + case.gap.sigma_m * rng.standard_normal()
    wide = width >= case.needed_m

    def end_s(tables: GateTables, place: int, through: bool) -> float:
        ends = tables.detour_s if not through else tables.pass_s if wide else tables.fail_s
        return float(ends[place])

    def look(gap: Gap, eye_m: Point) -> Gap:
        away = math.dist(eye_m, gap.center_m)
        sigma = case.sensor.sigma_m(gap, eye_m, case.limits.travel_s(away))
        return gap.updated(width + sigma * rng.standard_normal(), sigma)

    start = case.tables(case.gap, case.robot_m)
    simple = [end_s(start, 0, False)]
    for place in (0, 1):
        x, y = start.viewpoints_m[place].tolist()
        after = look(case.gap, (x, y))
        confirmed = after.wide_enough(case.needed_m) >= CONFIRMED and start.pass_s[place] <= start.detour_s[place]
        simple.append(float(start.move_s[0, place]) + LOOK_S + end_s(start, place, confirmed))
    gap, place_m, ours = case.gap, case.robot_m, 0.0
    while True:
        plan = case.planner.plan(place_m, gap, case.target_m, case.detour_m)
        if plan.viewpoint_m is None:
            return ours + end_s(case.tables(gap, place_m), 0, plan.action == "pass"), simple[0], simple[1], simple[2]
        ours += case.limits.travel_s(math.dist(place_m, plan.viewpoint_m)) + LOOK_S
        place_m = plan.viewpoint_m
        gap = look(gap, place_m)


def measure_gates(count: int, brute: int, drives: int, seed: int) -> None:
    """Print the tables of the gate problem."""
    rng = np.random.default_rng([seed, 4])
    cases = [draw_case(rng) for _ in range(count)]
    cases[0].planner.plan((0.0, 0.0), cases[0].gap, cases[0].target_m, cases[0].detour_m)
    plans, seconds = [], []
    for case in cases:
        planner = case.planner
        taken = math.inf
        # the better of two: what else the machine does is not the plan's time
        for _ in range(2):
            started = time.perf_counter()
            plan = planner.plan(case.robot_m, case.gap, case.target_m, case.detour_m)
            taken = min(taken, time.perf_counter() - started)
        plans.append(plan)
        seconds.append(taken)
    columns = "the gate problem                                    | measured: by row | target | verdict"
    table = Table(columns, name="gate", samples=count)

    def row(name: str, figure: str | float, target: str, ok: bool, kind: Kind = Kind.TEXT) -> None:
        table.row(name, figure, target, verdict(ok), kind=kind)

    worst, visited, all_beliefs = 0.0, 0, 0
    for case, plan in list(zip(cases, plans, strict=True))[:brute]:
        least, total = every_plan_s(case.tables(case.gap, case.robot_m), LOOKS)
        worst = max(worst, abs(least - plan.expected_s))
        visited, all_beliefs = visited + plan.beliefs, all_beliefs + total
    row(f"off the best of all plans, worst of {brute}, s", f"{worst:.1e}", "<= 1e-9", worst <= 1e-9)
    enough = all_beliefs >= 10 * visited
    row("all plans' beliefs / beliefs expanded", all_beliefs / visited, ">= 10", enough, Kind.SCORE)
    expected = np.array([(p.expected_s, p.detour_s, p.look_now_s, p.go_and_look_s) for p in plans])
    over = float((expected[:, 0] - expected[:, 1:].min(axis=1)).max())
    row("expected over the best of three, worst case, s", f"{over:.1e}", "<= 1e-9", over <= 1e-9)
    chosen = [plan.action for plan in plans]
    for label, times in (("expected", expected), ("driven", drive_all(cases, drives, seed))):
        means = times.mean(axis=0)
        best = int(np.argmin(means[1:]))
        saved = 1 - means[0] / means[1 + best]
        name = f"{label} time saved over '{SINGLE[best]}', %"
        if times is expected:
            # the plan's horizon is three looks; driven, it is planned again after each
            table.row(name, percent(saved), "-", None, kind=Kind.RATE)
        else:
            row(name, percent(saved), ">= 5", saved >= 0.05, Kind.RATE)
        open_ones = np.array([action == "look" for action in chosen])
        means = times[open_ones].mean(axis=0)
        best = int(np.argmin(means[1:]))
        looking = percent(float(open_ones.mean()))
        table.row(
            f"  where it looks first ({looking} %), over '{SINGLE[best]}'",
            percent(1 - means[0] / means[1 + best]),
            "-",
            None,
        )
    table.row("time of a plan, median, ms", 1e3 * float(np.median(seconds)), "-", None)
    late = float(np.quantile(seconds, 0.99))
    row("time of a plan, 99 of 100 within, ms", 1e3 * late, "< 10", late < 0.01)
    table.row("time of a plan, slowest, ms", 1e3 * max(seconds), "-", None)


def drive_all(cases: list[Case], drives: int, seed: int) -> FloatArray:
    """Mean driven seconds (cases, 4)."""
    rng = np.random.default_rng([seed, 5])
    return np.array([np.mean([driven_s(case, rng) for _ in range(drives)], axis=0) for case in cases])


@dataclass(frozen=True)
class Step:
    """Where the next viewpoint lies for one believed width."""

    width_m: float
    plan: GatePlan

    @property
    def side(self) -> float | None:
        """From the line to the detour (0) to the line to the gap (1), by bearing; None without a viewpoint."""
        if self.plan.viewpoint_m is None:
            return None
        x, y = self.plan.viewpoint_m
        return 0.5 + 0.5 * math.atan2(y, x) / math.atan2(FORK_GAP_M[1], FORK_GAP_M[0])


FORK_GAP_M, FORK_DETOUR_M, FORK_GOAL_M = (4.0, 0.7), ((4.0, -0.7), (4.5, -1.7)), (6.0, 0.7)


def widen_prior() -> list[Step]:
    """Plans at a fork as in figure 13 of Miura (2004): gap to the left, detour to the right, for growing widths.

    The camera is 1.2 m high, so that the gap can be seen from either side, and looking costs more than turning aside.
    """
    planner = GatePlanner(MotionLimits(0.4, 4.0), WidthSensor(0.015, 1.2), 0.22, GatePlannerSettings(look_s=0.3))
    gap_side, detour_side = np.array(FORK_GAP_M), np.array(FORK_DETOUR_M[0])
    count = 12
    sides = [(i / count, j / count) for i in range(count) for j in range(count + 1 - i) if i + j]
    viewpoints = np.array([i * gap_side + j * detour_side for i, j in sides])
    steps = []
    for width in np.linspace(0.10, 0.40, 31).tolist():
        gap = Gap(FORK_GAP_M, 0.0, width, 0.08)
        steps.append(Step(width, planner.plan((0.0, 0.0), gap, FORK_GOAL_M, FORK_DETOUR_M, viewpoints)))
    return steps


def measure_fork() -> None:
    """Print where the next viewpoint lies."""
    steps = widen_prior()
    table = Table(
        "believed width, mm | plan | viewpoint | detour 0, gap 1",
        "at a fork: 80 mm of uncertainty",
        name="fork",
    )
    for step in steps[::3]:
        place = None if step.plan.viewpoint_m is None else "({:.1f}, {:.1f})".format(*step.plan.viewpoint_m)
        table.row(f"{1000 * step.width_m:.0f}", step.plan.action, place, step.side)
    sides = [step.side for step in steps if step.side is not None]
    back = max((a - b for a, b in itertools.pairwise(sides)), default=math.inf)
    # a viewpoint right before the gap may lie a little beyond the line to it
    ok = bool(sides) and sides[0] <= 0.5 and sides[-1] >= 0.95 and back <= 0.05
    columns = "the viewpoint as the width grows | from | to | at most back | verdict: verdict"
    table = Table(columns, name="viewpoint")
    ends = f"{sides[0]:.2f}", f"{sides[-1]:.2f}", f"{max(back, 0.0):.2f}"
    table.row("from the detour's side (0) to the gap's (1)", *ends, verdict(ok))


def measure_passage(count: int, few: int, draws: int, aside_m: float, seed: int, pool: Pool) -> None:
    """Print the table of expected passage times."""
    narrowest = 1000 * gap_choices.passage_times().narrowest_m
    table = Table(
        (
            "against       | asked again: label | rows | differs % | its s | ours: error | saved % | +- | "
            "oracle % | verdict"
        ),
        f"rows of gaps up to {aside_m:g} m aside, and a way round; no safe speed below {narrowest:.0f} mm",
        name=f"passage, {aside_m:g} m",
        samples=few,
    )
    touched = 0.0
    for rule, ways, rows in (
        ("mean width", gap_choices.AGAIN, count),
        ("shortest way", (gap_choices.JUDGED,), few),
    ):
        jobs = [gap_choices.RowJob(seed, number, aside_m, rule, ways, draws) for number in range(rows)]
        found = np.array([row for row in pool.map(gap_choices.row_seconds, jobs, chunksize=20) if row is not None])
        oracle_s, touched = float(found[:, -2].mean()), max(touched, float(found[:, -1].mean()))
        for k, again in enumerate(ways):
            its, ours = float(found[:, 2 * k].mean()), float(found[:, 2 * k + 1].mean())
            standard_error = float(np.std(found[:, 2 * k] - found[:, 2 * k + 1])) / math.sqrt(len(found)) / its
            saved, judged = 1 - ours / its, again == gap_choices.JUDGED and rule == "mean width"
            table.row(
                rule, again, str(rows), percent(len(found) / rows), its, ours, percent(saved), percent(standard_error),
                percent(1 - oracle_s / its), verdict(saved >= 0.04) if judged else None,
            )  # fmt: skip
    table.note(f"sets of drives in which one touches: at most {percent(touched)} %")


def measure_times(drives: int, seed: int) -> None:
    """Print what a gap costs by its width, in the table and driven, and what turning back does."""
    times = gap_choices.passage_times()
    table = Table(
        "robot widths | table's s | driven s | +- | passed %: rate",
        "one gap straight ahead, 2 m away; a gap that is not passed counts for nothing here",
        name="times",
        samples=drives,
    )
    for ratio in (1.6, 1.8, 1.9, 2.0, 2.1, 2.2, 2.5, 3.0, 3.5, 4.5):
        width, found = ratio * ROBOT_M, []
        for k in range(drives):
            rng = np.random.default_rng([seed, 7, round(10 * ratio), k])
            gaps = (
                Gap((2.0, 0.0), 0.0, width + 0.01 * float(rng.standard_normal()), 0.01),
                Gap((2.0, 3.0), 0.0, 1.2, 1e-3),
            )
            row = gap_choices.Row(gaps, WidthSensor(0.006, 0.4))
            found.append(gap_choices.drive_row(row, np.array([width, 1.2]), "mean width", "if stuck", times, rng, 0))
        passed = np.array([drive.seconds for drive in found if not drive.turned_back])
        model = times.planner.follower.limits.travel_s(math.dist((0.0, 0.0), gap_choices.GOAL_M)) + times.extra_s(width)
        standard_error = float(passed.std()) / math.sqrt(len(passed)) if len(passed) else None
        mean = float(passed.mean()) if len(passed) else None
        table.row(f"{ratio:.1f}", model, mean, standard_error, percent(len(passed) / drives))


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    count, brute, drives = (10, 1, 2) if arguments.quick else (2000, 60, 20) if arguments.full else (400, 12, 10)
    # rows of each kind, and how often the widths of a row are drawn
    rows, few, draws = (25, 5, 2) if arguments.quick else (5 * count, count // 2, 6)
    measure_gates(count, brute, drives, arguments.seed)
    measure_fork()
    measure_times(count // 10, arguments.seed)
    # opponents across a field; and close together, where turning back costs next to nothing
    measure_passage(rows, few, draws, 2.5, arguments.seed, pool)
    measure_passage(rows, few, draws, 1.0, arguments.seed, pool)
