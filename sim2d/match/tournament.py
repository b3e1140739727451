"""Tournaments: many matches, played by processes of this machine or of a cluster.

Match i of a tournament has the seed S + i, so results do not depend on the workers. A match that is lost with its
worker is played again. In a table (round robin) every player meets every other.

Each pair of players meets on several seeds, twice on each with sides changed, so that neither player is favoured.

The ratings follow the model of Bradley and Terry and maximise the posterior. Player i wins against j with the
probability 1 / (1 + 10^((r_j - r_i) / 400)). A draw counts as half a match won and half a match lost. The posterior
is concave in the ratings, so Newton's method finds its only maximum. The standard errors come from the information
matrix at the maximum. A draw has less variance than a won or lost match of the same mean, so the errors are somewhat
too large if there are many draws.

Source: Bradley and Terry, Rank analysis of incomplete block designs, Biometrika 39, 1952.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.workers import Workers, run_pieces
from sim2d.match.run import MatchPlan
from sim2d.players.catalog import player_name
from sim2d.report.match_figures import match_json
from sim2d.robot_link import PlayerFactory

_ELO_PER_LOGIT = 400.0 / math.log(10.0)
# mean of all ratings, by convention: results determine only differences
_MEAN_ELO = 1500.0
# Standard deviation of the prior of a rating. It keeps the rating finite if a player has won or lost all matches. 400
# Elo mean ten matches won for one lost, a large difference between variants of one program.
_PRIOR_STD_ELO = 400.0
# more than Newton's method needs, which doubles the number of correct digits with each step
_MAX_STEPS = 100
_CONVERGED_LOGIT = 1e-12


def plan_matches(plan: MatchPlan, matches: int) -> list[MatchPlan]:
    """Return the plans of a tournament: the given one with successive seeds.

    Raises
    ------
    ArgumentError
        If `matches` is less than 1.
    """
    if matches < 1:
        raise ArgumentError(f"matches must be at least 1, got {matches}")
    return [replace(plan, seed=plan.seed + index) for index in range(matches)]


def play_plan(plan: MatchPlan) -> dict[str, Any]:
    """Play a match, and return the content of its match.json."""
    cv2.setNumThreads(0)
    match = plan.begin()
    for _ in match.play(plan.seconds):
        pass
    ours, theirs = player_name(plan.ours), player_name(plan.theirs)
    arena = match.arena
    return match_json(arena.field.name, arena.players, plan.seed, match.figures, ours, theirs, arena.disturbances.names)


def play_matches(plans: Sequence[MatchPlan], workers: Workers) -> Generator[tuple[int, dict[str, Any]], None, None]:
    """Play matches, yielding the index of each and the content of its match.json, in the order in which they end.

    Raises
    ------
    RobocupVisionError
        If a match cannot be played, or all workers are lost repeatedly.
    """
    return run_pieces(_player, plans, workers, describe=lambda plan: f"the match of seed {plan.seed}")


def _player() -> Callable[[MatchPlan], dict[str, Any]]:
    return play_plan


def plan_json(plan: MatchPlan) -> dict[str, Any]:
    """Return as JSON values all parameters on which the matches of a tournament depend, except their number."""
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
    """Return a tournament as JSON values: its totals, and the match.json of each match, in order."""
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


@dataclass(frozen=True, slots=True, eq=False)
class Ratings:
    """Ratings of some players."""

    #: (n,) float64: rating of each player.
    elo: FloatArray
    #: (n, n) float64: covariance of the ratings' errors, relative to their common mean, Elo squared.
    covariance: FloatArray

    @property
    def std_error_elo(self) -> FloatArray:
        """Standard error of each rating relative to the mean of all, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def difference(self, first: int, second: int) -> tuple[float, float]:
        """Return the first player's rating minus the second's, and the standard error of the difference, in Elo."""
        contrast = np.zeros(len(self.elo))
        contrast[first] += 1.0
        contrast[second] -= 1.0
        variance = float(contrast @ self.covariance @ contrast)
        return float(self.elo[first] - self.elo[second]), math.sqrt(max(variance, 0.0))


def rate_players(points: FloatArray) -> Ratings:
    """Rate players by their results against each other.

    Parameters
    ----------
    points : (n, n) float64
        ``points[i, j]``: points of player i against player j, 1 for a won match and 0.5 for a draw. The diagonal is 0.

    Raises
    ------
    ArgumentError
        If the points are not such a matrix.
    """
    won = np.asarray(points, dtype=np.float64)
    if won.ndim != 2 or won.shape[0] != won.shape[1] or not won.size:
        raise ArgumentError(f"points must be square, got shape {won.shape}")
    if not np.isfinite(won).all() or (won < 0.0).any() or np.diag(won).any():
        raise ArgumentError("points must be finite, not negative, and 0 on the diagonal")
    players = len(won)
    matches = won + won.T
    prior = (_ELO_PER_LOGIT / _PRIOR_STD_ELO) ** 2
    rating = np.zeros(players)
    information = np.eye(players)
    value = _log_posterior(rating, won, prior)
    for _ in range(_MAX_STEPS):
        probability = 1.0 / (1.0 + np.exp(rating[None, :] - rating[:, None]))
        gradient = (won - matches * probability).sum(axis=1) - prior * rating
        weight = matches * probability * (1.0 - probability)
        information = np.diag(weight.sum(axis=1) + prior) - weight
        step = np.linalg.solve(information, gradient)
        if np.abs(step).max() < _CONVERGED_LOGIT:
            break
        # far from the maximum a full step may overshoot it
        part = 1.0
        while part > _CONVERGED_LOGIT and _log_posterior(rating + part * step, won, prior) < value:
            part *= 0.5
        rating = rating + part * step
        value = _log_posterior(rating, won, prior)
    centred = np.eye(players) - 1.0 / players
    covariance = centred @ np.linalg.inv(information) @ centred * _ELO_PER_LOGIT**2
    rating = rating - rating.mean()
    return Ratings(_MEAN_ELO + _ELO_PER_LOGIT * rating, covariance)


