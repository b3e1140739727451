"""Moves the ball on the carpet: it slides until it rolls, and rolls until it lies still."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymunk

from sim2d.world.state import BallState

_GRAVITY_MPS2 = 9.81
# a slower ball lies still
_STILL_MPS = 1e-4


@dataclass(frozen=True, slots=True)
class BallSettings:
    """Values of `BallBody`.

    Attributes
    ----------
    mass_kg : float
        Of a golf ball.
    elasticity : float
        Part of the speed that it keeps at a wall.
    sliding_friction : float
        A ball kicked at 2 m/s rolls after about 0.2 s.
    rolling_friction : float
        Of a carpet.
    """

    mass_kg: float = 0.046
    elasticity: float = 0.7
    sliding_friction: float = 0.35
    rolling_friction: float = 0.03


class BallBody:
    """A ball in a pymunk space.

    Its roll is the velocity at which its lower side would rest on the carpet. Friction brings velocity and roll
    together. For a solid sphere the roll changes 2.5 times as fast, so a ball kicked without roll ends at 5/7 of its
    speed. Spin about the vertical is not modelled.

    Parameters
    ----------
    space : pymunk.Space
        Where it is added.
    radius_m : float
        Of the ball.
    collision_type : int
        Of its shape.
    settings : BallSettings
        See there.
    """

    def __init__(
        self, space: pymunk.Space, radius_m: float, collision_type: int, settings: BallSettings = BallSettings()
    ) -> None:
        self.radius_m, self._settings = radius_m, settings
        self.body = pymunk.Body(settings.mass_kg, pymunk.moment_for_circle(settings.mass_kg, 0, radius_m))
        shape = pymunk.Circle(self.body, radius_m)
        shape.elasticity, shape.friction = settings.elasticity, 0.0
        shape.collision_type = collision_type
        space.add(self.body, shape)
        self._roll = (0.0, 0.0)

    @property
    def state(self) -> BallState:
        """Position and velocity."""
        (x, y), (vx, vy) = self.body.position, self.body.velocity
        return BallState(x, y, vx, vy)

    def place(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put it somewhere, rolling at a velocity."""
        self.body.position = (x_m, y_m)
        self.body.velocity = (vx_mps, vy_mps)
        self.body.angular_velocity = 0.0
        self._roll = (vx_mps, vy_mps)

    def kick(self, vx_mps: float, vy_mps: float) -> None:
        """Give it a velocity without roll."""
        self.body.velocity = (vx_mps, vy_mps)
        self._roll = (0.0, 0.0)

    def pull(self, ax_mps2: float, ay_mps2: float, dt_s: float) -> None:
        """Accelerate it as a dribbler does, which also makes it roll."""
        vx, vy = self.body.velocity
        self.body.velocity = self._roll = (vx + ax_mps2 * dt_s, vy + ay_mps2 * dt_s)

    def apply_friction(self, dt_s: float) -> None:
        """Apply the carpet's friction for a step."""
        vx, vy = self.body.velocity
        rx, ry = self._roll
        sliding = math.hypot(vx - rx, vy - ry)
        grip = self._settings.sliding_friction * _GRAVITY_MPS2 * dt_s
        if sliding > 3.5 * grip:
            gx, gy = grip * (vx - rx) / sliding, grip * (vy - ry) / sliding
            self.body.velocity = (vx - gx, vy - gy)
            self._roll = (rx + 2.5 * gx, ry + 2.5 * gy)
            return
        # velocity and roll meet within this step: momentum about the point of contact is kept
        vx, vy = (5 * vx + 2 * rx) / 7, (5 * vy + 2 * ry) / 7
        speed = math.hypot(vx, vy)
        loss = self._settings.rolling_friction * _GRAVITY_MPS2 * dt_s
        part = 1 - loss / speed if speed > max(loss, _STILL_MPS) else 0.0
        self.body.velocity = self._roll = (vx * part, vy * part)
