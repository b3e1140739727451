"""Estimates a robot's velocity now from odometry, which measures the mean over the last period, and its commands."""

from __future__ import annotations

import math

from robocup_vision.geometry import Pose2
from sim2d.robot_link import RobotLimits

Velocity = tuple[float, float]


class WheelVelocity:
    """Estimates one robot's velocity; call `sense` and `command` in turn.

    Parameters
    ----------
    period_s : float
        Between two commands.
    """

    def __init__(self, limits: RobotLimits, period_s: float) -> None:
        self._limits, self._period_s = limits, period_s
        self._now: Velocity = (0.0, 0.0)
        self._pending: Velocity = (0.0, 0.0)
        self._before: Velocity = (0.0, 0.0)
        self._jolt: Velocity = (0.0, 0.0)

    @property
    def jolt_mps(self) -> Velocity:
        """By how much the last odometry is off all that the motors can do, robot frame when it began: a contact."""
        return self._jolt

    @property
    def now_mps(self) -> Velocity:
        """Velocity at the end of the last period, robot frame."""
        return self._now

    @property
    def pending_mps(self) -> Velocity:
        """The command under way: obeyed until the next one is."""
        return self._pending

    def sense(self, odometry: Pose2) -> None:
        """Update with the odometry of the last period, in the robot frame at its beginning."""
        x, y = odometry.x_m / self._period_s, odometry.y_m / self._period_s
        jump_x, jump_y = x - self._now[0], y - self._now[1]
        jump = math.hypot(jump_x, jump_y)
        beyond = max(jump - self._limits.acceleration_mps2 * self._period_s, 0.0)
        self._jolt = (beyond * jump_x / jump, beyond * jump_y / jump) if beyond > 0.0 else (0.0, 0.0)
        # which command was obeyed over the second half of the period
        obeyed = self._before if self._limits.dead_time_s > self._period_s / 2 else self._pending
        off_x, off_y = obeyed[0] - x, obeyed[1] - y
        size = math.hypot(off_x, off_y)
        gained = self._limits.acceleration_mps2 * self._period_s / 2
        part = min(1.0, gained / size) if size > 0 else 0.0
        x, y = x + part * off_x, y + part * off_y
        c, s = math.cos(odometry.theta_rad), math.sin(odometry.theta_rad)
        self._now = (c * x + s * y, c * y - s * x)

    def command(self, velocity_mps: Velocity) -> None:
        """Update with the command of now, robot frame."""
        self._before, self._pending = self._pending, velocity_mps