def _log_posterior(rating: FloatArray, won: FloatArray, prior: float) -> float:
    """Return the logarithm of the ratings' posterior, up to a constant."""
    return float(-(won * np.logaddexp(0.0, rating[None, :] - rating[:, None])).sum() - 0.5 * prior * rating @ rating)


@dataclass(frozen=True, slots=True)
class RoundRobin:
    """A table's matches: every player meets every other.

    Raises
    ------
    ArgumentError
        If there are fewer than two players, two have one name, or the number of matches is not even.
    """

    #: Plan of every match, except its players; its seed is that of the first two matches of each pair.
    plan: MatchPlan
    #: The players and their names.
    players: tuple[tuple[str, PlayerFactory], ...]
    #: Matches of each pair, an even number: two on each seed.
    matches: int

    def __post_init__(self) -> None:
        names = self.names
        if len(names) < 2:
            raise ArgumentError(f"a table needs at least two players, got {len(names)}")
        for name in names:
            if names.count(name) > 1:
                raise ArgumentError(f"a table has each player once, '{name}' is named {names.count(name)} times")
        if self.matches < 2 or self.matches % 2:
            raise ArgumentError(
                "a table needs an even number of matches of each pair, half of them with sides changed, "
                f"got {self.matches}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the players."""
        return tuple(name for name, _ in self.players)

    @property
    def meetings(self) -> list[tuple[int, int]]:
        """Indices of the players of each match: first the one that attacks the goal at +x.

        All pairs meet on one seed before the next seed. An interrupted tournament has then played all pairs about
        equally often, and a longer one begins with the same matches.
        """
        pairs = list(combinations(range(len(self.players)), 2))
        return [sides for _ in range(self.matches // 2) for a, b in pairs for sides in ((a, b), (b, a))]

    @property
    def plans(self) -> list[MatchPlan]:
        """The plan of each match, in the order of `meetings`."""
        meetings = self.meetings
        on_each_seed = 2 * len(meetings) // self.matches
        return [
            replace(
                self.plan,
                seed=self.plan.seed + index // on_each_seed,
                ours=self.players[ours][1],
                theirs=self.players[theirs][1],
            )
            for index, (ours, theirs) in enumerate(meetings)
        ]

    def run_json(self) -> dict[str, Any]:
        """Return as JSON values all parameters on which the matches depend, except their number."""
        values = {key: value for key, value in plan_json(self.plan).items() if key not in ("ours", "theirs")}
        return {**values, "table": list(self.names)}

    def table_json(self, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Return the table as JSON values: a row for each player, the best first.

        Parameters
        ----------
        results : sequence of dict
            The match.json of each match, in the order of `plans`.
        """
        ratings = rate_players(self._points(results))
        order = sorted(range(len(self.players)), key=lambda index: (-ratings.elo[index], self.names[index]))
        return {
            "format": 1,
            "field": results[0]["field"],
            "players": self.plan.setup.players,
            "seconds": results[0]["seconds"],
            "seed": self.plan.seed,
            "matches_of_a_pair": self.matches,
            "table": [self._row(order, place, ratings, results) for place in range(len(order))],
            "matches": [
                {**result, "ours": self.names[ours], "theirs": self.names[theirs]}
                for (ours, theirs), result in zip(self.meetings, results, strict=True)
            ],
        }

    def _points(self, results: Sequence[dict[str, Any]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        points = np.zeros((len(self.players), len(self.players)))
        for (ours, theirs), result in zip(self.meetings, results, strict=True):
            won = 0.5 + 0.5 * float(np.sign(result["score"][0] - result["score"][1]))
            points[ours, theirs] += won
            points[theirs, ours] += 1.0 - won
        return points

    def _row(
        self, order: Sequence[int], place: int, ratings: Ratings, results: Sequence[dict[str, Any]]
    ) -> dict[str, Any]:
        player = order[place]
        goals, leads, stopped = [0, 0], [], 0
        for sides, result in zip(self.meetings, results, strict=True):
            if player not in sides:
                continue
            own = sides.index(player)
            own_goals, other_goals = result["score"][own], result["score"][1 - own]
            goals = [goals[0] + own_goals, goals[1] + other_goals]
            leads.append(int(np.sign(own_goals - other_goals)))
            side = 1 if own == 0 else -1
            stopped += sum(r["stopped_s"] is not None and r["side"] == side for r in result["robots"])
        ahead = ratings.difference(player, order[place + 1]) if place + 1 < len(order) else None
        return {
            "player": self.names[player],
            "elo": round(float(ratings.elo[player]), 1),
            "std_error_elo": round(float(ratings.std_error_elo[player]), 1),
            "ahead_of_next_elo": None if ahead is None else round(ahead[0], 1),
            "ahead_std_error_elo": None if ahead is None else round(ahead[1], 1),
            "won": leads.count(1),
            "drawn": leads.count(0),
            "lost": leads.count(-1),
            "goals": goals,
            "stopped_players": stopped,
        }
