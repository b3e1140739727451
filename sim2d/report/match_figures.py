"""Collects the figures of a match (score, possession, figures of each robot), and makes match.json of them.

match.json does not depend on date and machine: for the same seed it has the same bytes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sim2d.report.robot_figures import FaultFigures, RobotFigures, RobotLog
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.sensors.faults import BodyFault, Fault
from sim2d.world.state import Event, RobotMoment, WorldState

# a robot has the ball if no other robot is nearer to it and the gap between them is at most this
_REACH_M = 0.05
# decimals: more than any figure is accurate to, fewer than those in which processors differ
_DIGITS = 6


@dataclass(frozen=True, slots=True)
class MatchFigures:
    """The figures of a match so far."""

    #: Time played.
    seconds: float
    #: Goals of the side that attacks the goal at +x, and of the other.
    score: tuple[int, int]
    #: Time and scoring side, +1 or -1, of each goal.
    goals: tuple[tuple[float, int], ...]
    #: Fraction of each side in the time in which any robot had the ball; None if none ever had it.
    possession: tuple[float | None, float | None]
    #: Robots in order of their index.
    robots: tuple[RobotFigures, ...]
    #: Faults in order of their robots.
    faults: tuple[FaultFigures, ...]


class MatchLog:
    """Collects the figures of a match while it is played."""

    def __init__(self, state: WorldState, limits: RobotLimits, ball_radius_m: float, faults: Sequence[Fault]) -> None:
        self._reach_m = limits.radius_m + ball_radius_m + _REACH_M
        self._robots = [
            RobotLog(r.index, r.side, r.number, limits.acceleration_mps2, [f for f in faults if f.robot == r.index])
            for r in state.robots
        ]
        self._carried = sorted((f.at_s, f.robot) for f in faults if isinstance(f, BodyFault) and f.carry_to is not None)
        self._score = state.score
        self._goals: list[tuple[float, int]] = []
        self._had_ball = {1: 0, -1: 0}
        self._periods = 0

    def add(self, state: WorldState, robots: Sequence[RobotMoment]) -> None:
        """Add a control period: the true state when the senses were measured, and each robot's response."""
        while self._carried and self._carried[0][0] <= state.t_s + CONTROL_PERIOD_S / 2:
            self._robots[self._carried.pop(0)[1]].put_down()
        has_ball = self._holder(state)
        if has_ball is not None:
            self._had_ball[state.robots[has_ball].side] += 1
        for robot, truth, log in zip(robots, state.robots, self._robots, strict=True):
            if robot.stopped and log.stopped_s is None:
                log.stopped_s, log.stopped_reason = state.t_s, robot.stopped
            log.add(state.t_s, truth.pose, robot.status.pose, robot.command, truth.index == has_ball)
            log.add_calibration(state.t_s, robot.status.calibration)
        self._periods += 1

    def add_events(self, after: WorldState) -> None:
        """Add the events of the control period that followed."""
        self._score = after.score
        for event in after.events:
            self._add_event(event)

    def _add_event(self, event: Event) -> None:
        if event.kind == "goal":
            self._goals.append((event.t_s, event.side))
        for index in event.robots:
            log = self._robots[index]
            if event.kind == "kick":
                log.kicks += 1
            elif event.kind == "collision" and len(event.robots) > 1:
                log.collisions += 1
            elif event.kind == "collision":
                log.wall_contacts += 1
            elif event.kind == "carried_back":
                log.put_down()

    def _holder(self, state: WorldState) -> int | None:
        if state.ball is None:
            return None
        x_m, y_m = state.ball.x_m, state.ball.y_m
        distance_m, index = min(
            (math.hypot(robot.pose.x_m - x_m, robot.pose.y_m - y_m), robot.index) for robot in state.robots
        )
        return index if distance_m <= self._reach_m else None

    @property
    def figures(self) -> MatchFigures:
        """The figures so far."""
        total = sum(self._had_ball.values())
        possession = (self._had_ball[1] / total, self._had_ball[-1] / total) if total else (None, None)
        return MatchFigures(
            self._periods * CONTROL_PERIOD_S,
            self._score,
            tuple(self._goals),
            possession,
            tuple(log.figures for log in self._robots),
            tuple(fault for log in self._robots for fault in log.fault_figures),
        )


def match_json(
    field: str,
    players: int,
    seed: int,
    figures: MatchFigures,
    ours: str = "plain",
    theirs: str = "plain",
    disturbances: Sequence[str] = (),
) -> dict[str, Any]:
    """Return a match as JSON values.

    Parameters
    ----------
    ours, theirs : str
        Names of the players of the side that attacks +x, and of the other.
    """
    values = dataclasses.asdict(figures)
    values["goals"] = [{"t_s": t_s, "side": side} for t_s, side in figures.goals]
    head = {"format": 1, "field": field, "players": players, "ours": ours, "theirs": theirs, "seed": seed}
    plain: dict[str, Any] = _plain({**head, "disturbances": list(disturbances), **values})
    return plain


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        # a fault without an end ends at infinity, which JSON cannot hold
        return round(value, _DIGITS) if math.isfinite(value) else None
    return value
