"""Moves one robot's body: an omni-drive disc with dead time, limits, slipping wheels, a dribbler and a kicker."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import pymunk

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.robot_link import Command, RobotLimits
from sim2d.world.ball_physics import BallBody
from sim2d.world.state import RobotState


@dataclass(frozen=True, slots=True)
class Mouth:
    """The mouth of one kind of robot."""

    #: From the robot's centre ahead to the centre of a ball that touches its front.
    seat_m: float
    #: To either side of straight ahead.
    half_width_m: float
    #: A ball that lies so far before its seat is still in the mouth.
    depth_m: float = 0.011
    #: The dribbler pulls the ball to its seat like a damped spring.
    stiffness_ps2: float = 900.0
    damping_ps: float = 50.0
    #: Largest acceleration that the dribbler gives it.
    grip_mps2: float = 6.0

    def holds(self, robot: pymunk.Body, ball: BallBody) -> bool:
        """Return whether the ball interrupts the light barrier across the mouth of a robot; one in the air does not."""
        if ball.height_m > ball.radius_m:
            return False
        along, aside = in_robot(robot, ball)
        return 0 < along <= self.seat_m + self.depth_m and abs(aside) <= self.half_width_m

    def dribble(self, robot: pymunk.Body, ball: BallBody, dt_s: float) -> None:
        """Draw a ball in the mouth towards its seat, which turns with the robot."""
        along, aside = in_robot(robot, ball)
        angle, turn = robot.angle, robot.angular_velocity
        c, s = math.cos(angle), math.sin(angle)
        vx, vy = robot.velocity
        bx, by = ball.body.velocity
        off_x, off_y = bx - (vx - turn * s * self.seat_m), by - (vy + turn * c * self.seat_m)
        to_f, to_l = self.seat_m - along, -aside
        k, d = self.stiffness_ps2, self.damping_ps
        ax = k * (c * to_f - s * to_l) - d * off_x
        ay = k * (s * to_f + c * to_l) - d * off_y
        pull = math.hypot(ax, ay)
        kept = min(1.0, self.grip_mps2 / pull) if pull else 0.0
        ball.pull(ax * kept, ay * kept, dt_s)


def in_robot(robot: pymunk.Body, ball: BallBody) -> tuple[float, float]:
    """Return where the ball is, ahead and left of a robot's centre."""
    (x, y), (bx, by) = robot.position, ball.body.position
    c, s = math.cos(robot.angle), math.sin(robot.angle)
    return c * (bx - x) + s * (by - y), -s * (bx - x) + c * (by - y)


@dataclass(frozen=True, slots=True)
class BodySettings:
    """Values of `RobotBody`."""

    #: Mass of a small robot.
    mass_kg: float = 2.5
    #: Systematic error of the odometry's way and turn, drawn once a robot: wheels are never quite round.
    gain_std: float = 0.01
    #: Slip's standard deviation as a part of the speed.
    slip_part: float = 0.05
    #: The same for turning, per metre driven.
    slip_turn_rad_per_m: float = 0.05
    #: Slip is correlated over this time.
    slip_time_s: float = 0.1
    #: Size of the dribbler's mouth, in ball radii.
    mouth_half_width: float = 1.5
    mouth_depth: float = 0.5
    #: Time to charge the kicker.
    kick_again_s: float = 0.5
    #: Standard deviation of a kick's speed, as a fraction of it.
    kick_speed_std: float = 0.05
    #: Standard deviation of a kick's direction.
    kick_angle_std_rad: float = math.radians(1.5)
    #: A push from outside takes so long.
    push_s: float = 0.2


