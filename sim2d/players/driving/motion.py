"""Converts plans to commands: avoids obstacles, turns to the heading, escapes if stuck."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.avoidance import Steering, SteeringSettings
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.driving.travel import Travel
from sim2d.players.driving.wheels import Bumps, WheelVelocity
from sim2d.players.plan import Plan
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits

# Clearance on the way; none close to the ball, where others may be touched.
_MARGIN_M = 0.01
# Sample distance of steering.
_STEP_M = 0.01
# Time in which the heading's error is removed; a shorter one would overshoot because of the dead time.
TURN_TIME_S = 0.18
# Speed of pushing close to the ball if no direction is safe.
_PUSH_MPS = 0.25
# Distances to a robot's rim at which it would be pushed: without the ball, and with it.
_NEAR_M = 0.02
_NEAR_HOLDING_M = 0.1
# Greatest angle of such a robot from the direction of motion.
_PUSHED_RAD = 1.3
# Time after which a detour is dropped, because obstacles move.
_DETOUR_S = 1.5
# Distance from the target, in robot radii, at which the robot does not count as stuck, even if others or slip keep
# it from getting closer.
_ARRIVED_RADII = 1.0
# A robot that has moved less than this in this time without arriving is stuck.
_STUCK_M = 0.04
_STUCK_S = 1.5
# Time for which a stuck robot then drives in a random free direction.
_ESCAPE_S = 0.7
# Distance of the target up to which a robot with a forward camera faces as planned and moves sideways; from there
# on it faces its way, unless its plan looks elsewhere.
_FACE_WAY_M = 0.4
# Greatest turning rate of such a robot, unless the ball is close: quick turns blur and skew the picture, and slip.
CALM_RPS = 2.0


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Settings of `Motion`."""

    #: Limits with the ball in the mouth without a plan, slow enough for any dribbler.
    holding_mps: float = 0.6
    holding_rps: float = 2.2


