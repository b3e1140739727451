"""From a plan to a command: round what stands in the way, turning as asked, and out of wherever the robot is stuck."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robocup_vision.avoidance import Steering
from robocup_vision.belief import MovingObstacle
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.tactics import Plan
from sim2d.players.travel import Travel
from sim2d.players.wheel_velocity import WheelVelocity
from sim2d.robot_link import Command, RobotLimits

# senses come, and commands go, so often
PERIOD_S = 1 / 30
# clearance kept on the way; none close to the ball
_MARGIN_M = 0.01
# the heading's error is turned away in about this time; with the ball in the mouth not faster than this
_TURN_TIME_S = 0.18
HOLDING_RPS, HOLDING_MPS = 2.2, 0.6
# speed of pushing where no direction is safe, close to the ball
_PUSH_MPS = 0.25
# one that stands so near, or so near to a robot that has the ball before it, within so much of the way ahead, would be
# pushed
_NEAR_M, _NEAR_HOLDING_M, _PUSHED_RAD = 0.02, 0.1, 1.3
# what a robot goes round moves on: a longer detour than this leads nowhere
_DETOUR_S = 1.5
# wanting to be elsewhere by more than a place's tolerance, but having moved less than this for so long, is being stuck
_TOLERANCE_M, _STUCK_M, _STUCK_S, _ESCAPE_S = 0.04, 0.04, 1.5, 0.7


class Motion:
    """Drives one robot to where its plans want it.

    Parameters
    ----------
    limits : RobotLimits
        What the robot can do.
    rng : numpy.random.Generator
        Chooses ways out where the robot is stuck.
    """

    def __init__(self, limits: RobotLimits, rng: np.random.Generator) -> None:
        self._limits, self._rng = limits, rng
        self._travel, self._close = (
            Steering(
                limits.radius_m + margin_m, limits.acceleration_mps2, limits.dead_time_s, limits.speed_mps, step_m=0.01
            )
            for margin_m in (_MARGIN_M, 0.0)
        )
        self._wheels = WheelVelocity(limits, PERIOD_S)
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
        """What was commanded last, robot frame."""
        return self._wheels.pending_mps

    def update(self, odometry: Pose2, t_s: float) -> None:
        """Take in the motion since the last call."""
        c, s = math.cos(odometry.theta_rad), math.sin(odometry.theta_rad)
        x, y = self._drift[0] + odometry.x_m, self._drift[1] + odometry.y_m
        self._drift = (c * x + s * y, c * y - s * x)
        if math.hypot(*self._drift) > _STUCK_M:
            self._drift, self._anchor_s = (0.0, 0.0), t_s
        self._wheels.sense(odometry)

    def drive(
        self,
        plan: Plan,
        pose: Pose2,
        free_space: FreeSpace,
        t_s: float,
        moving: Sequence[MovingObstacle] = (),
        travel: Travel | None = None,
    ) -> Command:
        """Return the next command.

        Parameters
        ----------
        plan : Plan
            What is wanted.
        pose : Pose2
            The robot, in the plan's frame.
        free_space : FreeSpace
            Around the robot.
        t_s : float
            Now, seconds.
        moving : sequence of MovingObstacle
            Who moves around the robot: kept clear of, unless the plan is `close`.
        travel : Travel, optional
            By which way, and how fast, as planned. Then nobody known to move is pushed.
        """
        first = plan.target if travel is None else travel.waypoint
        there = pose.inverse().transform(first)
        bearing = math.atan2(there[1], there[0])
        ends_there = travel is not None and travel.ends_there
        distance_m = float(np.hypot(*there)) + (0.0 if ends_there else math.dist(first, plan.target))
        speed_mps = None if travel is None else travel.speed_mps
        turn = wrap_angle(plan.heading_rad - pose.theta_rad) / _TURN_TIME_S
        fastest = min(self._limits.turn_rps, HOLDING_RPS if plan.holding else math.inf)
        turn = max(-fastest, min(fastest, turn))
        if distance_m < _TOLERANCE_M and (ends_there or not plan.close):
            self._anchor_s = t_s
        if t_s - self._anchor_s > _STUCK_S:
            self._escape(free_space, t_s)
        if t_s < self._escape_until_s:
            bearing, distance_m = self._escape_rad - pose.theta_rad, 1.0
        # who plans goes round the ball as it goes round all else
        is_close = plan.close and not (travel is not None and plan.avoid_ball)
        steering = self._close if is_close else self._travel
        if t_s - self._direct_s > _DETOUR_S:
            self._forget_detours(t_s)
        wheels, others = self._wheels, () if plan.close and travel is None else moving
        chosen = steering.steer(free_space, wheels.now_mps, bearing, distance_m, wheels.pending_mps, others, speed_mps)
        if chosen.reason == "towards target":
            self._direct_s = t_s
        v_x, v_y = chosen.velocity_mps.tolist()
        pushes = not chosen.safe and (plan.close or plan.holding)
        near_m = _NEAR_HOLDING_M if plan.holding else _NEAR_M
        if pushes and (travel is None or not self._stands_there(moving, bearing, near_m)):
            push = min(_PUSH_MPS, 4.0 * distance_m)
            v_x, v_y = push * math.cos(bearing), push * math.sin(bearing)
        if plan.holding:
            share = min(1.0, HOLDING_MPS / max(math.hypot(v_x, v_y), 1e-9))
            v_x, v_y = share * v_x, share * v_y
        # by the time the command works, the robot will have turned on
        ahead = -turn * (self._limits.dead_time_s + PERIOD_S / 2)
        c, s = math.cos(ahead), math.sin(ahead)
        wanted = (c * v_x - s * v_y, s * v_x + c * v_y)
        self._wheels.command(wanted)
        return Command(*wanted, turn, plan.kick_mps, plan.dribble)

    def _stands_there(self, moving: Sequence[MovingObstacle], bearing_rad: float, near_m: float) -> bool:
        """Whether one that moves would be pushed by driving that way."""
        near = 2 * self._limits.radius_m + near_m
        return any(
            math.hypot(o.x_m, o.y_m) < near and abs(wrap_angle(math.atan2(o.y_m, o.x_m) - bearing_rad)) < _PUSHED_RAD
            for o in moving
        )

    def _escape(self, free_space: FreeSpace, t_s: float) -> None:
        """Head for somewhere free for a while; the farther it is free the likelier."""
        self._forget_detours(t_s)
        self._anchor_s, self._escape_until_s = t_s + _ESCAPE_S, t_s + _ESCAPE_S
        room = np.clip(np.nan_to_num(free_space.range_m, posinf=2.0), 0.0, 2.0) ** 2
        self._escape_rad = self._rng.uniform(-math.pi, math.pi)
        if room.sum() > 0:
            self._escape_rad = float(self._rng.choice(free_space.bearing_rad, p=room / room.sum()))

    def _forget_detours(self, t_s: float) -> None:
        self._travel.forget()
        self._close.forget()
        self._direct_s = t_s