class RobotBody:
    """A robot in a pymunk space.

    Wheels follow the command within the limits (Sekimori et al. 2001, eq. 10) after the dead time. The body moves as
    the wheels turn plus their slip, which odometry does not measure. Contacts turn the wheels.

    Parameters
    ----------
    index, side, number : int
        As in `RobotState`.
    rng : numpy.random.Generator
        Draws its odometry's systematic error here.
    """

    def __init__(
        self,
        space: pymunk.Space,
        index: int,
        side: int,
        number: int,
        limits: RobotLimits,
        step_s: float,
        collision_type: int,
        rng: np.random.Generator,
        settings: BodySettings = BodySettings(),
    ) -> None:
        self._settings = settings
        self.index, self.side, self.number = index, side, number
        self.limits = limits
        self.body = pymunk.Body(settings.mass_kg, pymunk.moment_for_circle(settings.mass_kg, 0, limits.radius_m))
        self.shape = pymunk.Circle(self.body, limits.radius_m)
        self.shape.elasticity, self.shape.friction = 0.1, 0.1
        self.shape.collision_type = collision_type
        space.add(self.body, self.shape)
        self._step_s = step_s
        self._gain, self._turn_gain = (1 + settings.gain_std * rng.standard_normal(2)).tolist()
        self._waiting: deque[Command] = deque([Command()] * round(limits.dead_time_s / step_s))
        self.command = Command()
        self._wheels = (0.0, 0.0, 0.0)  # forward, left, turn
        self._slip = (0.0, 0.0, 0.0)
        self._push = (0.0, 0.0, 0.0)  # field frame, turn
        self._push_left = 0
        self._set = (0.0, 0.0, 0.0)  # body velocity before contacts, field frame
        self._slip_in_field = (0.0, 0.0, 0.0)
        self._odometry = (0.0, 0.0, 0.0)
        self._steps_to_kick = 0
        self.pan_rad = 0.0

    @property
    def pose(self) -> Pose2:
        """Field frame."""
        x, y = self.body.position
        return Pose2(x, y, self.body.angle)

    @property
    def state(self) -> RobotState:
        """Pose and velocity."""
        vx, vy = self.body.velocity
        return RobotState(
            self.index, self.side, self.number, self.pose, (vx, vy), self.body.angular_velocity, self.pan_rad
        )

    def place(self, pose: Pose2) -> None:
        """Put it somewhere, at rest; odometry does not measure that."""
        self.body.position = (pose.x_m, pose.y_m)
        self.body.angle = pose.theta_rad
        self.body.velocity, self.body.angular_velocity = (0.0, 0.0), 0.0
        self._wheels = self._slip = (0.0, 0.0, 0.0)
        self._push_left = 0

    def push(self, dx_m: float, dy_m: float, turn_rad: float) -> None:
        """Push it by a way (field frame) and an angle, wheels slipping; odometry does not measure that."""
        push_s = self._settings.push_s
        self._push = (dx_m / push_s, dy_m / push_s, turn_rad / push_s)
        self._push_left = round(push_s / self._step_s)

    def begin_period(self, period_s: float, drawn: tuple[float, float, float]) -> None:
        """Start a control period: odometry from zero, new slip from three standard normal draws."""
        self._odometry = (0.0, 0.0, 0.0)
        settings = self._settings
        kept = math.exp(-period_s / settings.slip_time_s)
        fresh = math.sqrt(1 - kept * kept)
        speed = math.hypot(self._wheels[0], self._wheels[1])
        sizes = (
            settings.slip_part * speed,
            settings.slip_part * speed,
            math.hypot(settings.slip_part * self._wheels[2], settings.slip_turn_rad_per_m * speed),
        )
        a, b, c = (kept * s + fresh * size * z for s, size, z in zip(self._slip, sizes, drawn, strict=True))
        self._slip = (a, b, c)

    def drive(self, command: Command) -> None:
        """Queue a command, obey the one of a dead time ago, and set the body's velocity for a physics step."""
        self._waiting.append(command)
        self.command = now = self._waiting.popleft()
        self._turn_wheels(now)
        self._set_velocity()
        if now.pan_rad is not None:
            limits = self.limits
            want_pan = max(-limits.pan_limit_rad, min(limits.pan_limit_rad, now.pan_rad))
            max_pan = limits.pan_rps * self._step_s
            self.pan_rad += max(-max_pan, min(max_pan, want_pan - self.pan_rad))

    def _turn_wheels(self, now: Command) -> None:
        """Change the wheels' velocity towards the command within the limits."""
        limits, dt = self.limits, self._step_s
        forward, left, turn = self._wheels
        want_f, want_l = now.forward_mps, now.left_mps
        speed = math.hypot(want_f, want_l)
        if speed > limits.speed_mps:
            want_f, want_l = want_f * limits.speed_mps / speed, want_l * limits.speed_mps / speed
        df, dl = want_f - forward, want_l - left
        change, max_change = math.hypot(df, dl), limits.acceleration_mps2 * dt
        if change > max_change:
            df, dl = df * max_change / change, dl * max_change / change
        max_turn = limits.turn_acceleration_rps2 * dt
        want_turn = max(-limits.turn_rps, min(limits.turn_rps, now.turn_rps))
        turn += max(-max_turn, min(max_turn, want_turn - turn))
        forward, left = forward + df, left + dl
        self._wheels = (forward, left, turn)

    def _set_velocity(self) -> None:
        """Set the body's velocity: that of the wheels, their slip, and a push."""
        forward, left, turn = self._wheels
        sf, sl, st = self._slip
        angle = self.body.angle
        c, s = math.cos(angle), math.sin(angle)
        slip_x, slip_y, slip_turn = c * sf - s * sl, s * sf + c * sl, st
        if self._push_left:
            self._push_left -= 1
            px, py, pt = self._push
            slip_x, slip_y, slip_turn = slip_x + px, slip_y + py, slip_turn + pt
        self._slip_in_field = (slip_x, slip_y, slip_turn)
        self._set = (c * forward - s * left + slip_x, s * forward + c * left + slip_y, turn + slip_turn)
        self.body.velocity = self._set[:2]
        self.body.angular_velocity = self._set[2]

    def finish_step(self) -> None:
        """Let contacts turn the wheels after a physics step, and integrate the odometry."""
        self._steps_to_kick = max(self._steps_to_kick - 1, 0)
        vx, vy = self.body.velocity
        jx, jy = vx - self._set[0], vy - self._set[1]
        hit = math.hypot(jx, jy)
        angle = self.body.angle
        forward, left, turn = self._wheels
        if hit > 1e-9:
            # a contact stops what slips towards it first, then the wheels
            nx, ny = jx / hit, jy / hit
            taken_up = min(hit, max(-(self._slip_in_field[0] * nx + self._slip_in_field[1] * ny), 0.0))
            jx, jy = nx * (hit - taken_up), ny * (hit - taken_up)
            c, s = math.cos(angle), math.sin(angle)
            forward, left = forward + c * jx + s * jy, left - s * jx + c * jy
        turn += self.body.angular_velocity - self._set[2]
        self._wheels = (forward, left, turn)
        x, y, theta = self._odometry
        dt = self._step_s
        middle = theta + turn * self._turn_gain * dt / 2
        c, s = math.cos(middle) * self._gain * dt, math.sin(middle) * self._gain * dt
        theta += turn * self._turn_gain * dt
        self._odometry = (x + c * forward - s * left, y + s * forward + c * left, theta)

    @property
    def odometry(self) -> Pose2:
        """Motion since the control period began, in the robot frame of then, measured by the wheels."""
        x, y, theta = self._odometry
        return Pose2(x, y, wrap_angle(theta))

    def holds(self, ball: BallBody) -> bool:
        """Return whether the ball interrupts the light barrier across the mouth."""
        return self._mouth(ball).holds(self.body, ball)

    def handle(self, ball: BallBody, rng: np.random.Generator) -> float:
        """Dribble or kick the ball if it lies in the mouth; return the speed of a kick, or 0."""
        settings, wanted = self._settings, self.command.kick_mps
        if not (self.command.dribble or wanted > 0) or not self.holds(ball):
            return 0.0
        angle = self.body.angle
        vx, vy = self.body.velocity
        if wanted > 0 and not self._steps_to_kick:
            self._steps_to_kick = round(settings.kick_again_s / self._step_s)
            hard, askew = rng.standard_normal(2).tolist()
            speed = min(wanted, self.limits.kick_speed_mps) * (1 + settings.kick_speed_std * hard)
            aim = angle + settings.kick_angle_std_rad * askew
            ball.kick(vx + speed * math.cos(aim), vy + speed * math.sin(aim))
            return float(speed)
        if self.command.dribble and not self._steps_to_kick:
            self._mouth(ball).dribble(self.body, ball, self._step_s)
        return 0.0

    def _mouth(self, ball: BallBody) -> Mouth:
        settings, radius_m = self._settings, ball.radius_m
        half_width_m, depth_m = settings.mouth_half_width * radius_m, settings.mouth_depth * radius_m
        return Mouth(self.limits.radius_m + radius_m, half_width_m, depth_m)


def check_command(command: Command) -> None:
    """Refuse a command that no robot can obey.

    Raises
    ------
    ArgumentError
        If one of its numbers is not finite.
    """
    for name in ("forward_mps", "left_mps", "turn_rps", "kick_mps", "pan_rad"):
        value = getattr(command, name)
        if value is not None and not math.isfinite(value):
            raise ArgumentError(f"a command's {name} must be finite, got {value}")
