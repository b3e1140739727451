"""Heads of planning players: with and without looks for the half of the field and at undecided floor.

Matches of one player against a robot that stands still, on four_legged_2007 with its pinhole cameras. The player is
carried elsewhere once. Each match is played with one seed by "planning", "asking" (which asks for the half of the
field) and "looking" (which looks at undecided floor again). "near": fraction of the frames with an estimate within 5 cm
and 3 degrees of the truth. "lost": longest time without an estimate, or with one more than 10 cm or 5 degrees off.
"looks": control periods in which such a look was planned. Both options are off by default; these rows are the reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from benchmarks.harness import Table, finish, parse_arguments, percent, verdict
from benchmarks.harness import columns as col
from benchmarks.worlds.failed_players import COLUMN, count_failed
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from sim2d.match.disturbances import NONE
from sim2d.match.run import MatchPlan
from sim2d.players.catalog import player_factory
from sim2d.report.robot_figures import RobotFigures
from sim2d.robot_link import Command, PlayerSetup, PlayerStatus, Senses
from sim2d.sensors.faults import BodyFault

# (matches, seconds each)
QUICK, DEFAULT, FULL = (1, 1.0), (2, 6.0), (20, 10.0)
PLAYERS = ("planning", "asking", "looking")
LOOKS = {"planning": "", "asking": "half", "looking": "floor"}
CARRIED_AT_S = 0.5


class Still:
    """A player that does nothing."""

    status = PlayerStatus(NotLocated("it does not look"), None, "stand", None)

    def __init__(self, setup: PlayerSetup) -> None:
        pass

    def act(self, senses: Senses) -> Command:
        """Stand."""
        return Command()


@dataclass
class Played:
    """Figures of one kind of player, a robot a match, and how often it planned its kind of look."""

    robots: list[RobotFigures] = field(default_factory=list)
    looks: int = 0
    failed: int = 0


def play(name: str, seed: int, seconds: float, played: Played) -> None:
    """Play one match, and add its figures."""
    rng = np.random.default_rng(seed)
    to = Pose2(rng.uniform(-1.5, 1.5), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi))
    faults = (BodyFault(0, CARRIED_AT_S, carry_to=to),)
    match = MatchPlan(
        "four_legged_2007", 1, seconds, seed, player_factory(name), Still, faults=faults, disturbances=NONE
    ).begin()
    for moment in match.play(seconds):
        reasons = moment.robots[0].status.reasons
        played.looks += any(r.topic == "gaze" and r.choice == LOOKS[name] for r in reasons)
    figures = match.figures
    played.robots.append(figures.robots[0])
    played.failed += count_failed(figures)


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__))
    cv2.setNumThreads(0)
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    table = Table(
        (
            "player    ",
            col.rate("near %"),
            col.error("lost s", floor=0.5),
            "looks",
            "m driven",
            COLUMN,
            "verdict",
        ),
        f"{matches} matches of {seconds:g} s, each by all; the verdict: no player failed",
        name="looks",
        samples=round(matches * seconds),
    )
    all_ok = True
    for name in PLAYERS:
        played = Played()
        for index in range(matches):
            play(name, arguments.seed + index, seconds, played)
        robots = played.robots
        ok = not played.failed
        all_ok &= ok
        table.row(
            name,
            percent(float(np.mean([robot.within_5cm_3deg for robot in robots]))),
            max(robot.longest_lost_s for robot in robots),
            played.looks,
            sum(robot.distance_m for robot in robots),
            played.failed,
            verdict(ok),
        )
    finish(arguments.check, all_ok)


if __name__ == "__main__":
    main()
