"""The small-size league's rules on places: when the ball is out or in a goal, and where and how a match goes on.

These decisions depend only on geometry, not on the course of the match.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from field_models import Field
from sim2d.kick_off import center_circle_radius_m
from sim2d.robot_link import Point
from sim2d.world.state import BallState, RobotState

_FREE_KICK_OF: frozenset[FoulKind] = frozenset({"fast_ball", "double_touch", "their_area"})
# distance of a free kick from lines and defence areas, and of a goal kick from its goal line
_CLEAR_M, _GOAL_KICK_M = 0.2, 1.0


@dataclass(frozen=True, slots=True)
class DefenceArea:
    """Size of the rectangle in front of each goal in which only the keeper may touch the ball."""

    depth_m: float
    width_m: float
    line_x_m: float

    def holds(self, side: int, x_m: float, y_m: float, room_m: float = 0.0) -> bool:
        """Return whether a place is in the area at the goal at +x (side 1) or -x (-1), enlarged by `room_m`."""
        return side * x_m > self.line_x_m - self.depth_m - room_m and abs(y_m) < self.width_m / 2 + room_m


def defence_area(field: Field) -> DefenceArea | None:
    """Return a field's defence areas, the largest rectangle in front of each goal; None if there are none."""
    half = field.length_m / 2
    fronts = [row for row in field.lines.tolist() if row[0] == row[2] and 1e-9 < row[0] < half - 1e-9]
    if not fronts:
        return None
    x, y0, _, y1 = min(fronts, key=lambda row: row[0])
    return DefenceArea(half - x, abs(y1 - y0), half)


Restart = Literal["kick_off", "free_kick", "penalty", "force_start"]
FoulKind = Literal["fast_in_stop", "near_ball", "fast_ball", "double_touch", "own_area", "their_area"]


def is_division_a(field: Field) -> bool:
    """Return whether a field is of division A (12 m long; those of division B are 9 m long)."""
    return field.length_m > 10.5


def kick_time_s(field: Field) -> float:
    """Return the time that a team has for a kick: five seconds in division A, else ten."""
    return 5.0 if is_division_a(field) else 10.0


def penalty_mark(field: Field, side: int) -> Point:
    """Return where the ball lies at a penalty of side +1, which attacks the goal at +x, or -1."""
    # two thirds of the field from the target goal: six metres in division B, eight in division A
    return (-side * field.length_m / 6, 0.0)


class NextPlay(NamedTuple):
    """How a match goes on: kind of restart, side whose turn it is (0: neither), and the ball's place, field frame."""

    kind: Restart
    side: int
    place_m: Point


class PitchRules:
    """The rules on places for one field."""

    def __init__(self, field: Field, robot_radius_m: float) -> None:
        self._field, self._radius_m = field, robot_radius_m
        self.area = defence_area(field)

    def after_foul(self, side: int, kind: FoulKind, ball: BallState) -> NextPlay:
        """Return how the match goes on after a foul of a side, with the ball at its present place."""
        if kind in _FREE_KICK_OF:
            return NextPlay("free_kick", -side, self.legal_place((ball.x_m, ball.y_m)))
        return NextPlay("penalty", -side, penalty_mark(self._field, -side))

    def after_out(self, last_side: int, ball: BallState) -> NextPlay:
        """Return how the match goes on if a ball that is out was last touched by a side."""
        half_x, half_y = self._field.length_m / 2, self._field.width_m / 2
        sx, sy = math.copysign(1.0, ball.x_m), math.copysign(1.0, ball.y_m)
        if abs(ball.x_m) > half_x:
            # over the goal line: a corner kick if the defenders touched the ball last, else a goal kick
            back_m = _CLEAR_M if sx == -last_side else _GOAL_KICK_M
            return NextPlay("free_kick", -last_side, (sx * (half_x - back_m), sy * (half_y - _CLEAR_M)))
        return NextPlay("free_kick", -last_side, self.legal_place((ball.x_m, sy * half_y)))

    def legal_place(self, place: Point) -> Point:
        """Return a place for a free kick near `place`, clear of the lines and of the defence areas."""
        limit_x, limit_y = self._field.length_m / 2 - _CLEAR_M, self._field.width_m / 2 - _CLEAR_M
        x, y = max(-limit_x, min(limit_x, place[0])), max(-limit_y, min(limit_y, place[1]))
        area = self.area
        if area is not None and area.holds(1 if x > 0 else -1, x, y, _CLEAR_M + self._radius_m):
            x = math.copysign(area.line_x_m - area.depth_m - _CLEAR_M - 2 * self._radius_m, x)
        return x, y

    def is_ready_for_kick_off(self, kicking_side: int, robots: Sequence[RobotState]) -> bool:
        """Return whether all are in their own half; the kicking side may be in the circle, the other one may not."""
        circle_m, slack_m = center_circle_radius_m(self._field), self._radius_m
        for robot in robots:
            near = math.hypot(robot.pose.x_m, robot.pose.y_m) < circle_m
            if robot.side == kicking_side and near:
                continue
            if robot.side * robot.pose.x_m > slack_m or near:
                return False
        return True

    def goal_of(self, ball: BallState) -> int:
        """Return the side (+1: at +x) of the goal that the whole ball is in; 0 if it is not in a goal."""
        for goal in self._field.goals:
            beyond = goal.side * (ball.x_m - goal.line_x_m)
            if beyond > self._field.ball_radius_m and abs(ball.y_m) < goal.width_m / 2 and ball.z_m < goal.height_m:
                return goal.side
        return 0

    def is_out(self, ball: BallState) -> bool:
        """Return whether the whole ball has left the field."""
        radius = self._field.ball_radius_m
        return abs(ball.x_m) > self._field.length_m / 2 + radius or abs(ball.y_m) > self._field.width_m / 2 + radius
