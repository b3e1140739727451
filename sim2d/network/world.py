"""The truth of the league's simulator: robots of two teams by their numbers, and one ball that may fly.

Fixed steps and a fixed order of everything: the same commands at the same steps give the same run bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymunk

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.values.simulation import RobotCommand, Team
from sim2d.network.robot import LeagueRobot, LeagueRobotSpec
from sim2d.world.ball_physics import BallBody, Flight
from sim2d.world.state import BallState
from sim2d.world.world import add_ground

STEPS_PER_S = 300
STEP_S = 1 / STEPS_PER_S
MAX_NUMBER = 15
_FIXED, _BALL = 1, 2
_APART_M = 0.002
# a kicked ball is one until it is slower, or somebody else is as near
_STILL_MPS, _TOUCH_M, _ROBOT_HEIGHT_M = 0.05, 0.005, 0.15

RobotKey = tuple[Team, int]


@dataclass(frozen=True, slots=True)
class LeagueRobotState:
    """One robot: whose it is, its number, where it is and how it moves (field frame), and whether it has the ball."""

    team: Team
    number: int
    pose: Pose2
    velocity_mps: tuple[float, float]
    turn_rps: float
    height_m: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class Kick:
    """Who has kicked the ball, when, and the ball then."""

    team: Team
    number: int
    t_s: float
    ball: BallState


@dataclass(frozen=True, slots=True)
class LeagueState:
    """Everything at one moment: yellow robots first, each team in order of its numbers; a kick while the ball moves."""

    t_s: float
    robots: tuple[LeagueRobotState, ...]
    ball: BallState
    kick: Kick | None = None


class LeagueWorld:
    """A field, a ball and whoever is put there."""

    def __init__(self, field: Field, flight: Flight) -> None:
        self._robots: dict[RobotKey, LeagueRobot] = {}
        self._specs: dict[RobotKey, LeagueRobotSpec] = {}
        self._steps = 0
        self._build(field, flight)

    def _build(self, field: Field, flight: Flight) -> None:
        self.field = field
        self._space = pymunk.Space()
        self._space.iterations = 10
        self._space.collision_slop = 1e-4  # pymunk thinks in pixels, this is metres
        add_ground(self._space, field, (), _FIXED)
        self._ball = BallBody(self._space, field.ball_radius_m, _BALL, flight=flight)
        self._kick: Kick | None = None

    @property
    def t_s(self) -> float:
        """Time since the start."""
        return self._steps / STEPS_PER_S

    @property
    def steps(self) -> int:
        """Physics steps since the start."""
        return self._steps

    @property
    def ball(self) -> BallState:
        """Where the ball is and how it moves."""
        return self._ball.state

    @property
    def state(self) -> LeagueState:
        """The truth."""
        robots = []
        for key in sorted(self._robots):
            robot = self._robots[key]
            body = robot.body
            (x, y), (vx, vy) = body.position, body.velocity
            pose, spec = Pose2(x, y, body.angle), robot.spec
            robots.append(LeagueRobotState(*key, pose, (vx, vy), body.angular_velocity, spec.height_m, spec.radius_m))
        return LeagueState(self.t_s, tuple(robots), self._ball.state, self._kick_of(self._ball.state))

    def step(self) -> None:
        """Go on by one physics step."""
        t_s = self.t_s
        for robot in self._robots.values():
            robot.drive(t_s, STEP_S)
            if robot.handle(self._ball, t_s, STEP_S):
                self._kick = Kick(robot.team, robot.number, t_s, self._ball.state)
        self._ball.apply_friction(STEP_S)
        self._space.step(STEP_S)
        self._steps += 1

    def _kick_of(self, ball: BallState) -> Kick | None:
        """Return the last kick while its ball rolls or flies, and nobody else has touched it."""
        kick = self._kick
        if kick is None:
            return None
        touched = any(
            math.hypot(robot.pose.x_m - ball.x_m, robot.pose.y_m - ball.y_m)
            < robot.spec.radius_m + self.field.ball_radius_m + _TOUCH_M
            for key, robot in self._robots.items()
            if key != (kick.team, kick.number)
        )
        if math.hypot(ball.vx_mps, ball.vy_mps) < _STILL_MPS or (touched and ball.z_m < _ROBOT_HEIGHT_M):
            self._kick = None
        return self._kick

    def has(self, team: Team, number: int) -> bool:
        """Whether a robot is on the field."""
        return (team, number) in self._robots

    def robot(self, team: Team, number: int) -> LeagueRobot:
        """Return a robot.

        Raises
        ------
        ArgumentError
            If it is not on the field.
        """
        if (team, number) not in self._robots:
            raise ArgumentError(f"there is no robot {number} of {team.name.lower()} on the field")
        return self._robots[team, number]

    def add(self, team: Team, number: int, pose: Pose2) -> LeagueRobot:
        """Put a robot on the field.

        Raises
        ------
        ArgumentError
            If its team or number is not one of the league's, or it is there already.
        """
        if team not in (Team.YELLOW, Team.BLUE) or not 0 <= number <= MAX_NUMBER:
            raise ArgumentError(f"there is no robot {number} of {team!r}: numbers are 0 to {MAX_NUMBER}")
        if (team, number) in self._robots:
            raise ArgumentError(f"robot {number} of {team.name.lower()} is on the field already")
        spec, pose = self.spec(team, number), self._apart(team, number, pose)
        robot = self._robots[team, number] = LeagueRobot(self._space, team, number, spec, pose)
        return robot

    def place(
        self,
        team: Team,
        number: int,
        pose: Pose2,
        velocity_mps: tuple[float, float] = (0.0, 0.0),
        turn_rps: float = 0.0,
    ) -> None:
        """Put a robot that is on the field somewhere, moving in the field frame.

        Raises
        ------
        ArgumentError
            If it is not on the field.
        """
        self.robot(team, number).place(self._apart(team, number, pose), velocity_mps, turn_rps)

    def _apart(self, team: Team, number: int, pose: Pose2) -> Pose2:
        """Return a pose beside another robot's centre: two in one point have no direction in which to come apart."""
        others = [robot.pose for key, robot in self._robots.items() if key != (team, number)]
        if all(math.hypot(other.x_m - pose.x_m, other.y_m - pose.y_m) >= _APART_M for other in others):
            return pose
        # each in a direction of its own, so that any number of them come apart
        angle = math.tau * (number + (MAX_NUMBER + 1) * (team == Team.BLUE)) / (2 * (MAX_NUMBER + 1))
        return Pose2(pose.x_m + _APART_M * math.cos(angle), pose.y_m + _APART_M * math.sin(angle), pose.theta_rad)

    def remove(self, team: Team, number: int) -> None:
        """Take a robot off the field."""
        self.robot(team, number).remove()
        del self._robots[team, number]

    def spec(self, team: Team, number: int) -> LeagueRobotSpec:
        """Return what a robot is like, on the field or not."""
        return self._specs.get((team, number)) or LeagueRobotSpec(radius_m=self.field.robot_radius_m)

    def set_spec(self, team: Team, number: int, spec: LeagueRobotSpec) -> None:
        """Change what a robot is like; one on the field keeps its place and velocity."""
        self._specs[team, number] = spec
        if (team, number) in self._robots:
            old = self._robots[team, number]
            pose, velocity, turn = old.pose, tuple(old.body.velocity), old.body.angular_velocity
            self.remove(team, number)
            self.add(team, number, pose).place(pose, (velocity[0], velocity[1]), turn)

    def set_field(self, field: Field, flight: Flight) -> None:
        """Lay out another field; robots keep their places, and the ball lies at the centre."""
        robots = [(key, robot.pose) for key, robot in self._robots.items()]
        self._robots = {}
        self._build(field, flight)
        for (team, number), pose in robots:
            self.add(team, number, pose)

    @property
    def flight(self) -> Flight:
        """How a chipped ball flies."""
        return self._ball.flight

    def command(self, team: Team, command: RobotCommand) -> None:
        """Let a robot obey a command from now on."""
        self.robot(team, command.number).obey(command, self.t_s)

    def touches_ball(self, team: Team, number: int) -> bool:
        """Whether a robot has the ball in its mouth."""
        return self.robot(team, number).touches(self._ball)

    def place_ball(self, state: BallState, *, rolls: bool = True) -> None:
        """Put the ball somewhere with a velocity: rolling, or sliding as if kicked."""
        self._kick = None
        self._ball.place(state.x_m, state.y_m, state.vx_mps, state.vy_mps)
        if not rolls:
            self._ball.kick(state.vx_mps, state.vy_mps)
        self._ball.throw(state.z_m, state.vz_mps)

    def make_room(self, x_m: float, y_m: float) -> None:
        """Move robots out of the way of a ball at a place, and stop those near it."""
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
