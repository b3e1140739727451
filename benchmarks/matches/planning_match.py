"""Planning in the match: a side that plans its ways, speeds, gaze and shots, and the same side without.

Matches of 2 against 2 on ssl_2001, each played twice with one seed: by a side that plans against plain players, and by
plain players against plain ones. "Contacts": times one of our robots came to touch another robot, ours or theirs.
Differences are of matches with the same seed, with their standard error (SE). "fewer contacts": fewer by more than two
standard errors; "no lower score": goals for less goals against, lower by no more than one.

--full plays matches of 60 s.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.harness import Kind, Table, finish, parse_arguments, verdict
from benchmarks.harness import columns as col
from benchmarks.harness.pool import open_pool
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import plan_matches, play_plan
from sim2d.players.catalog import player_factory

# (matches, seconds each)
QUICK, DEFAULT, FULL = (2, 6.0), (40, 20.0), (40, 60.0)
MAX_STUCK_S = 5.0


def figures_of(match: dict[str, Any]) -> tuple[float, float, float, float]:
    """Contacts of our robots, goals for, goals against, and the longest time one of ours was stuck."""
    ours = [robot for robot in match["robots"] if robot["side"] > 0]
    goals_for, against = match["score"]
    return sum(r["collisions"] for r in ours), goals_for, against, max(r["longest_stuck_s"] for r in ours)


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__), pooled=True)
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    plans = plan_matches(MatchPlan(seconds=seconds, seed=arguments.seed), matches)
    planning = [replace(plan, ours=player_factory("planning")) for plan in plans]
    with open_pool(arguments) as pool:
        results = list(pool.map(play_plan, [*plans, *planning]))
    without, with_ = (np.array([figures_of(m) for m in part]) for part in (results[:matches], results[matches:]))
    stopped = sum(r["stopped_s"] is not None for m in results for r in m["robots"])
    per_minute = 60 / seconds
    table = Table(
        ("a minute, our side            ", "plain", col.measured("plans"), "difference", "SE", "target", "verdict"),
        f"{matches} matches of {seconds:g} s, each with and without",
        name="a minute",
    )

    def row(name: str, before: np.ndarray, after: np.ndarray, target: str = "", sign: int = 0) -> bool:
        change = per_minute * (after - before)
        mean, error = float(change.mean()), float(change.std(ddof=1)) / math.sqrt(len(change))
        ok = mean < -2 * error if sign < 0 else mean >= -error
        cells = per_minute * float(before.mean()), per_minute * float(after.mean()), mean, error
        table.row(name, *cells, target, verdict(ok) if target else "")
        return ok or not target

    ok = row("contacts", without[:, 0], with_[:, 0], "fewer", -1)
    row("goals for", without[:, 1], with_[:, 1])
    row("goals against", without[:, 2], with_[:, 2])
    for_less_against = [part[:, 1] - part[:, 2] for part in (without, with_)]
    ok &= row("goals for less against", for_less_against[0], for_less_against[1], "no lower", 1)
    stuck = float(without[:, 3].max()), float(with_[:, 3].max())
    is_free = stuck[1] <= MAX_STUCK_S
    cells = *stuck, stuck[1] - stuck[0], None, f"<= {MAX_STUCK_S:g}", verdict(is_free)
    table.row("longest stuck, s", *cells, kind=Kind.COUNT)
    table.row("players that failed", None, float(stopped), None, None, "0", verdict(not stopped), kind=Kind.COUNT)
    finish(arguments.check, ok and is_free and not stopped)


if __name__ == "__main__":
    main()
