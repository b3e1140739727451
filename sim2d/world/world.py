"""The world of a match, seen from above: robots, ball, walls and rules in one pymunk space.

Fixed steps and a fixed order of everything: the same seed and the same commands give the same run bit for bit, in any
process on the same machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymunk

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.kick_off import kick_off_pose
from sim2d.rendering.scene import Box, Scene
from sim2d.robot_link import CONTROL_PERIOD_S, Command, Phase, RobotLimits
from sim2d.world.ball_physics import BallBody, BallSettings
from sim2d.world.referee import MatchReferee, Referee, RefereeSettings
from sim2d.world.robot_body import BodySettings, RobotBody, check_command
from sim2d.world.state import Event, WorldState

STEPS = 10  # physics steps a period
STEP_S = CONTROL_PERIOD_S / STEPS
_FIXED, _BALL, _ROBOT = 1, 2, 3
_STOP = Command()
WALL_THICKNESS_M = 0.05  # outwards: the inner face stands at the place in the field file
PANEL_HALF_THICKNESS_M = 0.005


def add_ground(space: pymunk.Space, field: Field, boxes: Sequence[Box], collision_type: int) -> None:
    """Add everything fixed to a space, always in the same order."""
    shapes: list[pymunk.Shape] = []
    fixed = space.static_body
    if field.is_bounded:
        corners = field.floor_polygon
        for (x0, y0), (x1, y1) in zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True):
            half, length = WALL_THICKNESS_M / 2, math.hypot(x1 - x0, y1 - y0)
            # counter-clockwise, so outwards is to the right of the edge
            ox, oy = half * (y1 - y0) / length, -half * (x1 - x0) / length
            shapes.append(pymunk.Segment(fixed, (x0 + ox, y0 + oy), (x1 + ox, y1 + oy), half))
    for goal in field.goals:
        if goal.kind == "panels":
            for x0, y0, x1, y1 in goal.panels.tolist():
                shapes.append(pymunk.Segment(fixed, (x0, y0), (x1, y1), PANEL_HALF_THICKNESS_M))
    shapes += [pymunk.Circle(fixed, post.radius_m, (post.x_m, post.y_m)) for post in Scene(field).posts()]
    shapes += [pymunk.Poly(fixed, [(x, y) for x, y in box.corners.tolist()]) for box in boxes]
    for shape in shapes:
        shape.elasticity, shape.friction = 0.7, 0.1
        shape.collision_type = collision_type
        space.add(shape)


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """Values of the physics and the rules: of each robot's body, the ball and the referee."""

    body: BodySettings = BodySettings()
    ball: BallSettings = BallSettings()
    referee: RefereeSettings = RefereeSettings()


