"""The ball on the carpet: it slides until it rolls, and rolls until it lies still."""

from __future__ import annotations

import math

import pymunk

from sim2d.world.state import BallState

MASS_KG = 0.046
SLIDING_FRICTION = 0.35  # kick to rolling in about 0.2 s at 2 m/s
ROLLING_FRICTION = 0.03
GRAVITY_MPS2 = 9.81
_STILL_MPS = 1e-4


class BallBody:
    """A ball in a pymunk space.

    Its roll is the velocity at which its lower side would rest on the carpet; friction draws velocity and roll
    together (a solid sphere: the roll 2.5 times as fast, so a ball kicked without roll ends at 5/7 of its speed).
    Spin about the vertical is left out.

    Parameters
    ----------
    space : pymunk.Space
        Where it is added.
    radius_m : float
        Of the ball.
    collision_type : int
        Of its shape.
    """

    def __init__(self, space: pymunk.Space, radius_m: float, collision_type: int) -> None:
        self.radius_m = radius_m
        self.body = pymunk.Body(MASS_KG, pymunk.moment_for_circle(MASS_KG, 0, radius_m))
        shape = pymunk.Circle(self.body, radius_m)
        shape.elasticity, shape.friction = 0.7, 0.0
        shape.collision_type = collision_type
        space.add(self.body, shape)
        self._roll = (0.0, 0.0)

    @property
    def state(self) -> BallState:
        """Where it is and how it moves."""
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
        """Accelerate it as a dribbler does, which also spins it as fast as it goes."""
        vx, vy = self.body.velocity
        self.body.velocity = self._roll = (vx + ax_mps2 * dt_s, vy + ay_mps2 * dt_s)

    def rub(self, dt_s: float) -> None:
        """Let the carpet act on it for a step."""
        vx, vy = self.body.velocity
        rx, ry = self._roll
        sliding = math.hypot(vx - rx, vy - ry)
        grip = SLIDING_FRICTION * GRAVITY_MPS2 * dt_s
        if sliding > 3.5 * grip:
            gx, gy = grip * (vx - rx) / sliding, grip * (vy - ry) / sliding
            self.body.velocity = (vx - gx, vy - gy)
            self._roll = (rx + 2.5 * gx, ry + 2.5 * gy)
            return
        # velocity and roll meet within this step: momentum about the point of contact is kept
        vx, vy = (5 * vx + 2 * rx) / 7, (5 * vy + 2 * ry) / 7
        speed = math.hypot(vx, vy)
        loss = ROLLING_FRICTION * GRAVITY_MPS2 * dt_s
        kept = 1 - loss / speed if speed > max(loss, _STILL_MPS) else 0.0
        self.body.velocity = self._roll = (vx * kept, vy * kept)
