"""Matches on every built-in league's field, as `robocup-vision match --field F` plays them.

Players per side, camera and robots are those of `sim2d.match.setups`, the disturbances the default ones: with pinhole
cameras late frames, slow shutters, nods and drifting light. Division B is played with forward cameras and, as a row of
its own, with mirror cameras. "near": fraction of the control periods in which a robot's estimate is within the bound of
the truth. "lost": longest time of any robot without such an estimate. "right half": of the poses estimated after 2 s.
"contacts": times a robot came to touch another one, a robot and minute. "real time": simulated over processor seconds,
one thread, all players and pictures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import process_time

import cv2

from benchmarks.harness import Table, finish, parse_arguments, percent, verdict
from benchmarks.harness import columns as col
from sim2d.match.run import MatchPlan
from sim2d.robot_link import CONTROL_PERIOD_S

# (matches of each row, seconds each)
QUICK, DEFAULT, FULL = (1, 1.0), (1, 10.0), (40, 60.0)
SETTLED_S = 2.0


@dataclass(frozen=True)
class Case:
    """A field, with the bounds of the estimate and what is to be reached."""

    name: str
    field: str
    near_m: float
    near_rad: float
    min_near: float
    max_lost_s: float
    camera: str | None = None


CASES = (
    Case("ssl_2001", "ssl_2001", 0.03, math.radians(3.0), 0.99, 1.0),
    Case("four_legged_2007", "four_legged_2007", 0.10, math.radians(5.0), 0.97, 0.7),
    Case("ssl_division_b, forward", "ssl_division_b", 0.15, math.radians(5.0), 0.95, 1.0),
    Case("ssl_division_b, mirror", "ssl_division_b", 0.15, math.radians(5.0), 0.95, 1.0, "ssl_mirror"),
    Case("msl_18x12", "msl_18x12", 0.15, math.radians(5.0), 0.95, 1.0),
    Case("spl_2020", "spl_2020", 0.15, math.radians(5.0), 0.95, 1.0),
)


@dataclass
class Played:
    """What is counted over the matches of a case."""

    periods: int = 0
    near: int = 0
    settled: int = 0
    right_half: int = 0
    lost_s: float = 0.0
    goals: int = 0
    contacts: int = 0
    stopped: int = 0
    seconds: float = 0.0
    spent_s: float = 0.0


def play(case: Case, seconds: float, seed: int, played: Played) -> None:
    """Play a match, and count."""
    match = MatchPlan(case.field, seconds=seconds, seed=seed, camera=case.camera).begin()
    lost_s = [0.0] * len(match.arena.state.robots)
    began = process_time()
    for moment in match.play(seconds):
        for index, (robot, truth) in enumerate(zip(moment.robots, moment.state.robots, strict=True)):
            played.periods += 1
            is_near = False
            if robot.status.pose:
                away_m, turned_rad = robot.status.pose.pose.error_to(truth.pose)
                is_near = away_m < case.near_m and turned_rad < case.near_rad
                if moment.state.t_s > SETTLED_S:
                    played.settled += 1
                    other = robot.status.pose.pose.half_turn()
                    played.right_half += away_m + turned_rad < sum(other.error_to(truth.pose))
            played.near += is_near
            lost_s[index] = 0.0 if is_near else lost_s[index] + CONTROL_PERIOD_S
            played.lost_s = max(played.lost_s, lost_s[index])
    played.spent_s += process_time() - began
    figures = match.figures
    played.seconds += figures.seconds
    played.goals += sum(figures.score)
    played.contacts += sum(robot.collisions for robot in figures.robots)
    played.stopped += sum(robot.stopped_s is not None for robot in figures.robots)


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__))
    cv2.setNumThreads(0)
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    table = Table(
        (
            "field",
            "players",
            "bound",
            col.rate("near %"),
            "target %",
            col.error("lost s", floor=1.0),
            "at most s",
            col.rate("right half %"),
            "goals a minute",
            "contacts",
            "real time",
            col.count("players that failed"),
            "verdict",
        ),
        f"{matches} matches of {seconds:g} s on each field",
        name="every field",
        samples=round(matches * seconds * 4),
    )
    all_ok = True
    for case in CASES:
        played = Played()
        # the first match of a field compiles and loads: it is not timed
        play(case, 0.1, arguments.seed, Played())
        for index in range(matches):
            play(case, seconds, arguments.seed + index, played)
        players = MatchPlan(case.field).setup.players
        near = played.near / played.periods
        right_half = played.right_half / played.settled if played.settled else None
        ok = near >= case.min_near and played.lost_s <= case.max_lost_s and played.stopped == 0
        ok &= right_half is None or right_half == 1.0
        all_ok &= ok
        minutes = played.seconds / 60.0
        table.row(
            case.name,
            f"{players} : {players}",
            f"{100 * case.near_m:g} cm, {math.degrees(case.near_rad):g} deg",
            percent(near),
            f"{100 * case.min_near:g}",
            played.lost_s,
            f"{case.max_lost_s:g}",
            percent(right_half),
            f"{played.goals / minutes:.1f}",
            f"{played.contacts / (2 * players * minutes):.1f}",
            f"{played.seconds / played.spent_s:.2f}",
            played.stopped,
            verdict(ok),
        )
    finish(arguments.check, all_ok)


if __name__ == "__main__":
    main()
