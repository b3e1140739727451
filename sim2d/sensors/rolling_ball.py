"""How a ball with patches has turned: it rolls as it moves."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from sim2d.world.state import BallState


class RollingBall:
    """Follows the turn of one ball."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._rotation: FloatArray = np.eye(3)
        self._last_m: tuple[float, float] | None = None

    def turn_rad(self, ball: BallState) -> tuple[float, float, float]:
        """Return its turns about x, y and z of the field, one after the other, now that it has rolled there."""
        if self._last_m is not None:
            self._roll(ball.x_m - self._last_m[0], ball.y_m - self._last_m[1])
        self._last_m = (ball.x_m, ball.y_m)
        r = self._rotation
        pitch = math.asin(max(-1.0, min(1.0, -float(r[2, 0]))))
        return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])

    def _roll(self, x_m: float, y_m: float) -> None:
        distance_m = math.hypot(x_m, y_m)
        if distance_m == 0.0:
            return
        # about the axis that lies across the way, to its left
        ax, ay, angle = -y_m / distance_m, x_m / distance_m, distance_m / self._radius_m
        c, s = math.cos(angle), math.sin(angle)
        across = np.array([[0.0, 0.0, ay], [0.0, 0.0, -ax], [-ay, ax, 0.0]])
        self._rotation = (np.eye(3) + s * across + (1.0 - c) * across @ across) @ self._rotation
