"""The world of a match: robots and ball, simulated in control periods, under the referee's rules."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.kick_off import kick_off_pose
from sim2d.rendering.scene import Box
from sim2d.robot_link import CONTROL_PERIOD_S, Command, Phase, RobotLimits
from sim2d.world.ball_physics import BallSettings
from sim2d.world.physics import STEPS, Physics
from sim2d.world.referee import MatchReferee, Referee
from sim2d.world.robot_body import Order, RobotBody
from sim2d.world.robot_spec import BodySettings, RobotSpec
from sim2d.world.state import Event, WorldState

_STOP = Command()


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """Settings of the physics: of each robot's body and of the ball."""

    body: BodySettings = BodySettings()
    ball: BallSettings = BallSettings()


class World:
    """The true state of a match, and its simulation.

    Robots are numbered 0 to 2n - 1, those of side +1 (attacking the goal at +x) first, in kick-off places.

    Parameters
    ----------
    referee : MatchReferee, optional
        Default: sim2d's own, with simple rules.
    boxes, starts
        Obstacles and robots' poses of a course (`World.course`).

    Raises
    ------
    ArgumentError
        If `players_per_side` is not positive.
    """

    def __init__(
        self,
        field: Field,
        players_per_side: int,
        limits: RobotLimits,
        rng: np.random.Generator,
        settings: WorldSettings = WorldSettings(),
        referee: MatchReferee | None = None,
        boxes: Sequence[Box] = (),
        starts: Sequence[Pose2] | None = None,
    ) -> None:
        n = players_per_side
        if n < 1:
            raise ArgumentError(f"players_per_side must be at least 1, got {n}")
        self.field, self.limits, self.boxes = field, limits, tuple(boxes)
        self._rng, self._periods = rng, 0
        self._events: list[Event] = []
        self._referee: MatchReferee | None = None
        self._physics = Physics(field, boxes)
        spec = RobotSpec.of(limits, settings.body, field.ball_radius_m)
        places = [(side, number) for side in (1, -1) for number in range(n)]
        for index, (side, number) in enumerate(places if starts is None else places[:n]):
            start = kick_off_pose(field, side, number, n, limits.radius_m) if starts is None else starts[index]
            self._physics.add((index, side, number), start, spec, settings.body, rng)
        if starts is None:
            self._physics.add_ball(settings.ball)
            self._referee = referee or Referee(field, limits)

    @classmethod
    def course(
        cls,
        field: Field,
        boxes: Sequence[Box],
        starts: Sequence[Pose2],
        limits: RobotLimits,
        rng: np.random.Generator,
    ) -> World:
        """Make a world without ball and rules: boxes on a field, and a robot at each start, all of side +1."""
        return cls(field, len(starts), limits, rng, boxes=boxes, starts=starts)

    @property
    def t_s(self) -> float:
        """Time since the start."""
        return self._periods * CONTROL_PERIOD_S

    @property
    def state(self) -> WorldState:
        """The true state now."""
        referee, ball = self._referee, self._physics.ball
        score = (referee.score[1], referee.score[-1]) if referee else (0, 0)
        phase: Phase = referee.phase if referee else "play"
        return WorldState(
            self.t_s,
            tuple(robot.state(robot.index) for robot in self._physics.robots.values()),
            ball.state if ball else None,
            score,
            phase,
            referee.kick_off_side if referee else 1,
            tuple(self._events),
            referee.placement_m if referee else None,
        )

    def step(self, commands: Mapping[int, Command]) -> None:
        """Simulate one control period.

        Parameters
        ----------
        commands : mapping of int to Command
            Commands by the robots' indices; a robot without one stops.

        Raises
        ------
        ArgumentError
            If a command is not finite or its robot does not exist.
        """
        for index, command in commands.items():
            self._robot(index)
            check_command(command)
        robots = self._physics.robots
        drawn = self._rng.standard_normal((len(robots), 3)).tolist()
        for robot, (a, b, c) in zip(robots.values(), drawn, strict=True):
            robot.begin_period((a, b, c))
        given = [commands.get(index, _STOP) for index in robots]
        orders = [Order(c.forward_mps, c.left_mps, c.turn_rps, c.kick_mps, 0.0, c.dribble, c.pan_rad) for c in given]
        self._events = [event for _ in range(STEPS) for event in self._physics.step(orders, self.t_s)]
        self._periods += 1
        self._apply_rules()

    def _apply_rules(self) -> None:
        ball = self._physics.ball
        if self._referee is None or ball is None:
            return
        robots = self.state.robots
        for ruling in self._referee.judge(self.t_s, robots, ball.state):
            if ruling.event is not None:
                self._events.append(ruling.event)
            if ruling.ball_at is not None:
                ball.place(*ruling.ball_at)
            if ruling.robot_at is not None:
                index, x, y = ruling.robot_at
                self.place(index, Pose2(x, y, robots[index].pose.theta_rad))

    def odometry(self, index: int) -> Pose2:
        """Return the motion during the last control period, robot frame at its beginning, measured by the wheels."""
        return self._robot(index).odometry

    def ball_in_mouth(self, index: int) -> bool:
        """Return whether the ball interrupts the light barrier across a robot's mouth."""
        ball = self._physics.ball
        return ball is not None and self._robot(index).holds(ball)

    def place(self, index: int, pose: Pose2) -> None:
        """Put a robot at a pose, at rest; its odometry does not measure that (kidnapping)."""
        self._robot(index).place(pose)

    def push(self, index: int, dx_m: float, dy_m: float, turn_rad: float = 0.0) -> None:
        """Push a robot by a displacement (field frame) and an angle; its odometry does not measure that."""
        if not all(math.isfinite(value) for value in (dx_m, dy_m, turn_rad)):
            raise ArgumentError(f"a push must be finite, got {dx_m}, {dy_m}, {turn_rad}")
        self._robot(index).push(dx_m, dy_m, turn_rad)

    def place_ball(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put the ball at a place, rolling with a velocity, field frame.

        Raises
        ------
        ArgumentError
            If there is no ball.
        """
        if self._physics.ball is None:
            raise ArgumentError("this world has no ball")
        self._physics.ball.place(x_m, y_m, vx_mps, vy_mps)

    def _robot(self, index: int) -> RobotBody:
        robots = self._physics.robots
        if index not in robots:
            raise ArgumentError(f"there is no robot {index}: they are 0 to {len(robots) - 1}")
        return robots[index]


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