class Motion:
    """Drives one robot by its plans.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the direction of an escape.
    sees_ahead_only : bool
        Whether its camera does not see all around; then it faces its way, and keeps away from robots it has touched.
    """

    def __init__(
        self,
        limits: RobotLimits,
        rng: np.random.Generator,
        settings: MotionSettings = MotionSettings(),
        *,
        sees_ahead_only: bool = False,
    ) -> None:
        self._limits, self._rng, self._settings = limits, rng, settings
        self._sees_ahead_only = sees_ahead_only
        self._travel, self._close = (
            Steering(limits.radius_m + margin_m, limits, SteeringSettings(step_m=_STEP_M))
            for margin_m in (_MARGIN_M, 0.0)
        )
        self._wheels = WheelVelocity(limits)
        self._bumps = Bumps(limits.radius_m)
        self._direct_s = 0.0
        self._anchor_s = 0.0
        self._drift = (0.0, 0.0)
        self._escape_until_s, self._escape_rad = -math.inf, 0.0

    @property
    def now_mps(self) -> tuple[float, float]:
        """Velocity of the wheels, robot frame."""
        return self._wheels.now_mps

    @property
    def pending_mps(self) -> tuple[float, float]:
        """The last commanded velocity, robot frame."""
        return self._wheels.pending_mps

    def update(self, odometry: Pose2, t_s: float) -> None:
        """Update with the odometry since the last call."""
        c, s = math.cos(odometry.theta_rad), math.sin(odometry.theta_rad)
        x, y = self._drift[0] + odometry.x_m, self._drift[1] + odometry.y_m
        self._drift = (c * x + s * y, c * y - s * x)
        if math.hypot(*self._drift) > _STUCK_M:
            self._drift, self._anchor_s = (0.0, 0.0), t_s
        self._wheels.sense(odometry)
        if self._sees_ahead_only:
            self._bumps.move(odometry, self._wheels.jolt_mps, t_s)

    def drive(
        self,
        plan: Plan,
        pose: Pose2,
        free_space: FreeSpace,
        t_s: float,
        moving: Sequence[Disc] = (),
        travel: Travel | None = None,
    ) -> Command:
        """Return the next command.

        Parameters
        ----------
        pose : Pose2
            Pose of the robot, in the plan's frame.
        moving : sequence of Disc
            Moving robots, which steering avoids unless the plan is `close` or `holding`.
        travel : Travel, optional
            Planned way and speed. If it does not press, no known robot is pushed.
        """
        settings = self._settings
        first = plan.target if travel is None else travel.waypoint
        there = pose.inverse().transform(first)
        bearing = math.atan2(there[1], there[0])
        ends_there = travel is not None and travel.ends_there
        distance_m = float(np.hypot(*there)) + (0.0 if ends_there else math.dist(first, plan.target))
        speed_mps = None if travel is None else travel.speed_mps
        if plan.speed_mps is not None:
            speed_mps = min(plan.speed_mps, self._limits.speed_mps if speed_mps is None else speed_mps)
        # with the ball in the mouth the robot may push others
        touched = () if plan.holding else self._bumps.discs
        if touched:
            free_space = self._bumps.block(free_space)
        if distance_m < _ARRIVED_RADII * self._limits.radius_m and (ends_there or not plan.close):
            self._anchor_s = t_s
        if t_s - self._anchor_s > _STUCK_S:
            self._escape(free_space, t_s)
        if t_s < self._escape_until_s:
            bearing, distance_m = self._escape_rad - pose.theta_rad, 1.0
        is_far = distance_m > _FACE_WAY_M
        faces_way = self._sees_ahead_only and is_far and not (plan.holding or plan.looks)
        turn = wrap_angle(bearing if faces_way else plan.heading_rad - pose.theta_rad) / TURN_TIME_S
        fastest = self._limits.turn_rps
        if plan.holding:
            fastest = min(fastest, settings.holding_rps if travel is None else travel.turn_rps)
        elif self._sees_ahead_only and not plan.close:
            fastest = min(fastest, CALM_RPS)
        turn = max(-fastest, min(fastest, turn))
        # a planned way round the ball treats it as any obstacle
        is_close = plan.close and not (travel is not None and plan.avoid_ball)
        steering = self._close if is_close else self._travel
        if t_s - self._direct_s > _DETOUR_S:
            self._forget_detours(t_s)
        presses = travel is None or travel.presses
        wheels, others = self._wheels, () if presses and (plan.close or plan.holding) else moving
        chosen = steering.steer(free_space, wheels.now_mps, bearing, distance_m, wheels.pending_mps, others, speed_mps)
        if chosen.reason == "towards target":
            self._direct_s = t_s
        v_x, v_y = chosen.velocity_mps.tolist()
        pushes = not chosen.safe and (plan.close or plan.holding)
        near_m = _NEAR_HOLDING_M if plan.holding else _NEAR_M
        known = touched if presses else (*moving, *touched)
        if pushes and not self._would_push(known, bearing, near_m):
            push = min(_PUSH_MPS, 4.0 * distance_m)
            v_x, v_y = push * math.cos(bearing), push * math.sin(bearing)
        if plan.holding and travel is None:
            part = min(1.0, settings.holding_mps / max(math.hypot(v_x, v_y), 1e-9))
            v_x, v_y = part * v_x, part * v_y
        # by the time the command takes effect, the robot will have turned
        ahead = -turn * (self._limits.dead_time_s + CONTROL_PERIOD_S / 2)
        c, s = math.cos(ahead), math.sin(ahead)
        wanted = (c * v_x - s * v_y, s * v_x + c * v_y)
        self._wheels.command(wanted)
        return Command(*wanted, turn, plan.kick_mps, plan.dribble)

    def _would_push(self, moving: Sequence[Disc], bearing_rad: float, near_m: float) -> bool:
        """Whether driving in a direction would push a robot."""
        near = 2 * self._limits.radius_m + near_m
        return any(
            math.hypot(o.x_m, o.y_m) < near and abs(wrap_angle(math.atan2(o.y_m, o.x_m) - bearing_rad)) < _PUSHED_RAD
            for o in moving
        )

    def _escape(self, free_space: FreeSpace, t_s: float) -> None:
        """Choose a random direction for some time, with probabilities that grow with the free range."""
        self._forget_detours(t_s)
        self._anchor_s = self._escape_until_s = t_s + _ESCAPE_S
        room = np.clip(np.nan_to_num(free_space.range_m, posinf=2.0), 0.0, 2.0) ** 2
        self._escape_rad = self._rng.uniform(-math.pi, math.pi)
        if room.sum() > 0:
            self._escape_rad = float(self._rng.choice(free_space.bearing_rad, p=room / room.sum()))

    def _forget_detours(self, t_s: float) -> None:
        self._travel.forget()
        self._close.forget()
        self._direct_s = t_s
