"""One robot of the league: its measures and limits, the command it obeys, its kicker and dribbler.

Velocity follows the command within the limits, and what pushes the robot slows it as it would a real one. A robot that
has had no command for a tenth of a second brakes until it stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pymunk

from robocup_vision.geometry import Pose2
from robocup_vision.ssl.values.simulation import MoveCommand, RobotCommand, Team
from sim2d.world.ball_physics import BallBody
from sim2d.world.robot_body import Mouth

COMMAND_LASTS_S = 0.1
# a capacitor needs so long until it kicks again
KICK_AGAIN_S = 0.1
_OUTLINE_CORNERS = 15


@dataclass(frozen=True, slots=True)
class LeagueRobotSpec:
    """What a robot is like; the defaults are those of a fast robot of division B."""

    #: Of its hull.
    radius_m: float = 0.09
    height_m: float = 0.15
    mass_kg: float = 2.5
    #: From its centre to its flat front.
    center_to_dribbler_m: float = 0.075
    #: Of the mouth in that front.
    dribbler_width_m: float = 0.07
    #: Largest speed that a straight kick, and a chip, gives the ball.
    max_kick_mps: float = 8.0
    max_chip_mps: float = 8.0
    #: Largest accelerations, in any direction.
    speed_up_mps2: float = 4.0
    brake_mps2: float = 6.0
    turn_speed_up_rps2: float = 50.0
    turn_brake_rps2: float = 50.0
    #: Largest velocities, in any direction.
    max_speed_mps: float = 4.0
    max_turn_rps: float = 20.0
    #: Of front right, back right, back left and front left wheel, counter-clockwise from straight ahead; a
    #: wheel drives counter-clockwise about the robot's centre.
    wheel_angles_rad: tuple[float, float, float, float] = (
        math.radians(-60),
        math.radians(-135),
        math.radians(135),
        math.radians(60),
    )

    def body_velocity(self, rim_mps: tuple[float, float, float, float]) -> tuple[float, float, float]:
        """Return forward, left and turning velocity that fit the wheels' rim speeds best (least squares)."""
        matrix = [[-math.sin(angle), math.cos(angle), self.radius_m] for angle in self.wheel_angles_rad]
        forward, left, turn = np.linalg.lstsq(np.array(matrix), np.array(rim_mps), rcond=None)[0].tolist()
        return forward, left, turn


