"""Planning in the match: a side that plans its ways, speeds, gaze and shots, and agrees by messages; and one without.

Matches of 2 against 2 on ssl_2001, each played twice with one seed: by a side that plans against plain players, and by
plain players against plain ones; then fewer of them on each league's field, as `robocup-vision match --field F` plays.
"Contacts": times one of our robots came to touch another robot, ours or theirs. Differences are of matches with the
same seed, with their standard error (SE). "fewer contacts": fewer by more than two standard errors; "no lower score":
goals for less goals against, lower by no more than one. On a field planning is ahead, or behind, where goals for less
goals against differ by more than two standard errors.

--full plays 40 matches of 60 s on every field, which takes hours; --only FIELD plays those on one league's field, and
--matches N so many of 60 s there.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.harness import Kind, Pool, Table, judge, program, verdict
from benchmarks.scores.match_score import count_failed_in
from robocup_vision.arrays import FloatArray
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import plan_matches, play_plan
from sim2d.players.catalog import player_factory

# (matches, seconds each) on ssl_2001, and on each of the other fields
QUICK, DEFAULT, FULL = (2, 1.0), (40, 20.0), (40, 60.0)
ELSEWHERE_QUICK, ELSEWHERE, ELSEWHERE_FULL = (1, 0.5), (4, 30.0), FULL
FIELDS = ("four_legged_2007", "ssl_division_b", "msl_18x12", "spl_2020")
MAX_STUCK_S = 5.0


def figures_of(match: dict[str, Any]) -> tuple[float, float, float, float]:
    """Contacts of our robots, goals for, goals against, and the longest time one of ours was stuck."""
    ours = [robot for robot in match["robots"] if robot["side"] > 0]
    goals_for, against = match["score"]
    return sum(r["collisions"] for r in ours), goals_for, against, max(r["longest_stuck_s"] for r in ours)


def play_both(pool: Pool, plan: MatchPlan, matches: int) -> tuple[FloatArray, FloatArray, int]:
    """Return the figures (matches, 4) of plain players and of those that plan, and how many players failed."""
    plans = plan_matches(plan, matches)
    planning = [replace(each, ours=player_factory("planning")) for each in plans]
    results = list(pool.map(play_plan, [*plans, *planning]))
    without, with_ = (np.array([figures_of(m) for m in part]) for part in (results[:matches], results[matches:]))
    return without, with_, sum(map(count_failed_in, results))


def measure_ssl_2001(pool: Pool, matches: int, seconds: float, seed: int) -> None:
    """Print contacts, goals and how long robots were stuck."""
    without, with_, stopped = play_both(pool, MatchPlan(seconds=seconds, seed=seed), matches)
    per_minute = 60 / seconds
    table = Table(
        "a minute, our side             | plain | plans: by row | difference | SE | target | verdict",
        f"{matches} matches of {seconds:g} s, each with and without",
        name="a minute",
    )

    def row(name: str, before: np.ndarray, after: np.ndarray, target: str = "", sign: int = 0) -> None:
        change = per_minute * (after - before)
        mean, error = float(change.mean()), float(change.std(ddof=1)) / math.sqrt(len(change))
        ok = mean < -2 * error if sign < 0 else mean >= -error
        cells = per_minute * float(before.mean()), per_minute * float(after.mean()), mean, error
        table.row(name, *cells, target, verdict(ok) if target else "")

    row("contacts", without[:, 0], with_[:, 0], "fewer", -1)
    row("goals for", without[:, 1], with_[:, 1])
    row("goals against", without[:, 2], with_[:, 2])
    for_less_against = [part[:, 1] - part[:, 2] for part in (without, with_)]
    row("goals for less against", for_less_against[0], for_less_against[1], "no lower", 1)
    stuck = float(without[:, 3].max()), float(with_[:, 3].max())
    is_free = stuck[1] <= MAX_STUCK_S
    cells = *stuck, stuck[1] - stuck[0], None, f"<= {MAX_STUCK_S:g}", verdict(is_free)
    table.row("longest stuck, s", *cells, kind=Kind.COUNT)
    table.row("players that failed", None, float(stopped), None, None, "0", verdict(not stopped), kind=Kind.COUNT)


def measure_elsewhere(pool: Pool, fields: Sequence[str], matches: int, seconds: float, seed: int) -> None:
    """Print who is ahead on leagues' fields."""
    columns = "field            | plain | plans: by row | difference | SE | failed: count | verdict"
    title = f"Goals for less against a minute, {matches} matches of {seconds:g} s a field, each with and without"
    table = Table(columns, title, name="fields")
    places = []
    for field_name in fields:
        without, with_, stopped = play_both(pool, MatchPlan(field_name, seconds=seconds, seed=seed), matches)
        plain, plans = (60 / seconds * (part[:, 1] - part[:, 2]) for part in (without, with_))
        change = plans - plain
        error = float(change.std(ddof=1)) / math.sqrt(matches) if matches > 1 else math.inf
        mean = float(change.mean())
        places.append(0 if abs(mean) <= 2 * error else 1 if mean > 0 else -1)
        place = ("behind", "even", "ahead")[places[-1] + 1]
        cells = float(plain.mean()), float(plans.mean()), mean, error if matches > 1 else None
        table.row(field_name, *cells, stopped, place if not stopped else "FAILED")
        places[-1] = -1 if stopped else places[-1]
    judge(min(places) >= 0 and sum(place > 0 for place in places) >= min(3, len(places)))


OPTIONS = {
    "--only": {"metavar": "FIELD", "choices": FIELDS, "help": f"one field: {', '.join(FIELDS)}"},
    "--matches": {"metavar": "N", "type": int, "help": "so many matches of 60 s on each league's field"},
}


@program(OPTIONS, pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    elsewhere = ELSEWHERE_QUICK if arguments.quick else ELSEWHERE_FULL if arguments.full else ELSEWHERE
    if arguments.matches:
        elsewhere = arguments.matches, ELSEWHERE_FULL[1]
    fields = FIELDS[:1] if arguments.quick else FIELDS
    if arguments.only is not None:
        fields = (arguments.only,)
    if arguments.only is None:
        measure_ssl_2001(pool, matches, seconds, arguments.seed)
    measure_elsewhere(pool, fields, *elsewhere, arguments.seed)
