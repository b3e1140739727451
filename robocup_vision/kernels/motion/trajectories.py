"""Compiled trajectories of a robot with limited acceleration."""

from __future__ import annotations

import math

from robocup_vision.compiling.loops import compiled

Pair = tuple[float, float]


@compiled(error_model="numpy")
def predict_position(start: Pair, velocity: Pair, target: Pair, acceleration: float, t: float) -> Pair:
    """Return (x, y), metres, t seconds after the robot begins to obey: eq. 12 with a corrected second branch.

    start : pair of float, m; velocity, target : pair of float, m/s.
    """
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    settle = math.sqrt(dv_x * dv_x + dv_y * dv_y) / acceleration
    # 1/2 alpha t^2 dv/|dv| as 1/2 dv t^2/settle, which is defined for dv = 0
    if t < settle:
        gained = 0.5 * t * t / settle
        return start[0] + velocity[0] * t + gained * dv_x, start[1] + velocity[1] * t + gained * dv_y
    lost = 0.5 * settle
    return start[0] + target[0] * t - lost * dv_x, start[1] + target[1] * t - lost * dv_y


@compiled(error_model="numpy")
def predict_velocity(velocity: Pair, target: Pair, acceleration: float, t: float) -> Pair:
    """Return the velocity, m/s, t seconds after the robot begins to obey (eq. 10)."""
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    size = math.sqrt(dv_x * dv_x + dv_y * dv_y)
    gained = acceleration * t
    if gained >= size:
        return target
    return velocity[0] + gained / size * dv_x, velocity[1] + gained / size * dv_y
