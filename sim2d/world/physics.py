"""Robots, ball, walls, goals and posts in one pymunk space, seen from above.

Steps and the order of all objects are fixed, so the same random numbers and the same orders give the same run bit for
bit, in any process on the same machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pymunk

from field_models import Field
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Box, Scene
from sim2d.robot_link import CONTROL_PERIOD_S
from sim2d.world.ball_physics import BallBody, BallSettings, Flight
from sim2d.world.robot_body import Order, RobotBody
from sim2d.world.robot_spec import BodySettings, RobotSpec
from sim2d.world.state import BallState, Event

STEPS = 10  # physics steps per control period
STEP_S = CONTROL_PERIOD_S / STEPS
WALL_THICKNESS_M = 0.05  # outwards: the inner face is at the place in the field file
PANEL_HALF_THICKNESS_M = 0.005
_FIXED, _BALL, _ROBOT = 1, 2, 3


class Physics:
    """The moving and the fixed bodies on a field.

    Attributes
    ----------
    robots : dict of int to RobotBody
        Robots by index, in the order in which they were added.
    ball : BallBody or None
        The ball; None until it is added.
    kicked : BallState or None
        State of the ball directly after the last kick.
    """

    def __init__(self, field: Field, boxes: Sequence[Box] = ()) -> None:
        self.robots: dict[int, RobotBody] = {}
        self.ball: BallBody | None = None
        self.kicked: BallState | None = None
        self._ball_radius_m = field.ball_radius_m
        self._space = pymunk.Space()
        self._space.iterations = 20
        self._space.collision_slop = 1e-4  # metres; pymunk's default is meant for pixels
        for shape in _ground(self._space.static_body, field, boxes):
            shape.elasticity, shape.friction, shape.collision_type = 0.7, 0.1, _FIXED
            self._space.add(shape)
        self._t_s, self._events = 0.0, list[Event]()
        for other in (_FIXED, _ROBOT):
            self._space.on_collision(_ROBOT, other, begin=self._note_collision)

    def add_ball(self, settings: BallSettings = BallSettings(), flight: Flight = Flight()) -> BallBody:
        """Add a ball at the centre."""
        self.ball = BallBody(self._space, self._ball_radius_m, _BALL, settings, flight)
        return self.ball

    def add(
        self, place: tuple[int, int, int], pose: Pose2, spec: RobotSpec, body: BodySettings, rng: np.random.Generator
    ) -> RobotBody:
        """Add a robot at a pose, at rest; `place` is its index, its side, and its number within the side."""
        robot = RobotBody(self._space, _ROBOT, place, spec, body, STEP_S, rng)
        robot.place(pose)
        self.robots[robot.index] = robot
        return robot

    def step(self, orders: Iterable[Order], t_s: float) -> list[Event]:
        """Advance by `STEP_S` with an order for each robot; return kicks and collisions, with time `t_s`."""
        self._t_s, self._events = t_s, []
        robots, ball = self.robots.values(), self.ball
        for robot, order in zip(robots, orders, strict=True):
            robot.drive(order)
        if ball is not None:
            for robot in robots:
                if speed := robot.handle(ball):
                    self.kicked = ball.state
                    self._events.append(Event(t_s, "kick", (robot.index,), speed_mps=speed))
            ball.apply_friction(STEP_S)
        self._space.step(STEP_S)
        for robot in robots:
            robot.finish_step()
        return self._events

    def _note_collision(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: Any) -> None:
        velocities = [shape.body.velocity if shape.body else (0.0, 0.0) for shape in arbiter.shapes]
        (ax, ay), (bx, by) = velocities
        normal = arbiter.normal
        speed = abs((ax - bx) * normal.x + (ay - by) * normal.y)
        robots = sorted(robot.index for robot in self.robots.values() if robot.shape in arbiter.shapes)
        self._events.append(Event(self._t_s, "collision", tuple(robots), speed_mps=speed))


def _ground(fixed: pymunk.Body, field: Field, boxes: Sequence[Box]) -> list[pymunk.Shape]:
    """Return all fixed shapes, always in the same order."""
    shapes: list[pymunk.Shape] = []
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
    return shapes + [pymunk.Poly(fixed, [(x, y) for x, y in box.corners.tolist()]) for box in boxes]
