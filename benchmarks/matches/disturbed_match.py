"""Matches of robots with heads and legs, disturbed by each thing that disturbs legs, by all, and by none.

Two against two on four_legged_2007 with pinhole cameras and the built-in players; the same seeds for each row. "near":
fraction of the control periods in which a robot's estimate is within 10 cm and 5 degrees of the truth. "lost": longest
time without an estimate, or with one farther off, of any robot. "real time": simulated over processor seconds, one
thread, players and pictures of four robots. Knocks (wrong_camera_match.py) and lost messages are not among them. Such
matches are what `robocup-vision match --field four_legged_2007 --disturb NAME` plays.
"""

from __future__ import annotations

from argparse import Namespace

from benchmarks.harness import Table, percent, program, verdict
from benchmarks.scores.match_score import BOUNDS, Played, play
from sim2d.match.disturbances import LEGS, NONE, Disturbances
from sim2d.match.run import MatchPlan

# (matches, seconds each)
QUICK, DEFAULT, FULL = (1, 0.6), (2, 10.0), (40, 60.0)
FIELD = "four_legged_2007"
MIN_NEAR, MAX_LOST_S = 0.97, 0.7


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
        "disturbed by | near %: rate | lost s: error 0.5 | real time | players that failed: count | verdict",
        f"{matches} matches of {seconds:g} s; near at least {100 * MIN_NEAR:g} %, lost at most {MAX_LOST_S:g} s",
        name="disturbed",
        samples=round(matches * seconds * 4),
    )
    for name, disturbances in rows.items():
        plans = [
            MatchPlan(FIELD, 2, seconds, arguments.seed + index, disturbances=disturbances) for index in range(matches)
        ]
        played = Played.together([play(plan, BOUNDS[FIELD]) for plan in plans])
        near, lost_s, failed = played.near / played.periods, played.lost_s, played.stopped
        ok = near >= MIN_NEAR and lost_s <= MAX_LOST_S and not failed
        table.row(
            name,
            percent(near),
            lost_s,
            f"{matches * seconds / played.spent_s:.2f}",
            failed,
            verdict(ok),
        )
