"""Compiled times of contact between a predicted trajectory and moving discs."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.motion.trajectories import predict_position, predict_velocity

Pair = tuple[float, float]

# columns of the table of moving discs
COLUMNS = 8


@compiled(error_model="numpy")
def _keep_off_m(moving: FloatArray, k: int, t: float) -> float:
    """Return the distance, metres, that the robot's centre keeps from disc k, t seconds from now."""
    spread = math.sqrt(moving[k, 5] * moving[k, 5] + moving[k, 6] * moving[k, 6] * t * t)
    return float(moving[k, 4] + min(spread, moving[k, 7]))


@compiled(error_model="numpy")
def moving_contact_time(
    start: Pair,
    velocity: Pair,
    target: Pair,
    acceleration: float,
    begin: float,
    horizon: float,
    step_m: float,
    moving: FloatArray,
) -> float:
    """Return the last free time, seconds after `begin`, before the trajectory comes too near to a disc; inf if never.

    start, velocity, target, acceleration : as in `predict_position`.
    begin, horizon : seconds from now until the trajectory begins, and its length.
    step_m : sample distance at the greatest closing speed.
    moving : (M, 8) for each disc x, y (m) and velocity x, y (m/s) now; the distance to keep between exactly known
    places; standard deviations of place (m) and velocity (m/s), and the greatest margin for both (m).

    A robot that is too near at the beginning may leave, but must not come nearer.
    """
    own = math.sqrt(max(velocity[0] ** 2 + velocity[1] ** 2, target[0] ** 2 + target[1] ** 2))
    first = np.inf
    for k in range(moving.shape[0]):
        closing = own + math.sqrt(moving[k, 2] ** 2 + moving[k, 3] ** 2) + moving[k, 6]
        if closing <= 0.0:
            continue
        least = step_m / closing
        x, y = moving[k, 0] + moving[k, 2] * begin - start[0], moving[k, 1] + moving[k, 3] * begin - start[1]
        away = math.sqrt(x * x + y * y)
        nearest = np.inf
        if away < _keep_off_m(moving, k, begin):
            nearest = away - step_m
        t, free = 0.0, 0.0
        until = min(horizon, first)
        while t < until:
            gap = away - min(_keep_off_m(moving, k, begin + t), nearest)
            if gap < 0.0:
                first = min(free, t)
                break
            # no contact is possible before
            free = t + gap / closing
            t = min(t + max(gap / closing, least), until)
            x, y = predict_position(start, velocity, target, acceleration, t)
            x -= moving[k, 0] + moving[k, 2] * (begin + t)
            y -= moving[k, 1] + moving[k, 3] * (begin + t)
            away = math.sqrt(x * x + y * y)
    return first


@compiled(error_model="numpy")
def moving_contact_then_stop(
    start: Pair,
    velocity: Pair,
    target: Pair,
    acceleration: float,
    begin: float,
    carried: float,
    step_m: float,
    moving: FloatArray,
) -> float:
    """Return the same for a trajectory that is followed for some seconds and then braked to rest.

    A disc that hits a robot at rest is not counted. Other parameters as in `moving_contact_time`.
    """
    t = moving_contact_time(start, velocity, target, acceleration, begin, carried, step_m, moving)
    if t < np.inf:
        return t
    there = predict_position(start, velocity, target, acceleration, carried)
    then = predict_velocity(velocity, target, acceleration, carried)
    stop = math.sqrt(then[0] * then[0] + then[1] * then[1]) / acceleration
    return carried + moving_contact_time(there, then, (0.0, 0.0), acceleration, begin + carried, stop, step_m, moving)
