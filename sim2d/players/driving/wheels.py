"""Velocity and contacts of a robot, by its wheels.

A forward camera does not see robots beside it. A contact changes the wheels' velocity by more than their motors can, in
the direction away from what was touched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits

Velocity = tuple[float, float]
# Least jolt of a bump: change of velocity in a period beyond what the motors can do. Errors of odometry are
# smaller.
_MIN_JOLT_MPS = 0.03
# Time for which the robot keeps away from a touched one, which has then moved on or is visible.
_BUMP_LASTS_S = 1.0


class WheelVelocity:
    """Estimates one robot's velocity; call `sense` and `command` in turn, once each control period."""

    def __init__(self, limits: RobotLimits) -> None:
        self._limits = limits
        self._now: Velocity = (0.0, 0.0)
        self._pending: Velocity = (0.0, 0.0)
        self._before: Velocity = (0.0, 0.0)
        self._jolt: Velocity = (0.0, 0.0)

    @property
    def jolt_mps(self) -> Velocity:
        """Excess of the last change of velocity over what the motors can do, robot frame at its start: a contact."""
        return self._jolt

    @property
    def now_mps(self) -> Velocity:
        """Velocity at the end of the last period, robot frame."""
        return self._now

    @property
    def pending_mps(self) -> Velocity:
        """The present command, which is obeyed until the next one."""
        return self._pending

    def sense(self, odometry: Pose2) -> None:
        """Update with the odometry of the last period, in the robot frame at its beginning."""
        x, y = odometry.x_m / CONTROL_PERIOD_S, odometry.y_m / CONTROL_PERIOD_S
        jump_x, jump_y = x - self._now[0], y - self._now[1]
        jump = math.hypot(jump_x, jump_y)
        beyond = max(jump - self._limits.acceleration_mps2 * CONTROL_PERIOD_S, 0.0)
        self._jolt = (beyond * jump_x / jump, beyond * jump_y / jump) if beyond > 0.0 else (0.0, 0.0)
        # command obeyed during the second half of the period
        obeyed = self._before if self._limits.dead_time_s > CONTROL_PERIOD_S / 2 else self._pending
        off_x, off_y = obeyed[0] - x, obeyed[1] - y
        size = math.hypot(off_x, off_y)
        gained = self._limits.acceleration_mps2 * CONTROL_PERIOD_S / 2
        part = min(1.0, gained / size) if size > 0 else 0.0
        x, y = x + part * off_x, y + part * off_y
        c, s = math.cos(odometry.theta_rad), math.sin(odometry.theta_rad)
        self._now = (c * x + s * y, c * y - s * x)

    def command(self, velocity_mps: Velocity) -> None:
        """Update with the present command, robot frame."""
        self._before, self._pending = self._pending, velocity_mps


@dataclass(frozen=True, slots=True)
class _Bump:
    t_s: float
    # place of the other robot's centre, robot frame
    x_m: float
    y_m: float


class Bumps:
    """The bumps of one robot; call `move` once each control period.

    Parameters
    ----------
    radius_m : float
        Radius of this robot and of the others.
    """

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._bumps: tuple[_Bump, ...] = ()

    @property
    def discs(self) -> tuple[Disc, ...]:
        """The robots touched recently, at their places then, robot frame."""
        return tuple(Disc(bump.x_m, bump.y_m, self._radius_m) for bump in self._bumps)

    def move(self, odometry: Pose2, jolt_mps: tuple[float, float], t_s: float) -> None:
        """Update with the odometry since the last call, and its jolt (`WheelVelocity.jolt_mps`)."""
        size = math.hypot(*jolt_mps)
        kept = [bump for bump in self._bumps if 0.0 <= t_s - bump.t_s <= _BUMP_LASTS_S]
        if size > _MIN_JOLT_MPS:
            away_m = -2 * self._radius_m / size
            kept.append(_Bump(t_s, away_m * jolt_mps[0], away_m * jolt_mps[1]))
        back = odometry.inverse()
        moved = [back.transform((bump.x_m, bump.y_m)).tolist() for bump in kept]
        self._bumps = tuple(replace(bump, x_m=x, y_m=y) for bump, (x, y) in zip(kept, moved, strict=True))

    def block(self, free_space: FreeSpace) -> FreeSpace:
        """Return free space (robot frame) limited by the touched robots."""
        if not self._bumps:
            return free_space
        range_m = free_space.range_m
        for bump in self._bumps:
            range_m = np.fmin(range_m, self._ranges_m(bump, free_space.bearing_rad))
        range_m.flags.writeable = False
        return FreeSpace(free_space.bearing_rad, range_m)

    def _ranges_m(self, bump: _Bump, bearing_rad: FloatArray) -> FloatArray:
        """Return the distance (J,) float64 to a robot's rim in each direction, infinite beside it."""
        off_rad = bearing_rad - math.atan2(bump.y_m, bump.x_m)
        away_m = math.hypot(bump.x_m, bump.y_m)
        half2 = self._radius_m**2 - (away_m * np.sin(off_rad)) ** 2
        meets = (half2 > 0.0) & (np.cos(off_rad) > 0.0)
        rim_m = away_m * np.cos(off_rad) - np.sqrt(np.maximum(half2, 0.0))
        return np.where(meets, np.maximum(rim_m, 0.0), np.inf)
