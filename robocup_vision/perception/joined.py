"""What several cameras on one body show together: free floor all around, one entry for each ball and each thing."""

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

# chi-square with 2 degrees of freedom that one in a hundred pairs of places of one ball exceeds
_MAX_SAME_DISTANCE2 = 9.21
# variance that each ball's place has at least, whatever its frame states: of 5 mm
_MIN_SPREAD = 0.005**2 * np.eye(2)
# error of an obstacle's range, of the range
_RANGE_ERROR = 0.1


class SeenFloor(NamedTuple):
    """Free space of one camera, robot frame, and the ranges from which on and up to which it sees the floor, (J,)."""

    free_space: FreeSpace
    nearest_m: FloatArray
    farthest_m: FloatArray


def join_free_space(floors: Sequence[SeenFloor], directions: int) -> FreeSpace:
    """Return the free space all around.

    Parameters
    ----------
    floors : sequence of SeenFloor
        Of the cameras; bearings no farther apart than the result's.
    directions : int
        Number J of the result's directions over a whole turn.

    Returns
    -------
    FreeSpace
        In each direction up to the nearest thing that any camera shows, or as far as any of them sees; NaN where none
        sees the floor. A camera whose nearest floor in view is hidden does not tell how near the thing stands: where
        another one sees nearer floor, that one does. The rim of a picture counts where no other one reaches.
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
        # cells at the rim of a picture are seen in part, and which part changes as the body sways
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
    """Return a ball as a robot sees it that has moved to `robot`, given in its frame before."""
    motion = robot.inverse()
    x, y = motion.transform((ball.x_m, ball.y_m)).tolist()
    return replace(ball, x_m=x, y_m=y, covariance=turned_covariance(ball.covariance, motion.theta_rad))


def join_balls(seen: Sequence[Sequence[Ball]]) -> tuple[Ball, ...]:
    """Return the balls that several cameras show, one for each: the likeliest first.

    Parameters
    ----------
    seen : sequence of sequence of Ball
        Of each camera, robot frame. Of one ball the pixel is that of the camera that shows it most clearly.
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
    """Join each sighting, in some order, with the first one before that is of another camera and the same thing."""
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
    """Return an obstacle as a robot sees it that has moved to `robot`, given in its frame before."""
    x, y = robot.inverse().transform((obstacle.x_m, obstacle.y_m)).tolist()
    return replace(obstacle, x_m=x, y_m=y, bearing_rad=math.atan2(y, x), range_m=math.hypot(x, y))


def join_obstacles(seen: Sequence[Sequence[Obstacle]], radius_m: float) -> tuple[Obstacle, ...]:
    """Return what several cameras show on the floor, one entry a thing, the nearest first.

    Two sightings are of one thing where their bearings overlap and their ranges differ by no more than a robot's radius
    and a tenth. It then reaches from the one's end to the other's: the rim of a picture cuts things.

    Parameters
    ----------
    seen : sequence of sequence of Obstacle
        Of each camera, robot frame.
    """
    joined = _joined(
        seen,
        lambda obstacle: (obstacle.range_m, obstacle.bearing_rad),
        lambda one, other: _are_one(one, other, radius_m),
        _joined_obstacle,
    )
    return tuple(sorted(joined, key=lambda one: one.range_m))


def _ends(obstacle: Obstacle, about_rad: float) -> tuple[float, float]:
    """Return its right and left end as bearings from a direction."""
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
    """Return what one of them tells, or both do; None where they contradict each other."""
    kinds = {kind for kind in (one.kind, other.kind) if kind is not None}
    return kinds.pop() if len(kinds) == 1 else None
