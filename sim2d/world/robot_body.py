"""Moves one robot's body: an omni-drive with limits, slipping wheels, a dribbler and a kicker."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
import pymunk

from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.robot_link import CONTROL_PERIOD_S
from sim2d.world.ball_physics import BallBody
from sim2d.world.robot_spec import BodySettings, RobotSpec
from sim2d.world.state import RobotState

_OUTLINE_CORNERS = 15
# a ball up to this distance in front of its seat, in ball radii, is still in the mouth
_MOUTH_DEPTH = 0.5
# the dribbler pulls the ball to its seat like a damped spring, up to a largest acceleration
_STIFFNESS_PS2, _DAMPING_PS, _GRIP_MPS2 = 900.0, 50.0, 6.0

# slip is correlated over this time
_SLIP_TIME_S = 0.1
# duration of a push from outside
_PUSH_S = 0.2


class Order(NamedTuple):
    """An order to a robot for one physics step."""

    #: Wanted velocity: forward and left if the robot's `spec.turns_along`, otherwise along the field's axes.
    x_mps: float = 0.0
    y_mps: float = 0.0
    turn_rps: float = 0.0
    #: Speed to kick the ball with; 0: it does not kick.
    kick_mps: float = 0.0
    #: Elevation of the kick above the carpet.
    kick_rise_rad: float = 0.0
    dribbles: bool = False
    #: Wanted pan of the head; None: unchanged.
    pan_rad: float | None = None


class RobotBody:
    """A robot in a pymunk space.

    After the dead time the wheels' velocity follows the order within the limits (Sekimori et al. 2001, eq. 10). The
    body moves as the wheels do plus their slip, which odometry does not measure. Contacts change the wheels' velocity.

    Parameters
    ----------
    place : (int, int, int)
        The robot's index in its world, its side and its number.
    rng : numpy.random.Generator
        Draws the systematic error of the odometry at once, and the errors of kicks later.
    """

    def __init__(
        self,
        space: pymunk.Space,
        collision_type: int,
        place: tuple[int, int, int],
        spec: RobotSpec,
        settings: BodySettings,
        step_s: float,
        rng: np.random.Generator,
    ) -> None:
        (self.index, self.side, self.number), self.spec = place, spec
        self._settings, self._step_s, self._rng, self._space = settings, step_s, rng, space
        self.body = pymunk.Body(spec.mass_kg, pymunk.moment_for_circle(spec.mass_kg, 0, spec.radius_m))
        self.shape = _hull(self.body, spec)
        self.shape.elasticity, self.shape.friction, self.shape.collision_type = 0.1, 0.1, collision_type
        space.add(self.body, self.shape)
        self._gain, self._turn_gain = (1 + settings.gain_std * rng.standard_normal(2)).tolist()
        self._waiting: deque[Order] = deque([Order()] * round(spec.dead_time_s / step_s))
        self._order = Order()
        self._pan_rad = 0.0
        # velocities are (x, y, turn), m/s and rad/s
        self._wheels = (0.0, 0.0, 0.0)  # in the frame of the orders
        self._slip = (0.0, 0.0, 0.0)  # in the frame of the orders
        self._push = (0.0, 0.0, 0.0)  # field frame
        self._push_left = 0  # steps
        self._velocity_before = (0.0, 0.0, 0.0)  # of the body before a step's contacts, field frame
        self._velocity_after = (0.0, 0.0, 0.0)  # of the body after a step's contacts, field frame
        self._axis = (1.0, 0.0)  # x axis of the frame of the orders, field frame
        self._slip_in_field = (0.0, 0.0)
        self._odometry = (0.0, 0.0, 0.0)
        self._steps_to_kick = 0

    @property
    def pose(self) -> Pose2:
        """Pose in the field frame."""
        x, y = self.body.position
        return Pose2(x, y, self.body.angle)

    @property
    def motion(self) -> tuple[float, float, float]:
        """Velocity, robot frame: forward and left in m/s, turn in rad/s."""
        (vx, vy), c, s = self.body.velocity, math.cos(self.body.angle), math.sin(self.body.angle)
        return c * vx + s * vy, c * vy - s * vx, self.body.angular_velocity

    def state(self, index: int) -> RobotState:
        """Return the robot's state; `index` is its place among all robots."""
        vx, vy = self.body.velocity
        spec, turn = self.spec, self.body.angular_velocity
        return RobotState(
            index, self.side, self.number, self.pose, (vx, vy), turn, self._pan_rad, spec.radius_m, spec.height_m
        )

    def place(self, pose: Pose2, velocity_mps: tuple[float, float] = (0.0, 0.0), turn_rps: float = 0.0) -> None:
        """Put the robot at a pose with a velocity, field frame; odometry does not measure that."""
        self.body.position = (pose.x_m, pose.y_m)
        self.body.angle = pose.theta_rad
        self.body.velocity, self.body.angular_velocity = velocity_mps, turn_rps
        self._velocity_after = (*velocity_mps, turn_rps)
        if self.spec.turns_along:
            self._axis = (math.cos(pose.theta_rad), math.sin(pose.theta_rad))
        (vx, vy), (c, s) = velocity_mps, self._axis
        self._wheels = (c * vx + s * vy, c * vy - s * vx, turn_rps)
        self._slip = (0.0, 0.0, 0.0)
        self._push_left = 0

    def remove(self) -> None:
        """Remove the robot from the space."""
        self._space.remove(self.shape, self.body)

    def push(self, dx_m: float, dy_m: float, turn_rad: float) -> None:
        """Push the robot by a displacement (field frame) and an angle; the wheels slip, so odometry does not see it."""
        self._push = (dx_m / _PUSH_S, dy_m / _PUSH_S, turn_rad / _PUSH_S)
        self._push_left = round(_PUSH_S / self._step_s)

    def begin_period(self, drawn: tuple[float, float, float]) -> None:
        """Start a control period: reset odometry, and change the slip by three standard normal numbers."""
        self._odometry = (0.0, 0.0, 0.0)
        settings = self._settings
        kept = math.exp(-CONTROL_PERIOD_S / _SLIP_TIME_S)
        fresh = math.sqrt(1 - kept * kept)
        speed = math.hypot(self._wheels[0], self._wheels[1])
        sizes = (
            settings.slip_part * speed,
            settings.slip_part * speed,
            math.hypot(settings.slip_part * self._wheels[2], settings.slip_turn_rad_per_m * speed),
        )
        a, b, c = (kept * s + fresh * size * z for s, size, z in zip(self._slip, sizes, drawn, strict=True))
        self._slip = (a, b, c)

    def drive(self, order: Order) -> None:
        """Queue an order, obey the one given a dead time ago, and set the body's velocity for a physics step."""
        self._waiting.append(order)
        self._order = now = self._waiting.popleft()
        self._turn_wheels(now)
        self._set_velocity()
        if now.pan_rad is not None:
            limit_rad, step_rad = self.spec.pan_limit_rad, self.spec.pan_rps * self._step_s
            wanted_rad = max(-limit_rad, min(limit_rad, now.pan_rad))
            self._pan_rad += max(-step_rad, min(step_rad, wanted_rad - self._pan_rad))

    def _turn_wheels(self, order: Order) -> None:
        """Change the wheels' velocity towards the order within the limits."""
        if order[:3] == self._wheels:
            return
        spec, dt = self.spec, self._step_s
        forward, left, turn = self._wheels
        want_f, want_l, want_turn = order[:3]
        speed = math.hypot(want_f, want_l)
        if speed > spec.max_speed_mps:
            want_f, want_l = want_f * spec.max_speed_mps / speed, want_l * spec.max_speed_mps / speed
            speed = spec.max_speed_mps
        df, dl = want_f - forward, want_l - left
        limit_mps2 = spec.speed_up_mps2 if speed >= math.hypot(forward, left) else spec.brake_mps2
        change, max_change = math.hypot(df, dl), limit_mps2 * dt
        if change > max_change:
            df, dl = df * max_change / change, dl * max_change / change
        want_turn = max(-spec.max_turn_rps, min(spec.max_turn_rps, want_turn))
        max_turn = (spec.turn_speed_up_rps2 if abs(want_turn) >= abs(turn) else spec.turn_brake_rps2) * dt
        turn += max(-max_turn, min(max_turn, want_turn - turn))
        self._wheels = (forward + df, left + dl, turn)

    def _set_velocity(self) -> None:
        """Set the body's velocity: the sum of the wheels' velocity, their slip, and a push."""
        forward, left, turn = self._wheels
        sf, sl, slip_turn = self._slip
        c, s = self._axis
        slip_x, slip_y = c * sf - s * sl, s * sf + c * sl
        if self._push_left:
            self._push_left -= 1
            px, py, pt = self._push
            slip_x, slip_y, slip_turn = slip_x + px, slip_y + py, slip_turn + pt
        self._slip_in_field = (slip_x, slip_y)
        self._velocity_before = (c * forward - s * left + slip_x, s * forward + c * left + slip_y, turn + slip_turn)
        # the physics engine's setters are slow, so they are called for changed values only
        if self._velocity_before[:2] != self._velocity_after[:2]:
            self.body.velocity = self._velocity_before[:2]
        if self._velocity_before[2] != self._velocity_after[2]:
            self.body.angular_velocity = self._velocity_before[2]

    def finish_step(self) -> None:
        """After a physics step, change the wheels' velocity by contacts, and integrate the odometry."""
        if self._steps_to_kick:
            self._steps_to_kick -= 1
        vx, vy = self.body.velocity
        self._velocity_after = (vx, vy, self.body.angular_velocity)
        if self.spec.turns_along:
            angle = self.body.angle
            self._axis = (math.cos(angle), math.sin(angle))
        if self._velocity_after != self._velocity_before:
            self._take_contact()
        if self.spec.turns_along:
            self._integrate_odometry()

    def _take_contact(self) -> None:
        """Change the wheels' velocity by that of a contact, less the slip towards the contact, which it stops first."""
        jx = self._velocity_after[0] - self._velocity_before[0]
        jy = self._velocity_after[1] - self._velocity_before[1]
        hit = math.hypot(jx, jy)
        x, y, turn = self._wheels
        if hit > 1e-9:
            nx, ny = jx / hit, jy / hit
            slip_stopped = min(hit, max(-(self._slip_in_field[0] * nx + self._slip_in_field[1] * ny), 0.0))
            jx, jy = nx * (hit - slip_stopped), ny * (hit - slip_stopped)
            c, s = self._axis
            x, y = x + c * jx + s * jy, y - s * jx + c * jy
        self._wheels = (x, y, turn + (self._velocity_after[2] - self._velocity_before[2]))

    def _integrate_odometry(self) -> None:
        forward, left, turn = self._wheels
        x, y, theta = self._odometry
        dt = self._step_s
        middle = theta + turn * self._turn_gain * dt / 2
        c, s = math.cos(middle) * self._gain * dt, math.sin(middle) * self._gain * dt
        theta += turn * self._turn_gain * dt
        self._odometry = (x + c * forward - s * left, y + s * forward + c * left, theta)

    @property
    def odometry(self) -> Pose2:
        """Motion since the control period began, in the robot frame at that time, measured by the wheels."""
        x, y, theta = self._odometry
        return Pose2(x, y, wrap_angle(theta))

    def holds(self, ball: BallBody) -> bool:
        """Return whether the ball interrupts the light barrier across the mouth; a ball in the air does not."""
        if ball.height_m > ball.radius_m:
            return False
        along, aside = self._ball_in_robot(ball)
        reach_m = self.spec.center_to_dribbler_m + (1 + _MOUTH_DEPTH) * ball.radius_m
        return 0 < along <= reach_m and abs(aside) <= self.spec.dribbler_width_m / 2

    def handle(self, ball: BallBody) -> float:
        """Dribble, kick or chip the ball as ordered if it lies in the mouth; return the speed of a kick, or 0."""
        wanted, rise_rad, dribbles = self._order[3:6]
        if not (dribbles or wanted > 0) or self._steps_to_kick or not self.holds(ball):
            return 0.0
        if wanted > 0:
            self._steps_to_kick = round(self._settings.kick_again_s / self._step_s)
            return self._kick(ball, wanted, rise_rad)
        self._dribble(ball)
        return 0.0

    def _kick(self, ball: BallBody, wanted_mps: float, rise_rad: float) -> float:
        spec, settings = self.spec, self._settings
        speed_error, angle_error = self._rng.standard_normal(2).tolist()
        limit_mps = spec.max_chip_mps if rise_rad > 0 else spec.max_kick_mps
        speed: float = min(wanted_mps, limit_mps) * (1 + settings.kick_speed_std * speed_error)
        aim = self.body.angle + settings.kick_angle_std_rad * angle_error
        vx, vy = self.body.velocity if spec.turns_along else (0.0, 0.0)
        along = speed * math.cos(rise_rad)
        ball.kick(vx + along * math.cos(aim), vy + along * math.sin(aim), speed * math.sin(rise_rad))
        return speed

    def _dribble(self, ball: BallBody) -> None:
        """Pull a ball in the mouth towards its seat, which turns with the robot."""
        along, aside = self._ball_in_robot(ball)
        seat_m = self.spec.center_to_dribbler_m + ball.radius_m
        angle, turn = self.body.angle, self.body.angular_velocity
        c, s = math.cos(angle), math.sin(angle)
        (vx, vy), (bx, by) = self.body.velocity, ball.body.velocity
        off_x, off_y = bx - (vx - turn * s * seat_m), by - (vy + turn * c * seat_m)
        to_f, to_l = seat_m - along, -aside
        ax = _STIFFNESS_PS2 * (c * to_f - s * to_l) - _DAMPING_PS * off_x
        ay = _STIFFNESS_PS2 * (s * to_f + c * to_l) - _DAMPING_PS * off_y
        pull = math.hypot(ax, ay)
        scale = min(1.0, _GRIP_MPS2 / pull) if pull else 0.0
        ball.pull(ax * scale, ay * scale, self._step_s)

    def _ball_in_robot(self, ball: BallBody) -> tuple[float, float]:
        """Return the ball's position in the robot frame: ahead and left, metres."""
        (x, y), (bx, by) = self.body.position, ball.body.position
        c, s = math.cos(self.body.angle), math.sin(self.body.angle)
        return c * (bx - x) + s * (by - y), -s * (bx - x) + c * (by - y)


def _hull(body: pymunk.Body, spec: RobotSpec) -> pymunk.Shape:
    """Return the robot's outline: a disc, cut off at the front if that is flat."""
    if spec.center_to_dribbler_m >= spec.radius_m:
        return pymunk.Circle(body, spec.radius_m)
    half_rad = math.acos(spec.center_to_dribbler_m / spec.radius_m)
    angles = np.linspace(half_rad, math.tau - half_rad, _OUTLINE_CORNERS).tolist()
    return pymunk.Poly(body, [(spec.radius_m * math.cos(a), spec.radius_m * math.sin(a)) for a in angles])
