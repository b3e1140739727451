"""Whole matches, 2 against 2 on ssl_2001, played by what the robots' own cameras see.

A robot's estimate is compared with the truth after every frame. "near": ratio of all frames with an estimated pose
within 5 cm and 3 degrees of the truth, in the right half of the field. "lost": longest time on end with no estimate, or
one more than 10 cm or 5 degrees off. "half": ratio of the poses estimated after the first 2 s that are nearer to the
truth than to its half turn. "stuck": longest time, from 5 s on, within 10 cm of one place although commanded to drive,
faster than 5 cm/s, for at least half of it, and free wheels would have come twice as far. Recovery: from a fault's end
(a push's moment) until the estimate is near the truth and stays so for half a second; the other robots of that match
have faults of their own.

--full plays longer, and one match of a simulated hour (soak) whose memory must not grow.
"""

from __future__ import annotations

import math
from argparse import Namespace

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.harness.machine import resident_mb
from robocup_vision.geometry import Pose2
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import plan_matches, play_plan
from sim2d.sensors.faults import BodyFault, Fault, SenseFault

# (matches, seconds each, matches with faults, seconds from fault to fault of a robot, seconds of the soak)
QUICK, DEFAULT, FULL = (1, 5.0, 1, 2.3, 4.0), (4, 40.0, 3, 4.0, 60.0), (10, 120.0, 9, 4.0, 3600.0)
MIN_NEAR, MAX_LOST_S, MAX_STUCK_S, MAX_RECOVERY_S, MAX_GROWTH = 0.95, 0.5, 5.0, 1.0, 0.05
FAULTS_PER_ROBOT = 5
KINDS = (
    "30 % of frames dropped",
    "frames 100 ms late",
    "frozen",
    "black",
    "odometry 20 % too much",
    "odometry 20 % too little",
    "pushed",
    "turned",
    "carried",
)


def make_fault(kind: str, robot: int, t_s: float, rng: np.random.Generator) -> Fault:
    """Return a fault that begins at a time; those of the senses last 1.5 s."""
    until_s = t_s + 1.5
    angle = rng.uniform(-math.pi, math.pi)
    if kind == "pushed":
        return BodyFault(robot, t_s, push_m=(0.25 * math.cos(angle), 0.25 * math.sin(angle)), turn_rad=0.3 * angle)
    if kind == "turned":
        return BodyFault(robot, t_s, turn_rad=math.copysign(rng.uniform(0.5, 1.5), angle))
    if kind == "carried":
        # clear of walls; whoever stands there is pushed away
        return BodyFault(robot, t_s, carry_to=Pose2(rng.uniform(-1.1, 1.1), rng.uniform(-0.5, 0.5), angle))
    if kind.startswith("odometry"):
        return SenseFault(robot, "odometry", t_s, until_s, 0.2 if kind.endswith("much") else -0.2)
    if kind.startswith("30 %"):
        return SenseFault(robot, "dropped", t_s, until_s, 0.3)
    if kind.endswith("late"):
        return SenseFault(robot, "delayed", t_s, until_s, 0.1)
    return SenseFault(robot, "frozen" if kind == "frozen" else "black", t_s, until_s)


def faulty_plan(seed: int, index: int, spacing_s: float) -> tuple[MatchPlan, dict[tuple[int, float], str]]:
    """Return a match in which each robot has a fault every few seconds, and the kind of each by robot and time."""
    rng = np.random.default_rng([seed, index])
    kinds = {}
    faults = []
    for robot in range(4):
        for turn in range(FAULTS_PER_ROBOT):
            t_s = round(3.0 + spacing_s * turn, 6)
            kind = KINDS[(robot + 2 * turn + index * 5) % len(KINDS)]
            kinds[robot, t_s] = kind
            faults.append(make_fault(kind, robot, t_s, rng))
    seconds = 3.0 + spacing_s * FAULTS_PER_ROBOT
    return MatchPlan(seconds=seconds, seed=seed + index, faults=tuple(faults)), kinds


