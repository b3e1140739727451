"""The truth of the league's simulator: robots of two teams by their numbers, and one ball that may fly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.values.simulation import MoveCommand, RobotCommand, Team, WheelVelocities
from sim2d.world.ball_physics import Flight
from sim2d.world.physics import STEP_S, Physics
from sim2d.world.robot_body import Order, RobotBody
from sim2d.world.robot_spec import PERFECT, RobotSpec
from sim2d.world.state import BallState, RobotState

STEPS_PER_S = round(1 / STEP_S)
MAX_NUMBER = 15
# yellow plays towards +x, as sim2d's side +1 does
SIDES = {Team.YELLOW: 1, Team.BLUE: -1}
TEAM_OF = {side: team for team, side in SIDES.items()}
_APART_M = 0.002
# a robot that has had no command for this time brakes to a stop
COMMAND_LASTS_S = 0.1
_STAND = Order()
# a ball counts as kicked until it is slower than this, or another robot comes this near to it
_STILL_MPS, _TOUCH_M = 0.05, 0.005


@dataclass(frozen=True, slots=True)
class Kick:
    """A kick: the robot, the time, and the ball's state just after it."""

    team: Team
    number: int
    t_s: float
    ball: BallState


@dataclass(frozen=True, slots=True)
class LeagueState:
    """The true state at one moment: robots, yellow first, by number; ball; last kick, None once its effect is over."""

    t_s: float
    robots: tuple[RobotState, ...]
    ball: BallState
    kick: Kick | None = None


class LeagueWorld:
    """A field with a ball and robots. Methods that name a robot raise `ArgumentError` if it is not on the field.

    Attributes
    ----------
    steps : int
        Number of physics steps since the start.
    flight : Flight
        Parameters of a chipped ball's flight.
    """

    def __init__(self, field: Field, flight: Flight) -> None:
        self._specs: dict[int, RobotSpec] = {}
        self._orders: dict[int, HeldOrders] = {}
        self.steps = 0
        self._build(field, flight)

    def _build(self, field: Field, flight: Flight) -> None:
        self.field, self.flight = field, flight
        self._physics = Physics(field)
        self._robots = self._physics.robots
        self._ball = self._physics.add_ball(flight=flight)
        self._kick: Kick | None = None

    @property
    def t_s(self) -> float:
        """Time since the start."""
        return self.steps / STEPS_PER_S

    @property
    def ball(self) -> BallState:
        """Position and velocity of the ball."""
        return self._ball.state

    @property
    def state(self) -> LeagueState:
        """The true state of everything."""
        robots = tuple(self._robots[key].state(index) for index, key in enumerate(sorted(self._robots)))
        return LeagueState(self.t_s, robots, self._ball.state, self._kick_of(self._ball.state))

    def step(self) -> None:
        """Advance by one physics step."""
        t_s = self.t_s
        orders = [self._orders[key].at(t_s, robot) for key, robot in self._robots.items()]
        for event in self._physics.step(orders, t_s):
            if event.kind == "kick" and self._physics.kicked is not None:
                kicker = self._robots[event.robots[0]]
                self._kick = Kick(TEAM_OF[kicker.side], kicker.number, t_s, self._physics.kicked)
        self.steps += 1

    def _kick_of(self, ball: BallState) -> Kick | None:
        """Return the last kick while its ball rolls or flies and no other robot has touched it."""
        kick = self._kick
        if kick is None:
            return None
        touched = any(
            ball.z_m < robot.spec.height_m
            and math.hypot(robot.pose.x_m - ball.x_m, robot.pose.y_m - ball.y_m)
            < robot.spec.radius_m + self.field.ball_radius_m + _TOUCH_M
            for key, robot in self._robots.items()
            if key != _key(kick.team, kick.number)
        )
        if math.hypot(ball.vx_mps, ball.vy_mps) < _STILL_MPS or touched:
            self._kick = None
        return self._kick

    def has(self, team: Team, number: int) -> bool:
        """Whether a robot is on the field."""
        return _key(team, number) in self._robots

    def robot(self, team: Team, number: int) -> RobotBody:
        """Return a robot."""
        if not self.has(team, number):
            raise ArgumentError(f"there is no robot {number} of {team.name.lower()} on the field")
        return self._robots[_key(team, number)]

    def add(self, team: Team, number: int, pose: Pose2) -> RobotBody:
        """Put a robot on the field; raises `ArgumentError` for a wrong team or number, or if it is there already."""
        if team not in SIDES or not 0 <= number <= MAX_NUMBER:
            raise ArgumentError(f"there is no robot {number} of {team!r}: numbers are 0 to {MAX_NUMBER}")
        if self.has(team, number):
            raise ArgumentError(f"robot {number} of {team.name.lower()} is on the field already")
        key, spec, pose = _key(team, number), self.spec(team, number), self._apart(team, number, pose)
        self._orders[key] = HeldOrders(spec)
        # a perfect body has no random errors, so the generator has no effect
        return self._physics.add((key, SIDES[team], number), pose, spec, PERFECT, np.random.default_rng(0))

    def place(
        self,
        team: Team,
        number: int,
        pose: Pose2,
        velocity_mps: tuple[float, float] = (0.0, 0.0),
        turn_rps: float = 0.0,
    ) -> None:
        """Move a robot that is on the field to a pose, with a velocity in the field frame."""
        self.robot(team, number).place(self._apart(team, number, pose), velocity_mps, turn_rps)

    def _apart(self, team: Team, number: int, pose: Pose2) -> Pose2:
        """Return a pose that is not exactly at another robot's centre: contacts need a direction to separate them."""
        others = [robot.pose for key, robot in self._robots.items() if key != _key(team, number)]
        if all(math.hypot(other.x_m - pose.x_m, other.y_m - pose.y_m) >= _APART_M for other in others):
            return pose
        # each robot in its own direction, so that any number of them are separated
        angle = math.tau * _key(team, number) / (2 * (MAX_NUMBER + 1))
        return Pose2(pose.x_m + _APART_M * math.cos(angle), pose.y_m + _APART_M * math.sin(angle), pose.theta_rad)

    def remove(self, team: Team, number: int) -> None:
        """Take a robot off the field."""
        self.robot(team, number).remove()
        del self._robots[_key(team, number)], self._orders[_key(team, number)]

    def spec(self, team: Team, number: int) -> RobotSpec:
        """Return a robot's specification, whether it is on the field or not."""
        return self._specs.get(_key(team, number)) or RobotSpec(radius_m=self.field.robot_radius_m)

    def set_spec(self, team: Team, number: int, spec: RobotSpec) -> None:
        """Change a robot's specification; a robot on the field keeps its pose and velocity."""
        self._specs[_key(team, number)] = spec
        if self.has(team, number):
            old = self.robot(team, number)
            pose, velocity, turn = old.pose, tuple(old.body.velocity), old.body.angular_velocity
            self.remove(team, number)
            self.add(team, number, pose).place(pose, (velocity[0], velocity[1]), turn)

    def set_field(self, field: Field, flight: Flight) -> None:
        """Replace the field; robots keep their poses, and the ball lies at the centre."""
        robots = tuple(self._robots.values())
        self._build(field, flight)
        for robot in robots:
            self.add(TEAM_OF[robot.side], robot.number, robot.pose)

    def command(self, team: Team, command: RobotCommand) -> None:
        """Let a robot obey a command from now on."""
        self.robot(team, command.number)
        self._orders[_key(team, command.number)].obey(command, self.t_s)

    def touches_ball(self, team: Team, number: int) -> bool:
        """Whether a robot has the ball in its mouth."""
        return self.robot(team, number).holds(self._ball)

    def place_ball(self, state: BallState, *, rolls: bool = True) -> None:
        """Move the ball, with a velocity: rolling, or sliding as after a kick."""
        self._kick = None
        self._ball.place(state.x_m, state.y_m, state.vx_mps, state.vy_mps)
        if not rolls:
            self._ball.kick(state.vx_mps, state.vy_mps)
        self._ball.throw(state.z_m, state.vz_mps)

    def make_room(self, x_m: float, y_m: float) -> None:
        """Move robots away from a ball at a place, and stop those near it."""
        for robot in self._robots.values():
            pose = robot.pose
            dx, dy = pose.x_m - x_m, pose.y_m - y_m
            away = (dx * dx + dy * dy) ** 0.5
            need = robot.spec.radius_m + 2 * self.field.ball_radius_m
            if away < need:
                ux, uy = (dx / away, dy / away) if away > 1e-9 else (-1.0, 0.0)
                pose = Pose2(x_m + ux * need, y_m + uy * need, pose.theta_rad)
            if away < 0.5:
                robot.place(pose)


