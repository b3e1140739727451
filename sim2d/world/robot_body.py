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
# a ball that lies so far before its seat, in its radii, is still in the mouth
_MOUTH_DEPTH = 0.5
# the dribbler pulls the ball to its seat like a damped spring, up to a largest acceleration
_STIFFNESS_PS2, _DAMPING_PS, _GRIP_MPS2 = 900.0, 50.0, 6.0

# slip is correlated over this time
_SLIP_TIME_S = 0.1
# a push from outside takes so long
_PUSH_S = 0.2


class Order(NamedTuple):
    """What a robot shall do in a physics step."""

    #: Wanted velocity: forward and left of a robot whose velocity turns along with it, else along the field's axes.
    x_mps: float = 0.0
    y_mps: float = 0.0
    turn_rps: float = 0.0
    #: Speed to kick the ball with; 0: it does not kick.
    kick_mps: float = 0.0
    #: From the carpet upwards.
    kick_rise_rad: float = 0.0
    dribbles: bool = False
    #: Wanted pan of the head; None: as it is.
    pan_rad: float | None = None


class RobotBody:
    """A robot in a pymunk space.

    Wheels follow the order within the limits (Sekimori et al. 2001, eq. 10) after the dead time. The body moves as
    the wheels turn plus their slip, which odometry does not measure. Contacts turn the wheels.

    Parameters
    ----------
    place : (int, int, int)
        Its index in its world, its side and its number there.
    rng : numpy.random.Generator
        Draws its odometry's systematic error here, and the errors of its kicks.
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
        self._wheels = (0.0, 0.0, 0.0)  # in the frame of its orders
        self._slip = (0.0, 0.0, 0.0)
        self._push = (0.0, 0.0, 0.0)  # field frame, turn
        self._push_left = 0
        self._set = (0.0, 0.0, 0.0)  # body velocity before contacts, field frame
        self._moves = (0.0, 0.0, 0.0)  # and after them
        self._axis = (1.0, 0.0)  # of the frame of its orders
        self._slip_in_field = (0.0, 0.0)
        self._odometry = (0.0, 0.0, 0.0)
        self._steps_to_kick = 0

    @property
    def pose(self) -> Pose2:
        """Field frame."""
        x, y = self.body.position
        return Pose2(x, y, self.body.angle)

    @property
    def motion(self) -> tuple[float, float, float]:
        """How it moves, robot frame: forward, left, turn."""
        (vx, vy), c, s = self.body.velocity, math.cos(self.body.angle), math.sin(self.body.angle)
        return c * vx + s * vy, c * vy - s * vx, self.body.angular_velocity

    def state(self, index: int) -> RobotState:
        """Return its state, with its place among all robots."""
        vx, vy = self.body.velocity
        spec, turn = self.spec, self.body.angular_velocity
        return RobotState(
            index, self.side, self.number, self.pose, (vx, vy), turn, self._pan_rad, spec.radius_m, spec.height_m
        )

    def place(self, pose: Pose2, velocity_mps: tuple[float, float] = (0.0, 0.0), turn_rps: float = 0.0) -> None:
        """Put it somewhere, moving in the field frame; odometry does not measure that."""
        self.body.position = (pose.x_m, pose.y_m)
        self.body.angle = pose.theta_rad
        self.body.velocity, self.body.angular_velocity = velocity_mps, turn_rps
        self._moves = (*velocity_mps, turn_rps)
        if self.spec.turns_along:
            self._axis = (math.cos(pose.theta_rad), math.sin(pose.theta_rad))
        (vx, vy), (c, s) = velocity_mps, self._axis
        self._wheels = (c * vx + s * vy, c * vy - s * vx, turn_rps)
        self._slip = (0.0, 0.0, 0.0)
        self._push_left = 0

    def remove(self) -> None:
        """Take it off the field."""
        self._space.remove(self.shape, self.body)

    def push(self, dx_m: float, dy_m: float, turn_rad: float) -> None:
        """Push it by a way (field frame) and an angle, wheels slipping; odometry does not measure that."""
        self._push = (dx_m / _PUSH_S, dy_m / _PUSH_S, turn_rad / _PUSH_S)
        self._push_left = round(_PUSH_S / self._step_s)

    def begin_period(self, drawn: tuple[float, float, float]) -> None:
        """Start a control period: odometry from zero, new slip from three standard normal draws."""
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
        """Queue an order, obey the one of a dead time ago, and set the body's velocity for a physics step."""
        self._waiting.append(order)
        self._order = now = self._waiting.popleft()
        self._turn_wheels(now)
        self._set_velocity()
        if now.pan_rad is not None:
            most_rad, max_pan = self.spec.pan_limit_rad, self.spec.pan_rps * self._step_s
            want_pan = max(-most_rad, min(most_rad, now.pan_rad))
            self._pan_rad += max(-max_pan, min(max_pan, want_pan - self._pan_rad))

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
        most = spec.speed_up_mps2 if speed >= math.hypot(forward, left) else spec.brake_mps2
        change, max_change = math.hypot(df, dl), most * dt
        if change > max_change:
            df, dl = df * max_change / change, dl * max_change / change
        want_turn = max(-spec.max_turn_rps, min(spec.max_turn_rps, want_turn))
        max_turn = (spec.turn_speed_up_rps2 if abs(want_turn) >= abs(turn) else spec.turn_brake_rps2) * dt
        turn += max(-max_turn, min(max_turn, want_turn - turn))
        self._wheels = (forward + df, left + dl, turn)

    def _set_velocity(self) -> None:
        """Set the body's velocity: that of the wheels, their slip, and a push."""
        forward, left, turn = self._wheels
        sf, sl, slip_turn = self._slip
        c, s = self._axis
        slip_x, slip_y = c * sf - s * sl, s * sf + c * sl
        if self._push_left:
            self._push_left -= 1
            px, py, pt = self._push
            slip_x, slip_y, slip_turn = slip_x + px, slip_y + py, slip_turn + pt
        self._slip_in_field = (slip_x, slip_y)
        self._set = (c * forward - s * left + slip_x, s * forward + c * left + slip_y, turn + slip_turn)
        # the engine's setters take most of a step's time
        if self._set[:2] != self._moves[:2]:
            self.body.velocity = self._set[:2]
        if self._set[2] != self._moves[2]:
            self.body.angular_velocity = self._set[2]

    def finish_step(self) -> None:
        """Let contacts turn the wheels after a physics step; wheels that turn along measure the way."""
        if self._steps_to_kick:
            self._steps_to_kick -= 1
        vx, vy = self.body.velocity
        self._moves = (vx, vy, self.body.angular_velocity)
        if self.spec.turns_along:
            angle = self.body.angle
            self._axis = (math.cos(angle), math.sin(angle))
        if self._moves != self._set:
            self._take_contact()
        if self.spec.turns_along:
            self._measure()

    def _take_contact(self) -> None:
        """Turn the wheels by what a contact has changed: it stops what slips towards it first."""
        jx, jy = self._moves[0] - self._set[0], self._moves[1] - self._set[1]
        hit = math.hypot(jx, jy)
        x, y, turn = self._wheels
        if hit > 1e-9:
            nx, ny = jx / hit, jy / hit
            taken_up = min(hit, max(-(self._slip_in_field[0] * nx + self._slip_in_field[1] * ny), 0.0))
            jx, jy = nx * (hit - taken_up), ny * (hit - taken_up)
            c, s = self._axis
            x, y = x + c * jx + s * jy, y - s * jx + c * jy
        self._wheels = (x, y, turn + (self._moves[2] - self._set[2]))

    def _measure(self) -> None:
        """Integrate the odometry."""
        forward, left, turn = self._wheels
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
        """Return whether the ball interrupts the light barrier across the mouth; one in the air does not."""
        if ball.height_m > ball.radius_m:
            return False
        along, aside = self._from_here(ball)
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
        hard, askew = self._rng.standard_normal(2).tolist()
        most = spec.max_chip_mps if rise_rad > 0 else spec.max_kick_mps
        speed: float = min(wanted_mps, most) * (1 + settings.kick_speed_std * hard)
        aim = self.body.angle + settings.kick_angle_std_rad * askew
        vx, vy = self.body.velocity if spec.turns_along else (0.0, 0.0)
        along = speed * math.cos(rise_rad)
        ball.kick(vx + along * math.cos(aim), vy + along * math.sin(aim), speed * math.sin(rise_rad))
        return speed

    def _dribble(self, ball: BallBody) -> None:
        """Draw a ball in the mouth towards its seat, which turns with the robot."""
        along, aside = self._from_here(ball)
        seat_m = self.spec.center_to_dribbler_m + ball.radius_m
        angle, turn = self.body.angle, self.body.angular_velocity
        c, s = math.cos(angle), math.sin(angle)
        (vx, vy), (bx, by) = self.body.velocity, ball.body.velocity
        off_x, off_y = bx - (vx - turn * s * seat_m), by - (vy + turn * c * seat_m)
        to_f, to_l = seat_m - along, -aside
        ax = _STIFFNESS_PS2 * (c * to_f - s * to_l) - _DAMPING_PS * off_x
        ay = _STIFFNESS_PS2 * (s * to_f + c * to_l) - _DAMPING_PS * off_y
        pull = math.hypot(ax, ay)
        kept = min(1.0, _GRIP_MPS2 / pull) if pull else 0.0
        ball.pull(ax * kept, ay * kept, self._step_s)

    def _from_here(self, ball: BallBody) -> tuple[float, float]:
        """Return where the ball is, ahead and left of the robot's centre."""
        (x, y), (bx, by) = self.body.position, ball.body.position
        c, s = math.cos(self.body.angle), math.sin(self.body.angle)
        return c * (bx - x) + s * (by - y), -s * (bx - x) + c * (by - y)


def _hull(body: pymunk.Body, spec: RobotSpec) -> pymunk.Shape:
    """Return a disc, cut off at its front where that is flat."""
    if spec.center_to_dribbler_m >= spec.radius_m:
        return pymunk.Circle(body, spec.radius_m)
    half_rad = math.acos(spec.center_to_dribbler_m / spec.radius_m)
    angles = np.linspace(half_rad, math.tau - half_rad, _OUTLINE_CORNERS).tolist()
    return pymunk.Poly(body, [(spec.radius_m * math.cos(a), spec.radius_m * math.sin(a)) for a in angles])
