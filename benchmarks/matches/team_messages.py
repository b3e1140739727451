"""Team messages: how much of the time robots know where the ball is, with and without messages of others.

Matches of 3 against 3 on four_legged_2007 (heads with a narrow view) and of 2 against 2 on ssl_2001 (mirror cameras),
with all that disturbs robots there. The side that attacks +x plays with planning players, which speak to each other,
with a part of the messages lost; "alone" are the same players with all messages lost. The other side plays with plain
players. "known": fraction of the control periods in which a robot's ball is within 20 cm of the true one, mean of all
robots of the side. "ratio": that, to the one of robots that are alone, with its standard error over the matches (SE).
"two fetch": fraction of the periods in which two robots of the side fetch the ball.

On a field whose robots see the ball nearly always a ratio of 1.3 is not possible: there "no less" is asked.
"""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.scores.match_score import count_failed
from field_models import load_field
from sim2d.match.disturbances import disturbances_for
from sim2d.match.run import MatchPlan
from sim2d.match.setups import setup_for
from sim2d.players.catalog import player_factory
from sim2d.sensors.team_channel import ChannelSettings

# (matches, seconds each)
QUICK, DEFAULT, FULL = (1, 0.6), (3, 6.0), (40, 60.0)
NEAR_M, MIN_RATIO = 0.2, 1.3
LOSSES = (0.1, 0.5)
FIELDS = (("four_legged_2007", 3), ("ssl_2001", 2))


TEAM = player_factory("planning")


def play(plan: MatchPlan) -> tuple[float, float, int]:
    """Play a match; return the fractions of periods with a known ball and with two that fetch, and failed players."""
    match = plan.begin()
    known, two, periods, players = 0, 0, 0, match.arena.players
    for moment in match.play(plan.seconds):
        ball = moment.state.ball
        assert ball is not None
        side = moment.robots[:players]
        periods += 1
        places = [robot.status.ball_in_field for robot in side]
        known += sum(place is not None and math.dist(place, (ball.x_m, ball.y_m)) < NEAR_M for place in places)
        two += sum(robot.status.intent in ("fetch", "get behind") for robot in side) > 1
    return known / (periods * players), two / periods, count_failed(match.figures)


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    for field, players in FIELDS:
        setup = setup_for(load_field(field))
        usual = disturbances_for(setup.robot, setup.camera)
        lossy = {loss: replace(usual, messages=ChannelSettings(loss_ratio=loss)) for loss in (*LOSSES, 1.0)}
        plans = [
            MatchPlan(field, players, seconds, arguments.seed + k, TEAM, disturbances=lossy[1.0])
            for k in range(matches)
        ]
        rows = {"alone": plans}
        for loss in LOSSES:
            rows[f"{100 * loss:.0f} % lost"] = [replace(plan, disturbances=lossy[loss]) for plan in plans]
        table = Table(
            (
                "robots | known %: rate | ratio | SE | two fetch %: by row | players that failed: count | "
                "target | verdict"
            ),
            f"{field}, {matches} matches of {seconds:g} s, {players} against {players}",
            name=f"known {field}",
            samples=round(matches * seconds * 3),
        )
        results = iter(pool.map(play, [plan for part in rows.values() for plan in part]))
        alone = np.zeros(matches)
        for name, part in rows.items():
            found = np.array([next(results) for _ in part])
            known = found[:, 0]
            if name == "alone":
                alone = known
            ratio = float(known.sum() / max(alone.sum(), 1e-9))
            error = float((known - ratio * alone).std() / max(alone.mean(), 1e-9)) / math.sqrt(matches)
            is_asked = name.endswith("lost")
            least = MIN_RATIO if field == "four_legged_2007" else 1.0
            failed = int(found[:, 2].sum())
            ok = ratio >= least and not failed
            is_told = is_asked or failed > 0
            cells = percent(float(known.mean())), ratio, error, percent(float(found[:, 1].mean())), failed
            table.row(name, *cells, f">= {least:g}" if is_asked else "", verdict(ok) if is_told else "")