def _key(team: Team, number: int) -> int:
    """Return the index of a robot among all possible ones, yellow first."""
    return number + (MAX_NUMBER + 1) * (team == Team.BLUE)


class HeldOrders:
    """The last command of one robot. The next command keeps values that it omits, if it comes within 0.1 s."""

    def __init__(self, spec: RobotSpec) -> None:
        self._spec = spec
        self._obeys_until_s = -math.inf
        self._held = _STAND
        self._turns_along = False

    def obey(self, command: RobotCommand, t_s: float) -> None:
        """Take in a command at a time; values that it omits are kept."""
        # values of an expired command must not return with a later command that omits them
        held = _STAND if t_s > self._obeys_until_s else self._held
        velocity = held[:3]
        if command.move is not None:
            self._turns_along, velocity = command.move.world is None, self._velocity(command.move)
        self._held = Order(
            *velocity,
            held.kick_mps if command.kick_mps is None else command.kick_mps,
            held.kick_rise_rad
            if command.kick_angle_rad is None
            else min(max(command.kick_angle_rad, 0.0), math.pi / 2),
            held.dribbles if command.dribbler_rps is None else command.dribbler_rps > 0,
        )
        self._obeys_until_s = t_s + COMMAND_LASTS_S

    def _velocity(self, move: MoveCommand) -> tuple[float, float, float]:
        """Return a command's velocity: field axes for a world velocity, otherwise forward and left; and the turn."""
        if move.world is not None:
            return move.world.x_mps, move.world.y_mps, move.world.turn_rps
        if move.local is not None:
            return move.local.forward_mps, move.local.left_mps, move.local.turn_rps
        return (0.0, 0.0, 0.0) if move.wheels is None else body_velocity(self._spec, move.wheels)

    def at(self, t_s: float, robot: RobotBody) -> Order:
        """Return the order at a time, with its velocity along the field's axes."""
        if t_s > self._obeys_until_s:
            return _STAND
        if not self._turns_along:
            return self._held
        x, y = self._held[:2]
        c, s = math.cos(robot.body.angle), math.sin(robot.body.angle)
        return self._held._replace(x_mps=c * x - s * y, y_mps=s * x + c * y)


def body_velocity(spec: RobotSpec, wheels: WheelVelocities) -> tuple[float, float, float]:
    """Return the forward, left and turning velocity that fits the wheels' rim speeds best (least squares)."""
    rims = wheels.front_right_mps, wheels.back_right_mps, wheels.back_left_mps, wheels.front_left_mps
    matrix = [[-math.sin(angle), math.cos(angle), spec.radius_m] for angle in spec.wheel_angles_rad]
    forward, left, turn = np.linalg.lstsq(np.array(matrix), np.array(rims), rcond=None)[0].tolist()
    return forward, left, turn
