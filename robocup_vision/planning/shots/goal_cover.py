"""Where one robot covers a whole goal: between the ball and the goal, so near to the ball that nothing is open."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.geometry import wrap_angle
from robocup_vision.planning.gaps.gap import Point


@dataclass(frozen=True, slots=True)
class Cover:
    """A place to block a goal from.

    Parameters
    ----------
    place_m : (float, float)
        For the middle of who blocks.
    open_rad : float
        Angle under which the ball sees the goal's mouth.
    """

    place_m: Point
    open_rad: float


def cover_goal(ball: Point, posts_m: tuple[Point, Point], reach_m: float, room_m: float) -> Cover:
    """Choose the place farthest from a ball from where nothing of a goal is open to it.

    Both lines from the ball to the posts touch the circle around the place, which is on the line that halves the angle
    between them. A goal that is wider than can be covered is covered in the middle.

    Parameters
    ----------
    ball : (float, float)
        Where it is.
    posts_m : ((float, float), (float, float))
        Inner edges of the goal's posts.
    reach_m : float
        How near a ball passes to the middle of who blocks: both radii.
    room_m : float
        How far at least to stay away from the ball's nearest place to it.

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
