"""Players that failed in a benchmark's matches: a robot whose player was stopped stands still, and the figures go on.

A benchmark with such a player is not ok, whatever its figures say.
"""

from __future__ import annotations

import sys
from typing import Any

from sim2d.report.match_figures import MatchFigures


def count_failed(figures: MatchFigures) -> int:
    """Return how many players of a match were stopped; say on stderr which, and why."""
    failed = [(r.robot, r.stopped_s, r.stopped_reason) for r in figures.robots if r.stopped_s is not None]
    return _tell(failed)


def count_failed_in(match: dict[str, Any]) -> int:
    """Return the same of a match.json."""
    robots = match["robots"]
    return _tell([(r["robot"], r["stopped_s"], r["stopped_reason"]) for r in robots if r["stopped_s"] is not None])


def _tell(failed: list[tuple[int, float, str]]) -> int:
    for robot, stopped_s, reason in failed:
        print(f"the player of robot {robot} failed at {stopped_s:.1f} s: {reason}", file=sys.stderr)
    return len(failed)
