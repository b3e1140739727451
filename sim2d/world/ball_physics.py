"""Moves the ball: on the carpet it slides, then rolls until it lies still; if it is chipped, it flies and bounces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymunk

from sim2d.world.state import BallState

GRAVITY_MPS2 = 9.81
# fraction of its speed that a sliding ball has left when it begins to roll (a solid sphere)
ROLLS_RATIO = 5 / 7
# speed below which a ball lies still
_STILL_MPS = 1e-4
# Vertical speed below which it no longer bounces, which is a bounce of 1 mm.
_MIN_BOUNCE_MPS = 0.15
# If its lower side is above this it passes over robots and walls: the league's robots are at most 0.15 m high.
CLEAR_HEIGHT_M = 0.15


@dataclass(frozen=True, slots=True)
class BallSettings:
    """Physical properties of a `BallBody`."""

    #: Mass, by default of a golf ball.
    mass_kg: float = 0.046
    #: Elasticity in pymunk's sense.
    elasticity: float = 0.7
    #: Coefficient of sliding friction on a carpet: a ball kicked at 2 m/s rolls after about 0.2 s.
    sliding_friction: float = 0.35
    #: Coefficient of rolling friction on a carpet.
    rolling_friction: float = 0.03


@dataclass(frozen=True, slots=True)
class Flight:
    """How a chipped ball flies: the league's model with a fixed loss at each bounce."""

    #: Fractions of its velocity along the floor that it keeps at its first bounce and at each later one.
    first_floor_ratio: float = 0.715
    later_floor_ratio: float = 1.0
    #: Fraction of its vertical speed that it keeps at a bounce.
    up_ratio: float = 0.566


class BallBody:
    """A ball in a pymunk space.

    Its roll is the velocity at which it would roll without sliding at its present spin. Friction brings velocity and
    roll together. For a solid sphere the roll changes 2.5 times as fast as the velocity, so a ball kicked without roll
    ends at 5/7 of its speed. Spin about the vertical is not modelled.
    """

    def __init__(
        self,
        space: pymunk.Space,
        radius_m: float,
        collision_type: int,
        settings: BallSettings = BallSettings(),
        flight: Flight = Flight(),
    ) -> None:
        self.radius_m, self._settings, self.flight = radius_m, settings, flight
        self.body = pymunk.Body(settings.mass_kg, pymunk.moment_for_circle(settings.mass_kg, 0, radius_m))
        self.shape = shape = pymunk.Circle(self.body, radius_m)
        shape.elasticity, shape.friction = settings.elasticity, 0.0
        shape.collision_type = collision_type
        space.add(self.body, shape)
        self._roll = (0.0, 0.0)
        self._height_m = self._rise_mps = 0.0
        self._bounces = 0
        self._is_clear = False

    @property
    def state(self) -> BallState:
        """Position and velocity."""
        (x, y), (vx, vy) = self.body.position, self.body.velocity
        return BallState(x, y, vx, vy, self._height_m, self._rise_mps)

    @property
    def height_m(self) -> float:
        """Height of its lower side above the carpet."""
        return self._height_m

    @property
    def flies(self) -> bool:
        """Whether it is off the carpet, or about to be."""
        return self._height_m > 0 or self._rise_mps > 0

    def place(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put it at a place on the carpet, rolling at a velocity."""
        self.body.position = (x_m, y_m)
        self.body.velocity = (vx_mps, vy_mps)
        self.body.angular_velocity = 0.0
        self._roll = (vx_mps, vy_mps)
        self.throw(0.0, 0.0)

    def kick(self, vx_mps: float, vy_mps: float, vz_mps: float = 0.0) -> None:
        """Give it a velocity without roll; with an upward part it flies."""
        self.body.velocity = (vx_mps, vy_mps)
        self._roll = (0.0, 0.0)
        self.throw(self._height_m, vz_mps)

    def throw(self, z_m: float, vz_mps: float) -> None:
        """Put it at a height, rising at a speed; position and velocity along the floor stay."""
        self._height_m, self._rise_mps = max(z_m, 0.0), vz_mps
        if self._height_m == 0:
            self._rise_mps = max(vz_mps, 0.0)
        self._bounces = 0
        self._set_clear()

    def pull(self, ax_mps2: float, ay_mps2: float, dt_s: float) -> None:
        """Accelerate it as a dribbler does, after which it rolls without sliding."""
        vx, vy = self.body.velocity
        self.body.velocity = self._roll = (vx + ax_mps2 * dt_s, vy + ay_mps2 * dt_s)

    def apply_friction(self, dt_s: float) -> None:
        """Apply the carpet's friction for a step, or gravity while it flies."""
        if self.flies:
            self._fall(dt_s)
            return
        vx, vy = self.body.velocity
        rx, ry = self._roll
        sliding = math.hypot(vx - rx, vy - ry)
        grip = self._settings.sliding_friction * GRAVITY_MPS2 * dt_s
        if sliding > 3.5 * grip:
            gx, gy = grip * (vx - rx) / sliding, grip * (vy - ry) / sliding
            self.body.velocity = (vx - gx, vy - gy)
            self._roll = (rx + 2.5 * gx, ry + 2.5 * gy)
            return
        # sliding ends within this step; the angular momentum about the point of contact is conserved
        vx, vy = (5 * vx + 2 * rx) / 7, (5 * vy + 2 * ry) / 7
        speed = math.hypot(vx, vy)
        loss = self._settings.rolling_friction * GRAVITY_MPS2 * dt_s
        part = 1 - loss / speed if speed > max(loss, _STILL_MPS) else 0.0
        self.body.velocity = self._roll = (vx * part, vy * part)

    def _fall(self, dt_s: float) -> None:
        height, rise = self._height_m, self._rise_mps
        self._height_m = height + rise * dt_s - GRAVITY_MPS2 * dt_s**2 / 2
        self._rise_mps = rise - GRAVITY_MPS2 * dt_s
        if self._height_m <= 0:
            # from the speed at impact, at whatever time within the step that is
            back_mps = self.flight.up_ratio * math.sqrt(rise**2 + 2 * GRAVITY_MPS2 * height)
            part = self.flight.later_floor_ratio if self._bounces else self.flight.first_floor_ratio
            vx, vy = self.body.velocity
            self.body.velocity = self._roll = (vx * part, vy * part)
            self._bounces += 1
            self._height_m = 0.0
            self._rise_mps = back_mps if back_mps >= _MIN_BOUNCE_MPS else 0.0
        self._set_clear()

    def _set_clear(self) -> None:
        is_clear = self._height_m > CLEAR_HEIGHT_M
        if is_clear != self._is_clear:
            self._is_clear = is_clear
            self.shape.filter = pymunk.ShapeFilter(mask=0) if is_clear else pymunk.ShapeFilter()