def judge_matches(seed: int, matches: int, seconds: float, pool: Pool) -> None:
    """Play undisturbed matches, print a row each, and judge the whole."""
    table = Table(
        (
            f"seed         | score | near %: rate | mm: error | p95 mm: error | lost s: error {MAX_LOST_S} | "
            f"half %: rate | stuck s: error {MAX_STUCK_S} | collisions | m driven | verdict"
        ),
        f"{matches} matches of {seconds:g} s; near, lost, half and stuck: of the worst robot",
        name="matches",
        # of two frames one after the other the second adds little
        samples=round(seconds),
    )
    results = list(pool.map(play_plan, plan_matches(MatchPlan(seconds=seconds, seed=seed), matches)))
    goals = 0
    for result in results:
        robots = result["robots"]
        near = min(robot["within_5cm_3deg"] for robot in robots)
        lost_s = max(robot["longest_lost_s"] for robot in robots)
        half = min(1.0 if robot["right_half_ratio"] is None else robot["right_half_ratio"] for robot in robots)
        stuck_s = max(robot["longest_stuck_s"] for robot in robots)
        stopped = any(robot["stopped_s"] is not None for robot in robots)
        ok = near >= MIN_NEAR and lost_s <= MAX_LOST_S and half == 1.0 and stuck_s <= MAX_STUCK_S and not stopped
        goals += sum(result["score"])
        table.row(
            str(result["seed"]),
            "{}:{}".format(*result["score"]),
            percent(near),
            1e3 * float(np.median([robot["median_error_m"] for robot in robots])),
            1e3 * max(robot["p95_error_m"] for robot in robots),
            lost_s,
            percent(half),
            stuck_s,
            sum(robot["collisions"] for robot in robots) // 2,
            sum(robot["distance_m"] for robot in robots),
            verdict(ok),
        )
    minutes = matches * seconds / 60
    goal_table = Table("goals, of all matches | goals | minutes | a minute | target | verdict", name="goals")
    goal_table.row("both sides", goals, minutes, goals / minutes, "some", verdict(goals > 0))


def judge_faults(seed: int, matches: int, spacing_s: float, pool: Pool) -> None:
    """Play disturbed matches, print a row for each kind of fault, and judge the whole."""
    planned = [faulty_plan(seed + 1000, index, spacing_s) for index in range(matches)]
    results = list(pool.map(play_plan, [plan for plan, _ in planned]))
    recoveries: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for (_, kinds), result in zip(planned, results, strict=True):
        for fault in result["faults"]:
            recovery_s = fault["recovery_s"]
            kind = kinds[fault["robot"], round(fault["from_s"], 6)]
            recoveries[kind].append(math.inf if recovery_s is None else recovery_s)
    table = Table(
        (f"fault                     | times | median s | worst s: error {MAX_RECOVERY_S / 2} | target s | verdict"),
        f"faults, in {matches} matches",
        name="faults",
    )
    for kind, times in recoveries.items():
        if not times:
            continue
        ok = max(times) <= MAX_RECOVERY_S
        table.row(kind, len(times), float(np.median(times)), max(times), MAX_RECOVERY_S, verdict(ok))


def soak(seed: int, seconds: float) -> None:
    """Play one long match in this process and judge how its memory grows once all is warm."""
    match = MatchPlan(seconds=seconds, seed=seed).begin()
    warm_s = max(seconds / 20, min(10.0, seconds / 2))
    for _ in match.play(warm_s):
        pass
    before = resident_mb()
    for _ in match.play(seconds - warm_s):
        pass
    after = resident_mb()
    figures = match.figures
    growth = after / before - 1
    near = min(robot.within_5cm_3deg for robot in figures.robots)
    lost_s = max(robot.longest_lost_s for robot in figures.robots)
    table = Table(
        "soak, simulated s | MB warm | MB at end | growth % | target % | near % | lost s | score | verdict",
        "one long match",
        name="soak",
    )
    ok = growth <= MAX_GROWTH
    table.row(
        f"{seconds:g}",
        before,
        after,
        100 * growth,
        100 * MAX_GROWTH,
        percent(near),
        lost_s,
        "{}:{}".format(*figures.score),
        verdict(ok),
    )


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    matches, seconds, faulty, spacing_s, soak_s = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    judge_matches(arguments.seed, matches, seconds, pool)
    judge_faults(arguments.seed, faulty, spacing_s, pool)
    if math.isfinite(resident_mb()):
        soak(arguments.seed, soak_s)
