"""What robots know of themselves and the ball in a match, against the truth, counted over its control periods."""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from time import process_time
from typing import Any

from robocup_vision.geometry import Pose2
from sim2d.match.run import MatchPlan
from sim2d.report.match_figures import MatchFigures
from sim2d.robot_link import CONTROL_PERIOD_S
from sim2d.world.state import Moment

SETTLED_S = 2.0
KNOWN_M, STANDS_M, STANDS_S = 0.20, 0.05, 3.0


def count_failed(figures: MatchFigures) -> int:
    """Return how many players of a match were stopped; say on stderr which, and why.

    A stopped player's robot stands still, and the figures go on: such a benchmark is not ok, whatever they say.
    """
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


@dataclass(frozen=True)
class Bound:
    """Greatest error of a pose that still counts as near the truth."""

    away_m: float
    turned_rad: float

    def holds(self, pose: Pose2 | None, truth: Pose2) -> bool:
        """Tell whether a pose is near the truth; none is not."""
        if pose is None:
            return False
        away_m, turned_rad = pose.error_to(truth)
        return away_m < self.away_m and turned_rad < self.turned_rad

    def __str__(self) -> str:
        return f"{100 * self.away_m:g} cm, {math.degrees(self.turned_rad):g} deg"


BOUNDS = {
    "ssl_2001": Bound(0.03, math.radians(3.0)),
    "four_legged_2007": Bound(0.10, math.radians(5.0)),
    "ssl_division_b": Bound(0.15, math.radians(5.0)),
    "msl_18x12": Bound(0.15, math.radians(5.0)),
    "spl_2020": Bound(0.15, math.radians(5.0)),
}


@dataclass
class Played:
    """What is counted over a match, or several: control periods of robots, but for what says otherwise."""

    periods: int = 0
    near: int = 0
    settled: int = 0
    right_half: int = 0
    lost_s: float = 0.0
    goals: int = 0
    contacts: int = 0
    in_play: int = 0
    knows_ball: int = 0
    could_move: int = 0
    stands: int = 0
    stopped: int = 0
    seconds: float = 0.0
    spent_s: float = 0.0

    @classmethod
    def together(cls, parts: Sequence[Played]) -> Played:
        """Add up the counts of matches; the longest time lost is that of any."""
        total = cls(**{f.name: sum(getattr(part, f.name) for part in parts) for f in fields(cls)})
        total.lost_s = max(part.lost_s for part in parts)
        return total


@dataclass
class Moves:
    """Where a robot was in the last seconds of play."""

    places: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=round(STANDS_S / CONTROL_PERIOD_S)))

    def update(self, moment: Moment, index: int, played: Played) -> None:
        """Count whether a robot knows the ball, and whether it stands."""
        state = moment.state
        if state.phase != "play" or state.ball is None:
            self.places.clear()
            return
        truth, known = state.robots[index], moment.robots[index].status.ball_in_field
        place = (truth.pose.x_m, truth.pose.y_m)
        played.in_play += 1
        played.knows_ball += known is not None and math.dist(known, (state.ball.x_m, state.ball.y_m)) < KNOWN_M
        if len(self.places) == self.places.maxlen and truth.number > 0:
            played.could_move += 1
            played.stands += math.dist(self.places[0], place) < STANDS_M
        self.places.append(place)


def play(plan: MatchPlan, bound: Bound) -> Played:
    """Play a match, and count; estimates within the bound are near the truth."""
    played = Played()
    match = plan.begin()
    lost_s = [0.0] * len(match.arena.state.robots)
    moves = [Moves() for _ in lost_s]
    began = process_time()
    for moment in match.play(plan.seconds):
        for index, (robot, truth) in enumerate(zip(moment.robots, moment.state.robots, strict=True)):
            played.periods += 1
            moves[index].update(moment, index, played)
            pose = robot.status.pose.pose if robot.status.pose else None
            is_near = bound.holds(pose, truth.pose)
            if pose and moment.state.t_s > SETTLED_S:
                played.settled += 1
                played.right_half += sum(pose.error_to(truth.pose)) < sum(pose.half_turn().error_to(truth.pose))
            played.near += is_near
            lost_s[index] = 0.0 if is_near else lost_s[index] + CONTROL_PERIOD_S
            played.lost_s = max(played.lost_s, lost_s[index])
    played.spent_s = process_time() - began
    played.seconds = match.figures.seconds
    played.goals = sum(match.figures.score)
    played.contacts = sum(robot.collisions for robot in match.figures.robots)
    played.stopped = count_failed(match.figures)
    return played
