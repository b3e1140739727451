"""Matches of robots with heads and legs, disturbed by each thing that disturbs legs, by all, and by none.

Two against two on four_legged_2007 with pinhole cameras and the built-in players; the same seeds for each row. "near":
fraction of the control periods in which a robot's estimate is within 10 cm and 5 degrees of the truth. "lost": longest
time without an estimate, or with one farther off, of any robot. "real time": simulated over processor seconds, one
thread, players and pictures of four robots. Knocks (wrong_camera_match.py) and lost messages are not among them. Such
matches are what `robocup-vision match --field four_legged_2007 --disturb NAME` plays.
"""

from __future__ import annotations

import math
from argparse import Namespace
from time import process_time

from benchmarks.harness import Table, percent, program, verdict
from benchmarks.harness import columns as col
from benchmarks.worlds.failed_players import COLUMN, count_failed
from sim2d.match.disturbances import LEGS, NONE, Disturbances
from sim2d.match.run import MatchPlan

# (matches, seconds each)
QUICK, DEFAULT, FULL = (1, 2.0), (2, 10.0), (40, 60.0)
NEAR_M, NEAR_RAD = 0.10, math.radians(5.0)
MIN_NEAR, MAX_LOST_S = 0.97, 0.7


def play(plan: MatchPlan) -> tuple[int, int, float, float, int]:
    """Play a match; return near periods, all periods, longest time lost, processor seconds, and failed players."""
    match = plan.begin()
    began = process_time()
    near = periods = 0
    for moment in match.play(plan.seconds):
        for robot, truth in zip(moment.robots, moment.state.robots, strict=True):
            periods += 1
            if robot.status.pose:
                away_m, turned_rad = robot.status.pose.pose.error_to(truth.pose)
                near += away_m < NEAR_M and turned_rad < NEAR_RAD
    spent = process_time() - began
    figures = match.figures
    lost_s = max(robot.longest_lost_s for robot in figures.robots)
    return near, periods, lost_s, spent, count_failed(figures)


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    rows: dict[str, Disturbances] = {
        "none": NONE,
        **{name: LEGS.only([name]) for name in LEGS.names if name != "messages"},
        "all": LEGS,
    }
    table = Table(
        (
            "disturbed by",
            col.rate("near %"),
            col.error("lost s", floor=0.5),
            "real time",
            COLUMN,
            "verdict",
        ),
        f"{matches} matches of {seconds:g} s; near at least {100 * MIN_NEAR:g} %, lost at most {MAX_LOST_S:g} s",
        name="disturbed",
        samples=round(matches * seconds * 4),
    )
    for name, disturbances in rows.items():
        played = [
            play(MatchPlan("four_legged_2007", 2, seconds, arguments.seed + index, disturbances=disturbances))
            for index in range(matches)
        ]
        near = sum(one[0] for one in played) / sum(one[1] for one in played)
        lost_s = max(one[2] for one in played)
        failed = sum(one[4] for one in played)
        ok = near >= MIN_NEAR and lost_s <= MAX_LOST_S and not failed
        table.row(
            name,
            percent(near),
            lost_s,
            f"{matches * seconds / sum(one[3] for one in played):.2f}",
            failed,
            verdict(ok),
        )


if __name__ == "__main__":
    main()
