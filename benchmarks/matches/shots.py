"""Shots in matches of plain players: the chance that `ShotPlanner` gives each kick, and whether it went in.

Matches of 2 against 2 on ssl_2001. A kick by anyone but a keeper is judged from the true places and velocities of all
robots, and of the ball as it leaves, as they stand one control period after the kick; it went in if its side scores
within 2.5 s and before its next kick. Log loss: mean of -log of the chance given to what happened (from 1 to 99 %),
beside that of giving each kick the mean ratio of goals. Held ball: of the moments in which a robot has the
ball in its mouth, the ratio in which its last frame showed the ball.
"""

from __future__ import annotations

import math
from argparse import Namespace
from itertools import pairwise

import numpy as np

from benchmarks.harness import Kind, Pool, Table, percent, program, verdict
from robocup_vision.planning import Disc
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import plan_matches
from sim2d.players.shot import Shooter
from sim2d.world.state import WorldState

# (matches, seconds each)
QUICK, DEFAULT, FULL = (2, 6.0), (60, 20.0), (200, 20.0)
SCORES_S = 2.5
BINS = (0.0, 0.02, 0.2, 0.8, 0.95, 1.0001)
STD_M = 0.01
MAX_LOG_LOSS, MIN_SURE, MIN_SEEN = 0.6, 0.9, 0.95


def chance_of(shooter: Shooter, state: WorldState, robot: int, radius_m: float) -> float:
    """Chance of a goal by the kick that a robot has just made."""
    assert state.ball is not None
    defenders = [
        Disc(
            one.pose.x_m,
            one.pose.y_m,
            radius_m,
            STD_M**2 * np.eye(2),
            vx_mps=one.velocity_mps[0],
            vy_mps=one.velocity_mps[1],
        )
        for one in state.robots
        if one.index != robot
    ]
    heading = math.atan2(state.ball.vy_mps, state.ball.vx_mps)
    place = np.array([state.ball.x_m, state.ball.y_m])
    return float(shooter.shots.chances(place, np.array(heading), defenders, STD_M, 0.0))


def kicks_of(plan: MatchPlan) -> tuple[list[tuple[float, bool]], list[bool]]:
    """Play a match; the chance of each kick and whether it went in; and, whenever a ball was held, if it was seen."""
    match = plan.begin()
    arena = match.arena
    shooters = {side: Shooter(arena.field, arena.limits, side) for side in (1, -1)}
    kicks: list[tuple[float, float, int, bool]] = []
    scored: set[int] = set()
    seen: list[bool] = []
    for moment in match.play(plan.seconds):
        for robot in moment.robots:
            view = robot.status.view
            if robot.senses.ball_in_mouth and view is not None:
                seen.append(view.ball is not None)
        state = arena.state
        for event in state.events:
            if event.kind == "kick":
                kicker = state.robots[event.robots[0]]
                chance = chance_of(shooters[kicker.side], state, kicker.index, arena.limits.radius_m)
                kicks.append((state.t_s, chance, kicker.side, kicker.number > 0))
            elif event.kind == "goal":
                last = max((k for k, kick in enumerate(kicks) if kick[2] == event.side), default=None)
                if last is not None and state.t_s - kicks[last][0] < SCORES_S:
                    scored.add(last)
    return [(chance, k in scored) for k, (_, chance, _, counts) in enumerate(kicks) if counts], seen


def log_loss(chance: np.ndarray, scored: np.ndarray) -> float:
    """Mean of -log of the chance given to what happened."""
    given = np.clip(chance, 0.01, 0.99)
    return float(-np.mean(np.where(scored, np.log(given), np.log(1.0 - given))))


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    plans = plan_matches(MatchPlan(seconds=seconds, seed=arguments.seed), matches)
    played = list(pool.map(kicks_of, plans))
    kicks = [kick for of_match, _ in played for kick in of_match]
    seen = float(np.mean([one for _, of_match in played for one in of_match]))
    chance, scored = np.array([c for c, _ in kicks]), np.array([s for _, s in kicks])
    title = f"{len(kicks)} kicks in {matches} matches"
    table = Table("chance of a goal, % | kicks | chance % | went in %", title, name="chances")
    for low, high in pairwise(BINS):
        of = (chance >= low) & (chance < high)
        ratios = (100 * float(chance[of].mean()), 100 * float(scored[of].mean())) if of.any() else (None, None)
        table.row(f"{100 * low:.0f} to {100 * min(high, 1.0):.0f}", int(of.sum()), *ratios)
    base = log_loss(np.full(len(scored), scored.mean()), scored)
    ratio = log_loss(chance, scored) / base
    sure = float(scored[chance >= BINS[-2]].mean()) if (chance >= BINS[-2]).any() else 0.0
    verdicts = Table("how good the chances are                 | measured: by row | target | verdict", name="verdicts")
    is_informative, is_sure = ratio <= MAX_LOG_LOSS, sure >= MIN_SURE
    cells: tuple[float | str, str, str] = ratio, f"<= {MAX_LOG_LOSS}", verdict(is_informative)
    verdicts.row("log loss to that of the mean ratio", *cells, kind=Kind.ERROR, samples=len(kicks))
    surest = int((chance >= BINS[-2]).sum())
    cells = percent(sure), f">= {100 * MIN_SURE:g}", verdict(is_sure)
    verdicts.row("of the surest kicks went in, %", *cells, kind=Kind.RATE, samples=surest)
    is_seen = seen >= MIN_SEEN
    cells = percent(seen), f">= {100 * MIN_SEEN:g}", verdict(is_seen)
    verdicts.row("held balls that are seen, %", *cells, kind=Kind.RATE, samples=len(kicks))
