"""Many matches, each a piece of work for processes of this machine or for a cluster.

Match i of a tournament is the match of seed S + i, so results do not depend on the workers. A match that is lost with
its worker is played again.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.workers import Workers, run_pieces
from sim2d.match.run import MatchPlan
from sim2d.players.catalog import player_name
from sim2d.report.match_figures import match_json


def plan_matches(plan: MatchPlan, matches: int) -> list[MatchPlan]:
    """Return the plans of a tournament: the given one, with its seed counted on.

    Raises
    ------
    ArgumentError
        If there are no matches.
    """
    if matches < 1:
        raise ArgumentError(f"matches must be at least 1, got {matches}")
    return [replace(plan, seed=plan.seed + index) for index in range(matches)]


def play_plan(plan: MatchPlan) -> dict[str, Any]:
    """Play a match, and return what stands in its match.json."""
    cv2.setNumThreads(0)
    match = plan.begin()
    for _ in match.play(plan.seconds):
        pass
    ours, theirs = player_name(plan.ours), player_name(plan.theirs)
    arena = match.arena
    return match_json(arena.field.name, arena.players, plan.seed, match.figures, ours, theirs, arena.disturbances.names)


def play_matches(plans: Sequence[MatchPlan], workers: Workers) -> Generator[tuple[int, dict[str, Any]], None, None]:
    """Play matches, yielding the index of each and what stands in its match.json, in the order they end.

    Raises
    ------
    RobocupVisionError
        If a match cannot be played, or all workers are lost again and again.
    """
    return run_pieces(_player, plans, workers, describe=lambda plan: f"the match of seed {plan.seed}")


def _player() -> Callable[[MatchPlan], dict[str, Any]]:
    return play_plan


def plan_json(plan: MatchPlan) -> dict[str, Any]:
    """Return as JSON values what the matches of a tournament depend on, besides their number."""
    return {
        "format": 1,
        "field": plan.field,
        "players": plan.setup.players,
        "camera": repr(plan.setup.camera),
        "robot": repr(plan.setup.robot),
        "seconds": plan.seconds,
        "seed": plan.seed,
        "ours": player_name(plan.ours),
        "theirs": player_name(plan.theirs),
        "disturbances": repr(plan.disturbances),
    }


def tournament_json(plan: MatchPlan, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return a tournament as JSON values: its totals, and what stands in the match.json of each match, in order."""
    robots = [robot for result in results for robot in result["robots"]]
    scores = np.array([result["score"] for result in results])
    halves = [robot["right_half_ratio"] for robot in robots if robot["right_half_ratio"] is not None]
    lead = np.sign(scores[:, 0] - scores[:, 1])
    return {
        "format": 1,
        "field": results[0]["field"],
        "players": plan.setup.players,
        "ours": player_name(plan.ours),
        "theirs": player_name(plan.theirs),
        "seconds": results[0]["seconds"],
        "seed": plan.seed,
        "totals": {
            "matches": len(results),
            "goals": scores.sum(axis=0).tolist(),
            "won": int((lead > 0).sum()),
            "drawn": int((lead == 0).sum()),
            "lost": int((lead < 0).sum()),
            "within_5cm_3deg": round(float(np.mean([robot["within_5cm_3deg"] for robot in robots])), 6),
            "longest_lost_s": max(robot["longest_lost_s"] for robot in robots),
            "min_right_half_ratio": min(halves, default=None),
            "longest_stuck_s": max(robot["longest_stuck_s"] for robot in robots),
            "stopped_players": sum(robot["stopped_s"] is not None for robot in robots),
        },
        "matches": list(results),
    }
