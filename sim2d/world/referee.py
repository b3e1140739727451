"""Applies the rules: goals, kick-offs, a ball that is out or lies still, robots that leave the field."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from field_models import Field
from sim2d.kick_off import center_circle_radius_m
from sim2d.robot_link import Phase, RobotLimits
from sim2d.world.state import BallState, Event, RobotState

# Shortest duration of a kick-off, so that all players notice it.
_MIN_KICK_OFF_S = 1.0
# A ball that stays within this distance for this time is put elsewhere, because no robot can reach it.
_STILL_S = 10.0
_STILL_WAY_M = 0.05
# Distance beyond the floor from which a robot is carried back.
_ASTRAY_M = 0.5
# Least distance by which a ball that lay still is moved.
_DROP_WAY_M = 0.2


@dataclass(frozen=True, slots=True)
class Ruling:
    """One decision: the event announced, and where the ball or a robot (index, x, y) is put (None: stays)."""

    event: Event | None
    ball_at: tuple[float, float] | None = None
    robot_at: tuple[int, float, float] | None = None


class MatchReferee(Protocol):
    """Judges a match: `Referee`, or a replacement."""

    @property
    def phase(self) -> Phase:
        """The phase that players are told."""

    @property
    def kick_off_side(self) -> int:
        """The side whose turn it is, +1 or -1."""

    @property
    def score(self) -> dict[int, int]:
        """Goals of each side."""

    @property
    def placement_m(self) -> tuple[float, float] | None:
        """Where the ball is to be placed; None if it is not."""

    def judge(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        """Return the rulings after a control period."""


RefereeFactory = Callable[[Field, RobotLimits], MatchReferee]


class Referee:
    """Applies simple rules to one match: there are kick-offs, and a ball that is out is put back at once."""

    def __init__(self, field: Field, limits: RobotLimits) -> None:
        self._field, self._limits = field, limits
        self.score = {1: 0, -1: 0}
        self.phase: Phase = "kick_off"
        self.kick_off_side = 1
        self.placement_m: tuple[float, float] | None = None
        self._reach_x_m: float
        self._reach_y_m: float
        self._reach_x_m, self._reach_y_m = (np.abs(field.floor_polygon).max(axis=0) + _ASTRAY_M).tolist()
        # time to drive back across the field
        self._max_kick_off_s = 2.0 + 1.5 * field.length_m / limits.speed_mps
        self._since_s = 0.0
        self._still = (math.inf, math.inf, 0.0)

    def judge(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        """Return the rulings after a control period."""
        rulings = [self._carry_back(t_s, robot) for robot in robots if self._is_astray(robot)]
        if self.phase == "kick_off":
            waited = t_s - self._since_s
            ready = waited >= _MIN_KICK_OFF_S and all(self._is_home(robot) for robot in robots)
            if not ready and waited < self._max_kick_off_s:
                # the ball is held at the centre
                if math.hypot(ball.x_m, ball.y_m) > 1e-9:
                    rulings.append(Ruling(None, (0.0, 0.0)))
                return rulings
            self.phase = "play"
            self._still = (math.inf, math.inf, t_s)
            rulings.append(Ruling(Event(t_s, "whistle"), (0.0, 0.0)))
            return rulings
        scored = self.goal_side(ball)
        if scored:
            self.score[scored] += 1
            self.phase, self.kick_off_side, self._since_s = "kick_off", -scored, t_s
            return [*rulings, Ruling(Event(t_s, "goal", side=scored), (0.0, 0.0))]
        if self._is_out(ball):
            self._still = (math.inf, math.inf, t_s)
            return [*rulings, Ruling(Event(t_s, "ball_out"), self._free_place(self._throw_in(ball), robots))]
        x, y, since = self._still
        if math.hypot(ball.x_m - x, ball.y_m - y) > _STILL_WAY_M:
            self._still = (ball.x_m, ball.y_m, t_s)
        elif t_s - since > _STILL_S:
            self._still = (math.inf, math.inf, t_s)
            return [*rulings, Ruling(Event(t_s, "drop"), self._free_place(self._neutral_place(ball), robots))]
        return rulings

    def goal_side(self, ball: BallState) -> int:
        """Return the side whose target goal the whole ball is in (behind the line, between the posts), else 0."""
        for goal in self._field.goals:
            beyond = goal.side * (ball.x_m - goal.line_x_m)
            if self._field.ball_radius_m < beyond <= max(goal.depth_m, 0.5) and abs(ball.y_m) < goal.width_m / 2:
                return goal.side
        return 0

    def _is_home(self, robot: RobotState) -> bool:
        """Whether it stands in its own half and, unless its side kicks off, outside the centre circle."""
        depth = -robot.side * robot.pose.x_m
        if depth < 0:
            return False
        if robot.side == self.kick_off_side:
            return True
        return math.hypot(robot.pose.x_m, robot.pose.y_m) > center_circle_radius_m(self._field)

    def _is_out(self, ball: BallState) -> bool:
        if self._field.boundary == "walls":
            return False
        x, y = self._field.length_m / 2, self._field.width_m / 2
        radius = self._field.ball_radius_m
        return abs(ball.x_m) > x + radius or abs(ball.y_m) > y + radius

    def _throw_in(self, ball: BallState) -> tuple[float, float]:
        """Return a place inside the crossed line, with room for a robot behind the ball, and beside the goal."""
        inset = 3 * self._limits.radius_m
        x, y = self._field.length_m / 2 - inset, self._field.width_m / 2 - inset
        by, bx = max(-y, min(y, ball.y_m)), max(-x, min(x, ball.x_m))
        if abs(ball.x_m) > self._field.length_m / 2 and self._field.goals:
            by = math.copysign(min(max(abs(by), self._field.goals[0].width_m / 2 + inset), y), by)
        return bx, by

    def _neutral_place(self, ball: BallState) -> tuple[float, float]:
        x, y = self._field.length_m / 4, self._field.width_m / 4
        places = [(0.0, 0.0), *((sx * x, sy * y) for sx in (1, -1) for sy in (1, -1))]
        # the nearest place, but not where the ball lies
        away_m = [(math.hypot(ball.x_m - place[0], ball.y_m - place[1]), place) for place in places]
        return min((far for far in away_m if far[0] > _DROP_WAY_M), key=lambda far: far[0])[1]

    def _free_place(self, wanted: tuple[float, float], robots: Sequence[RobotState]) -> tuple[float, float]:
        """Return the point nearest to the wanted one, going towards the field's centre, that no robot stands on."""
        room = self._limits.radius_m + 2 * self._field.ball_radius_m
        for part in range(21):
            x, y = wanted[0] * (1 - part / 20), wanted[1] * (1 - part / 20)
            if all(math.hypot(r.pose.x_m - x, r.pose.y_m - y) > room for r in robots):
                return x, y
        return wanted

    def _is_astray(self, robot: RobotState) -> bool:
        return abs(robot.pose.x_m) > self._reach_x_m or abs(robot.pose.y_m) > self._reach_y_m

    def _carry_back(self, t_s: float, robot: RobotState) -> Ruling:
        x, y = self._field.length_m / 2, self._field.width_m / 2
        place = max(-x, min(x, robot.pose.x_m)), max(-y, min(y, robot.pose.y_m))
        return Ruling(Event(t_s, "carried_back", (robot.index,)), robot_at=(robot.index, *place))
