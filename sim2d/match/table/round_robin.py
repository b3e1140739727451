"""A tournament in which every player meets every other: its matches, and the table of its results.

Each pair of players meets on some seeds, twice on each, with sides changed between the two: neither the side nor what
chance gives it favours a player.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from field_models.errors import ArgumentError
from sim2d.match.run import MatchPlan
from sim2d.match.table.ratings import Ratings, RatingSettings, rate_players
from sim2d.match.tournament import plan_json
from sim2d.robot_link import PlayerFactory


@dataclass(frozen=True, slots=True)
class RoundRobin:
    """Who meets whom.

    Raises
    ------
    ArgumentError
        If there are fewer than two players, two have one name, or the number of matches is not even.
    """

    #: Of every match, but for its players; its seed is that of the first two matches of each pair.
    plan: MatchPlan
    #: The players and their names.
    players: tuple[tuple[str, PlayerFactory], ...]
    #: Of each pair, an even number: two on each seed.
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
        """Indices of the players of each match: which attacks the goal at +x, and which the other.

        All pairs meet on one seed before the next seed: an interrupted tournament has played all pairs about equally
        often, and a longer one begins with the same matches.
        """
        pairs = list(combinations(range(len(self.players)), 2))
        return [sides for _ in range(self.matches // 2) for a, b in pairs for sides in ((a, b), (b, a))]

    @property
    def plans(self) -> list[MatchPlan]:
        """The match of each meeting."""
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
        """Return as JSON values what the matches depend on, besides their number."""
        values = {key: value for key, value in plan_json(self.plan).items() if key not in ("ours", "theirs")}
        return {**values, "table": list(self.names)}

    def table_json(
        self, results: Sequence[dict[str, Any]], settings: RatingSettings = RatingSettings()
    ) -> dict[str, Any]:
        """Return the table as JSON values: a row for each player, the best first.

        Parameters
        ----------
        results : sequence of dict
            What stands in the match.json of each match, in the order of `plans`.
        """
        ratings = rate_players(self._points(results), settings)
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
