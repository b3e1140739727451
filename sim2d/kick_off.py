"""Places of robots at a kick-off, for the rules and for the players."""

from __future__ import annotations

import math

from field_models import Field
from robocup_vision.geometry import Pose2

_FREE_ROOM = 1.5  # distance of a robot's centre from goal line and centre circle, in robot radii


def center_circle_radius_m(field: Field) -> float:
    """Radius of the circle around the ball at a kick-off, metres; a tenth of the field's length if none is painted."""
    painted = [float(r) for x, y, r, _, sweep in field.arcs if x == y == 0 and abs(sweep) > 6.28]
    return painted[0] if painted else field.length_m / 10


def kick_off_pose(field: Field, attacks: int, number: int, players: int, radius_m: float | None = None) -> Pose2:
    """Return the pose of a robot at a kick-off, field frame.

    Parameters
    ----------
    attacks : int
        +1: the opponent's goal is at +x; -1: at -x.
    number, players : int
        The robot's number within its side, and the number of robots of that side. Of several, 0 stands in its goal.
    radius_m : float, optional
        Radius of the robot; default: that of the league's robots.
    """
    radius = field.robot_radius_m if radius_m is None else radius_m
    heading = 0.0 if attacks > 0 else math.pi
    if number == 0 and players > 1:
        return Pose2(-attacks * (field.length_m / 2 - _FREE_ROOM * radius), 0.0, heading)
    depth_m = center_circle_radius_m(field) + _FREE_ROOM * radius
    outfield = max(players - 1, 1)
    step_m = (field.width_m / 2 - 2 * radius) / max(outfield, 2) if outfield > 1 else 0.0
    aside_m = _off_middle(number) * 2 * step_m
    limit_m = field.width_m / 2 - 2 * radius
    return Pose2(-attacks * depth_m, attacks * max(-limit_m, min(limit_m, aside_m)), heading)


def kick_off_row(number: int, players: int) -> int:
    """Return a field player's place in its team's row at a kick-off: 0, 1, ... from its own right."""
    return _off_middle(number) + max(players - 2, 0) // 2


def _off_middle(number: int) -> int:
    """Return the number of places to the left of the middle: robot 1 is in the middle, the others alternate."""
    place = max(number - 1, 0)
    return (place + 1) // 2 * (1 if place % 2 else -1)