class LeagueRobot:
    """A robot in a pymunk space."""

    def __init__(self, space: pymunk.Space, team: Team, number: int, spec: LeagueRobotSpec, pose: Pose2) -> None:
        self.team, self.number, self.spec = team, number, spec
        self._space = space
        moment = pymunk.moment_for_circle(spec.mass_kg, 0, spec.radius_m)
        self.body = pymunk.Body(spec.mass_kg, moment)
        # the hull: a disc cut off at its flat front
        half_rad = math.acos(min(spec.center_to_dribbler_m / spec.radius_m, 1.0))
        angles = np.linspace(half_rad, math.tau - half_rad, _OUTLINE_CORNERS).tolist()
        outline = [(spec.radius_m * math.cos(a), spec.radius_m * math.sin(a)) for a in angles]
        self.shape = pymunk.Poly(self.body, outline)
        self.shape.elasticity, self.shape.friction = 0.1, 0.1
        space.add(self.body, self.shape)
        self._mouth: Mouth | None = None
        self._move: MoveCommand | None = None
        self._kick_mps = self._kick_angle_rad = self._dribbler_rps = 0.0
        self._obeys_until_s = -math.inf
        self._kicks_again_s = -math.inf
        # rolled along by its wheels: forward, left, turn by a wheel command, computed once
        self._rolled = (0.0, 0.0, 0.0)
        self.place(pose)

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

    def place(self, pose: Pose2, velocity_mps: tuple[float, float] = (0.0, 0.0), turn_rps: float = 0.0) -> None:
        """Put it somewhere, moving in the field frame."""
        self.body.position = (pose.x_m, pose.y_m)
        self.body.angle = pose.theta_rad
        self.body.velocity, self.body.angular_velocity = velocity_mps, turn_rps
        self._space.reindex_shapes_for_body(self.body)

    def remove(self) -> None:
        """Take it off the field."""
        self._space.remove(self.shape, self.body)

    def obey(self, command: RobotCommand, t_s: float) -> None:
        """Take a command at a time; what it leaves out stays as it was."""
        if command.move is not None:
            self._move = command.move
            wheels = command.move.wheels
            if wheels is not None:
                self._rolled = self.spec.body_velocity(
                    (wheels.front_right_mps, wheels.back_right_mps, wheels.back_left_mps, wheels.front_left_mps)
                )
        if command.kick_mps is not None:
            self._kick_mps = command.kick_mps
        if command.kick_angle_rad is not None:
            self._kick_angle_rad = command.kick_angle_rad
        if command.dribbler_rps is not None:
            self._dribbler_rps = command.dribbler_rps
        self._obeys_until_s = t_s + COMMAND_LASTS_S

    def drive(self, t_s: float, dt_s: float) -> None:
        """Set the body's velocity for a physics step."""
        body, spec = self.body, self.spec
        vx, vy = body.velocity
        turn = body.angular_velocity
        move = self._move
        if t_s > self._obeys_until_s or move is None:
            if t_s > self._obeys_until_s:
                # old values must not come back with a later command that leaves them out
                self._move, self._kick_mps, self._kick_angle_rad, self._dribbler_rps = None, 0.0, 0.0, 0.0
            if vx == vy == turn == 0:
                return
            want_x, want_y, want_turn = 0.0, 0.0, 0.0
        elif move.world is not None:
            want_x, want_y, want_turn = move.world.x_mps, move.world.y_mps, move.world.turn_rps
        else:
            forward, left, want_turn = self._rolled
            if move.local is not None:
                forward, left, want_turn = move.local.forward_mps, move.local.left_mps, move.local.turn_rps
            angle = body.angle
            c, s = math.cos(angle), math.sin(angle)
            want_x, want_y = c * forward - s * left, s * forward + c * left
        speed = math.hypot(want_x, want_y)
        if speed > spec.max_speed_mps:
            want_x, want_y, speed = (
                want_x * spec.max_speed_mps / speed,
                want_y * spec.max_speed_mps / speed,
                spec.max_speed_mps,
            )
        most = (spec.speed_up_mps2 if speed >= math.hypot(vx, vy) else spec.brake_mps2) * dt_s
        dx, dy = want_x - vx, want_y - vy
        change = math.hypot(dx, dy)
        if change > most:
            dx, dy = dx * most / change, dy * most / change
        # the engine's setters take most of a step's time
        if change > 0:
            body.velocity = (vx + dx, vy + dy)
        want_turn = max(-spec.max_turn_rps, min(spec.max_turn_rps, want_turn))
        max_turn = (spec.turn_speed_up_rps2 if abs(want_turn) >= abs(turn) else spec.turn_brake_rps2) * dt_s
        if want_turn != turn:
            body.angular_velocity = turn + max(-max_turn, min(max_turn, want_turn - turn))

    def mouth(self, ball: BallBody) -> Mouth:
        """Its mouth for a ball."""
        if self._mouth is None:
            self._mouth = Mouth(self.spec.center_to_dribbler_m + ball.radius_m, self.spec.dribbler_width_m / 2)
        return self._mouth

    def touches(self, ball: BallBody) -> bool:
        """Return whether the ball interrupts the light barrier across its mouth."""
        return self.mouth(ball).holds(self.body, ball)

    def handle(self, ball: BallBody, t_s: float, dt_s: float) -> bool:
        """Kick, chip or dribble the ball, as commanded, if it lies in the mouth; return whether it was kicked."""
        kicks = self._kick_mps > 0 and t_s >= self._kicks_again_s
        if not (kicks or self._dribbler_rps > 0) or not self.touches(ball):
            return False
        if kicks:
            rise_rad = min(max(self._kick_angle_rad, 0.0), math.pi / 2)
            speed = min(self._kick_mps, self.spec.max_chip_mps if rise_rad > 0 else self.spec.max_kick_mps)
            # the league's kick speed is that of the ball over the carpet, whatever the robot does
            along, angle = speed * math.cos(rise_rad), self.body.angle
            ball.kick(along * math.cos(angle), along * math.sin(angle), speed * math.sin(rise_rad))
            self._kicks_again_s = t_s + KICK_AGAIN_S
        elif t_s >= self._kicks_again_s:
            self.mouth(ball).dribble(self.body, ball, dt_s)
        return kicks