class World:
    """The true state of a match, and its laws.

    Robots are numbered 0 to 2n - 1, those of side +1 (attacking the goal at +x) first, and stand where a kick-off wants
    them.

    Parameters
    ----------
    referee : MatchReferee, optional
        Who judges; default: one of sim2d's own simple rules, of `settings.referee`.

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
    ) -> None:
        if players_per_side < 1:
            raise ArgumentError(f"players_per_side must be at least 1, got {players_per_side}")
        n = players_per_side
        places = [(side, number) for side in (1, -1) for number in range(n)]
        starts = [kick_off_pose(field, side, number, n, limits.radius_m) for side, number in places]
        robots = [(*place, start) for place, start in zip(places, starts, strict=True)]
        self._build(field, (), limits, rng, robots, settings.body)
        self._ball: BallBody | None = BallBody(self._space, field.ball_radius_m, _BALL, settings.ball)
        self._referee: MatchReferee | None = referee or Referee(field, limits, settings.referee)

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
        world = cls.__new__(cls)
        world._build(field, boxes, limits, rng, [(1, k, start) for k, start in enumerate(starts)], BodySettings())
        world._ball = world._referee = None
        return world

    def _build(
        self,
        field: Field,
        boxes: Sequence[Box],
        limits: RobotLimits,
        rng: np.random.Generator,
        robots: Sequence[tuple[int, int, Pose2]],
        body: BodySettings,
    ) -> None:
        self.field, self.limits, self.boxes = field, limits, tuple(boxes)
        self._rng = rng
        self._space = pymunk.Space()
        self._space.iterations = 20
        self._space.collision_slop = 1e-4  # pymunk thinks in pixels, this is metres
        add_ground(self._space, field, boxes, _FIXED)
        self._robots: list[RobotBody] = []
        for index, (side, number, start) in enumerate(robots):
            robot = RobotBody(self._space, index, side, number, limits, STEP_S, _ROBOT, rng, body)
            robot.place(start)
            self._robots.append(robot)
        self._of_shape = {robot.shape: robot.index for robot in self._robots}
        for other in (_FIXED, _ROBOT):
            self._space.on_collision(_ROBOT, other, begin=self._note_collision)
        self._periods = 0
        self._events: list[Event] = []

    @property
    def t_s(self) -> float:
        """Time since the start."""
        return self._periods * CONTROL_PERIOD_S

    @property
    def state(self) -> WorldState:
        """The truth."""
        referee = self._referee
        score = (referee.score[1], referee.score[-1]) if referee else (0, 0)
        phase: Phase = referee.phase if referee else "play"
        return WorldState(
            self.t_s,
            tuple(robot.state for robot in self._robots),
            self._ball.state if self._ball else None,
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
            By the robots' indices; one without a command stops.

        Raises
        ------
        ArgumentError
            If a command is not finite or its robot does not exist.
        """
        for index, command in commands.items():
            self._robot(index)
            check_command(command)
        self._events = []
        drawn = self._rng.standard_normal((len(self._robots), 3)).tolist()
        for robot, (a, b, c) in zip(self._robots, drawn, strict=True):
            robot.begin_period(CONTROL_PERIOD_S, (a, b, c))
        given = [commands.get(robot.index, _STOP) for robot in self._robots]
        for _ in range(STEPS):
            self._physics_step(given)
        self._periods += 1
        self._apply_rules()

    def _physics_step(self, commands: Sequence[Command]) -> None:
        for robot, command in zip(self._robots, commands, strict=True):
            robot.drive(command)
        ball = self._ball
        if ball is not None:
            for robot in self._robots:
                speed = robot.handle(ball, self._rng)
                if speed:
                    self._events.append(Event(self.t_s, "kick", (robot.index,), speed_mps=speed))
            ball.apply_friction(STEP_S)
        self._space.step(STEP_S)
        for robot in self._robots:
            robot.finish_step()

    def _apply_rules(self) -> None:
        if self._referee is None or self._ball is None:
            return
        robots = [robot.state for robot in self._robots]
        for ruling in self._referee.judge(self.t_s, robots, self._ball.state):
            if ruling.event is not None:
                self._events.append(ruling.event)
            if ruling.ball_at is not None:
                self._ball.place(*ruling.ball_at)
            if ruling.robot_at is not None:
                index, x, y = ruling.robot_at
                self.place(index, Pose2(x, y, robots[index].pose.theta_rad))

    def _note_collision(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: Any) -> None:
        velocities = [shape.body.velocity if shape.body else (0.0, 0.0) for shape in arbiter.shapes]
        (ax, ay), (bx, by) = velocities
        normal = arbiter.normal
        speed = abs((ax - bx) * normal.x + (ay - by) * normal.y)
        robots = sorted(self._of_shape[shape] for shape in arbiter.shapes if shape in self._of_shape)
        self._events.append(Event(self.t_s, "collision", tuple(robots), speed_mps=speed))

    def odometry(self, index: int) -> Pose2:
        """Motion during the last control period, in the robot frame at its beginning, measured by the wheels."""
        return self._robot(index).odometry

    def ball_in_mouth(self, index: int) -> bool:
        """Whether the ball interrupts the light barrier across a robot's mouth."""
        return self._ball is not None and self._robot(index).holds(self._ball)

    def place(self, index: int, pose: Pose2) -> None:
        """Put a robot somewhere, at rest; its odometry does not measure that (kidnapping)."""
        self._robot(index).place(pose)

    def push(self, index: int, dx_m: float, dy_m: float, turn_rad: float = 0.0) -> None:
        """Push a robot by a way (field frame) and an angle; its odometry does not measure that."""
        if not all(math.isfinite(value) for value in (dx_m, dy_m, turn_rad)):
            raise ArgumentError(f"a push must be finite, got {dx_m}, {dy_m}, {turn_rad}")
        self._robot(index).push(dx_m, dy_m, turn_rad)

    def place_ball(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put the ball somewhere, rolling at a velocity.

        Raises
        ------
        ArgumentError
            If there is none.
        """
        if self._ball is None:
            raise ArgumentError("this world has no ball")
        self._ball.place(x_m, y_m, vx_mps, vy_mps)

    def _robot(self, index: int) -> RobotBody:
        if not 0 <= index < len(self._robots):
            raise ArgumentError(f"there is no robot {index}: they are 0 to {len(self._robots) - 1}")
        return self._robots[index]
