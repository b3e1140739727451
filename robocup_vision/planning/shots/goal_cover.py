"""Finds the place between ball and goal from where one robot covers the whole goal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.geometry import wrap_angle
from robocup_vision.planning.gaps.gap import Point


@dataclass(frozen=True, slots=True)
class Cover:
    """A place to block a goal from."""

    place_m: Point  #: for the centre of the robot that blocks
    open_rad: float  #: angle of the goal's mouth at the ball


def cover_goal(ball: Point, posts_m: tuple[Point, Point], reach_m: float, room_m: float) -> Cover:
    """Choose the place farthest from the ball at which a robot covers the whole goal.

    The place is on the bisector of the angle between the lines from the ball to the posts; both lines touch the circle
    around it. Of a goal that is too wide the middle is covered.

    Parameters
    ----------
    posts_m : ((float, float), (float, float))
        Inner edges of the goal's posts.
    reach_m : float
        Distance at which a ball passes the robot's centre: the sum of both radii.
    room_m : float
        Distance to keep between ball and robot, at least.

    Raises
    ------
    ArgumentError
        If `reach_m` is not positive or `room_m` is negative.
    """
    if not (math.isfinite(reach_m) and reach_m > 0.0):
        raise ArgumentError(f"reach_m must be positive, got {reach_m!r}")
    if not (math.isfinite(room_m) and room_m >= 0.0):
        raise ArgumentError(f"room_m must not be negative, got {room_m!r}")
    first, second = (math.atan2(post[1] - ball[1], post[0] - ball[0]) for post in posts_m)
    open_rad = wrap_angle(second - first)
    half, middle = abs(open_rad) / 2, first + open_rad / 2
    away_m = max(reach_m / max(math.sin(half), 1e-9), reach_m + room_m)
    return Cover((ball[0] + away_m * math.cos(middle), ball[1] + away_m * math.sin(middle)), 2 * half)
