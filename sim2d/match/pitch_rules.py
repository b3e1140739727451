"""What the small-size league's rules say of places: where the ball is out or in a goal, where and how a match goes on.

What a referee decides by geometry alone, apart from what it remembers of a match.
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
# a free kick's distance from lines and defence areas, and a goal kick's from its goal line
_CLEAR_M, _GOAL_KICK_M = 0.2, 1.0


@dataclass(frozen=True, slots=True)
class DefenceArea:
    """The rectangle before each goal in which the keeper alone may touch the ball: its size, metres."""

    depth_m: float
    width_m: float
    line_x_m: float

    def holds(self, side: int, x_m: float, y_m: float, room_m: float = 0.0) -> bool:
        """Tell whether a place is in the area before the goal at +x (side 1) or -x, or nearer to it than a room."""
        return side * x_m > self.line_x_m - self.depth_m - room_m and abs(y_m) < self.width_m / 2 + room_m


def defence_area(field: Field) -> DefenceArea | None:
    """Return the size of a field's defence areas, the largest rectangle before each goal; None if it has none."""
    half = field.length_m / 2
    fronts = [row for row in field.lines.tolist() if row[0] == row[2] and 1e-9 < row[0] < half - 1e-9]
    if not fronts:
        return None
    x, y0, _, y1 = min(fronts, key=lambda row: row[0])
    return DefenceArea(half - x, abs(y1 - y0), half)


Restart = Literal["kick_off", "free_kick", "penalty", "force_start"]
FoulKind = Literal["fast_in_stop", "near_ball", "fast_ball", "double_touch", "own_area", "their_area"]


def is_division_a(field: Field) -> bool:
    """Return whether a field is of division A, whose fields are 12 m long; those of division B are 9 m long."""
    return field.length_m > 10.5


def kick_time_s(field: Field) -> float:
    """Return how long a team may take for a kick: five seconds on division A, else ten."""
    return 5.0 if is_division_a(field) else 10.0


def penalty_mark(field: Field, side: int) -> Point:
    """Return where the ball lies at a penalty of side +1, which attacks the goal at +x, or -1."""
    # six metres before the goal that is shot at on division B, eight on A: two thirds of the field
    return (-side * field.length_m / 6, 0.0)


class NextPlay(NamedTuple):
    """How a match goes on: by what, whose turn it is (0: nobody's), and where the ball lies then."""

    kind: Restart
    side: int
    place_m: Point


class PitchRules:
    """The rules of one field's places."""

    def __init__(self, field: Field, robot_radius_m: float) -> None:
        self._field, self._radius_m = field, robot_radius_m
        self.area = defence_area(field)

    def after_foul(self, side: int, kind: FoulKind, ball: BallState) -> NextPlay:
        """Return how it goes on after a side's foul at the ball."""
        if kind in _FREE_KICK_OF:
            return NextPlay("free_kick", -side, self.legal_place((ball.x_m, ball.y_m)))
        return NextPlay("penalty", -side, penalty_mark(self._field, -side))

    def after_out(self, last_side: int, ball: BallState) -> NextPlay:
        """Return how it goes on after a side was the last to touch a ball that is out."""
        half_x, half_y = self._field.length_m / 2, self._field.width_m / 2
        sx, sy = math.copysign(1.0, ball.x_m), math.copysign(1.0, ball.y_m)
        if abs(ball.x_m) > half_x:
            # over the goal line: a corner kick if its defenders touched it last, else a goal kick
            back_m = _CLEAR_M if sx == -last_side else _GOAL_KICK_M
            return NextPlay("free_kick", -last_side, (sx * (half_x - back_m), sy * (half_y - _CLEAR_M)))
        return NextPlay("free_kick", -last_side, self.legal_place((ball.x_m, sy * half_y)))

    def legal_place(self, place: Point) -> Point:
        """Return the nearest place for a free kick: clear of the lines and of the defence areas."""
        limit_x, limit_y = self._field.length_m / 2 - _CLEAR_M, self._field.width_m / 2 - _CLEAR_M
        x, y = max(-limit_x, min(limit_x, place[0])), max(-limit_y, min(limit_y, place[1]))
        area = self.area
        if area is not None and area.holds(1 if x > 0 else -1, x, y, _CLEAR_M + self._radius_m):
            x = math.copysign(area.line_x_m - area.depth_m - _CLEAR_M - 2 * self._radius_m, x)
        return x, y

    def is_ready_for_kick_off(self, kicking_side: int, robots: Sequence[RobotState]) -> bool:
        """Return whether all stand in their own half, and those of the other side outside the centre circle."""
        circle_m, slack_m = center_circle_radius_m(self._field), self._radius_m
        for robot in robots:
            near = math.hypot(robot.pose.x_m, robot.pose.y_m) < circle_m
            if robot.side == kicking_side and near:
                continue
            if robot.side * robot.pose.x_m > slack_m or near:
                return False
        return True

    def goal_of(self, ball: BallState) -> int:
        """Return the side of the goal that the ball is in; 0 if it is in none."""
        for goal in self._field.goals:
            beyond = goal.side * (ball.x_m - goal.line_x_m)
            if beyond > self._field.ball_radius_m and abs(ball.y_m) < goal.width_m / 2 and ball.z_m < goal.height_m:
                return goal.side
        return 0

    def is_out(self, ball: BallState) -> bool:
        """Return whether the whole ball has left the field."""
        radius = self._field.ball_radius_m
        return abs(ball.x_m) > self._field.length_m / 2 + radius or abs(ball.y_m) > self._field.width_m / 2 + radius
