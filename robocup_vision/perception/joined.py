"""Fusion of what several cameras on one body show: free floor all around, and one entry for each ball and obstacle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2, turned_covariance, wrap_angle
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.perception.kinds.network import Kind
from robocup_vision.perception.obstacles import Obstacle

Thing = TypeVar("Thing")

# chi-square with 2 degrees of freedom: gate at 99 % for two places of one ball
_MAX_SAME_DISTANCE2 = 9.21
# least variance of a ball's place, (5 mm)^2
_MIN_SPREAD = 0.005**2 * np.eye(2)
# relative error of an obstacle's range
_RANGE_ERROR = 0.1


class SeenFloor(NamedTuple):
    """Free space of one camera, robot frame, and the nearest and farthest range at which it sees the floor, (J,)."""

    free_space: FreeSpace
    nearest_m: FloatArray
    farthest_m: FloatArray


def join_free_space(floors: Sequence[SeenFloor], directions: int) -> FreeSpace:
    """Return the free space all around.

    Parameters
    ----------
    floors : sequence of SeenFloor
        One for each camera; their bearings are no farther apart than the result's.
    directions : int
        Number J of the result's directions over a whole turn.

    Returns
    -------
    FreeSpace
        In each direction the range to the nearest obstacle of any camera, or else the farthest view; NaN if no camera
        sees the floor. If the nearest floor of a camera's view is blocked, the obstacle's range is unknown to it, and
        a camera with a nearer view decides. The border of a picture counts only where no other camera sees.
    """
    step = math.tau / directions
    middle = (np.arange(directions) + 0.5) * step - math.pi
    from_m, blocked_m, seen_m = np.full(directions, np.inf), np.full(directions, np.inf), np.full(directions, -np.inf)
    whole = np.zeros(directions, dtype=np.bool_)
    kept = []
    for floor, nearest_m, farthest_m in floors:
        bearing_rad, ranges_m = floor.bearing_rad, floor.range_m
        known = np.isfinite(ranges_m) & np.isfinite(nearest_m)
        index = np.floor((bearing_rad + math.pi) / step).astype(np.int64) % directions
        # cells at the border of a picture are seen in part, and the part changes as the body sways
        is_rim = np.zeros(len(index), dtype=np.bool_)
        is_rim[[0, -1]] = True
        whole[index[known & ~is_rim]] = True
        kept.append((index, nearest_m, ranges_m, ranges_m < farthest_m, known, is_rim))
    bounded = []
    for index, nearest, ranges, is_blocked, known, is_rim in kept:
        counts = known & ~(is_rim & whole[index])
        bounded.append((index[counts], nearest[counts], ranges[counts], is_blocked[counts]))
        np.minimum.at(from_m, index[counts], nearest[counts])
    for index, nearest, ranges, is_blocked in bounded:
        least = np.where(nearest > from_m[index], np.maximum(ranges, nearest), ranges)
        np.minimum.at(blocked_m, index[is_blocked], least[is_blocked])
        np.maximum.at(seen_m, index, least)
    range_m = np.minimum(blocked_m, seen_m)
    range_m[np.isinf(range_m)] = np.nan
    return FreeSpace(np.asarray(middle), range_m)


def move_ball(ball: Ball, robot: Pose2) -> Ball:
    """Return a ball in the frame of a robot that has moved to `robot`, given in its previous frame."""
    motion = robot.inverse()
    x, y = motion.transform((ball.x_m, ball.y_m)).tolist()
    return replace(ball, x_m=x, y_m=y, covariance=turned_covariance(ball.covariance, motion.theta_rad))


def join_balls(seen: Sequence[Sequence[Ball]]) -> tuple[Ball, ...]:
    """Return the balls of several cameras, one entry for each, the most likely first.

    Parameters
    ----------
    seen : sequence of sequence of Ball
        Balls of each camera, robot frame. The pixel of a joined ball is that of its most likely sighting.
    """
    return tuple(
        _joined(
            seen,
            lambda ball: (-ball.log_likelihood_ratio,),
            lambda one, other: _distance2(one, other) <= _MAX_SAME_DISTANCE2,
            _joined_ball,
        )
    )


def _joined(
    seen: Sequence[Sequence[Thing]],
    order: Callable[[Thing], tuple[float, ...]],
    are_one: Callable[[Thing, Thing], bool],
    join: Callable[[Thing, Thing], Thing],
) -> list[Thing]:
    """Join each sighting, in an order, with the first earlier one of the same object from another camera."""
    joined: list[tuple[Thing, set[int]]] = []
    sightings = [(one, number) for number, things in enumerate(seen) for one in things]
    for one, number in sorted(sightings, key=lambda sighting: order(sighting[0])):
        for index, (other, cameras) in enumerate(joined):
            if number not in cameras and are_one(one, other):
                joined[index] = join(other, one), cameras | {number}
                break
        else:
            joined.append((one, {number}))
    return [one for one, _ in joined]


def _distance2(one: Ball, other: Ball) -> float:
    offset = np.array([one.x_m - other.x_m, one.y_m - other.y_m])
    spread = one.covariance + other.covariance + 2 * _MIN_SPREAD
    return float(offset @ np.linalg.solve(spread, offset))


def _joined_ball(one: Ball, other: Ball) -> Ball:
    mine, its = one.covariance + _MIN_SPREAD, other.covariance + _MIN_SPREAD
    gain = np.linalg.solve(mine + its, mine).T
    x, y = (gain @ [other.x_m - one.x_m, other.y_m - one.y_m]).tolist()
    covariance = mine - gain @ mine
    return replace(one, x_m=one.x_m + x, y_m=one.y_m + y, covariance=(covariance + covariance.T) / 2)


def move_obstacle(obstacle: Obstacle, robot: Pose2) -> Obstacle:
    """Return an obstacle in the frame of a robot that has moved to `robot`, given in its previous frame."""
    x, y = robot.inverse().transform((obstacle.x_m, obstacle.y_m)).tolist()
    return replace(obstacle, x_m=x, y_m=y, bearing_rad=math.atan2(y, x), range_m=math.hypot(x, y))


def join_obstacles(seen: Sequence[Sequence[Obstacle]], radius_m: float) -> tuple[Obstacle, ...]:
    """Return the obstacles of several cameras, one entry for each, the nearest first.

    Two sightings belong together if their bearings overlap and their ranges differ by at most a robot's radius plus a
    tenth. The result extends over both, because a picture's border may cut an obstacle.

    Parameters
    ----------
    seen : sequence of sequence of Obstacle
        Obstacles of each camera, robot frame.
    """
    joined = _joined(
        seen,
        lambda obstacle: (obstacle.range_m, obstacle.bearing_rad),
        lambda one, other: _are_one(one, other, radius_m),
        _joined_obstacle,
    )
    return tuple(sorted(joined, key=lambda one: one.range_m))


def _ends(obstacle: Obstacle, about_rad: float) -> tuple[float, float]:
    """Return its right and left end as bearings relative to a direction."""
    right, left = obstacle.interval_rad
    turned = wrap_angle(obstacle.bearing_rad - about_rad) - obstacle.bearing_rad
    return right + turned, left + turned


def _are_one(one: Obstacle, other: Obstacle, radius_m: float) -> bool:
    if abs(one.range_m - other.range_m) > radius_m + _RANGE_ERROR * max(one.range_m, other.range_m):
        return False
    (right, left), (its_right, its_left) = _ends(one, one.bearing_rad), _ends(other, one.bearing_rad)
    return right <= its_left and its_right <= left


def _joined_obstacle(one: Obstacle, other: Obstacle) -> Obstacle:
    (right, left), (its_right, its_left) = _ends(one, one.bearing_rad), _ends(other, one.bearing_rad)
    right, left = min(right, its_right), max(left, its_left)
    half, range_m = min(0.5 * (left - right), 1.5), 0.5 * (one.range_m + other.range_m)
    bearing = wrap_angle(one.bearing_rad + 0.5 * (left + right))
    x, y = range_m * math.cos(bearing), range_m * math.sin(bearing)
    width_m = 2.0 * range_m * math.tan(half)
    hue = other.hue_rad if one.hue_rad is None else one.hue_rad
    return replace(
        one,
        x_m=x,
        y_m=y,
        width_m=width_m,
        bearing_rad=bearing,
        range_m=range_m,
        hue_rad=hue,
        kind_teller=lambda: _joined_kind(one, other),
    )


def _joined_kind(one: Obstacle, other: Obstacle) -> Kind | None:
    """Return the kind that one of them or both have; None if they contradict each other."""
    kinds = {kind for kind in (one.kind, other.kind) if kind is not None}
    return kinds.pop() if len(kinds) == 1 else None
