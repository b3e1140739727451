"""Random obstacle courses, and drives through them by camera, localisation and steering.

Whether a course has a route is decided by the truth. The robot receives only frames and odometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.avoidance import SteadyFreeSpace, Wayfinder
from robocup_vision.avoidance.steering import FreeRanges
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.perception.free_space import FREE_RATIO
from robocup_vision.vision import Vision
from sim2d.players.driving.wheels import WheelVelocity
from sim2d.rendering.scene import Box, Scene, any_box_color
from sim2d.robot_link import Command, Point, RobotLimits
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.world import World

CUBES = (5, 10)
ARRIVED_M = 0.05
# cell of the grid on which a route is searched; clearance that a route must have
_GRID_M, ROUTE_CLEARANCE_M = 0.005, 0.03
# smallest clearance of the robot at start and goal
_ROOM_M = 0.05
_TRIES = 10_000


@dataclass(frozen=True, slots=True)
class FloorPerception:
    """How a drive measures the floor, and whether it remembers it."""

    #: Cells of the free space. By default each contains a few samples, and is below 1 cm deep close to the robot.
    directions: int = 64
    rings: int = 60
    #: As in `Vision`.
    free_ratio: float = FREE_RATIO
    #: Filter the free space over frames, and find the way with a `Wayfinder`. False: each frame is used alone, and the
    #: robot heads straight for the target.
    remembers: bool = True


# the cells and the threshold of Sekimori et al. (2001), section 5.1
PRINTED_PERCEPTION = FloorPerception(32, 6, 0.8, remembers=False)


@dataclass(frozen=True, eq=False)
class Course:
    """An obstacle course: start, goal and obstacles."""

    field: Field
    #: Obstacles.
    boxes: tuple[Box, ...]
    #: Pose of the robot at the beginning.
    start: Pose2
    #: Place to reach, field frame, metres.
    goal: Point

    def has_route(self, radius_m: float, clearance_m: float = ROUTE_CLEARANCE_M) -> bool:
        """Return whether a disc of this radius can get from start to goal with this clearance."""
        low, high = self.field.floor_polygon.min(axis=0), self.field.floor_polygon.max(axis=0)

        def cells(points_m: FloatArray) -> npt.NDArray[np.int32]:
            return np.asarray(np.rint((points_m - low) / _GRID_M + 1), dtype=np.int32)

        width, height = (cells(high) + 2).tolist()
        free = np.zeros((height, width), dtype=np.uint8)
        cv2.fillPoly(free, [cells(self.field.floor_polygon)], (1,))
        for box in self.boxes:
            cv2.fillPoly(free, [cells(box.corners)], (0,))
        away_m = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _GRID_M
        passable = (away_m >= radius_m + clearance_m).astype(np.uint8)
        _, region = cv2.connectedComponents(passable, connectivity=4)
        (start_x, start_y), (goal_x, goal_y) = cells(np.array([self.start.array[:2], self.goal])).tolist()
        return bool(region[start_y, start_x] > 0 and region[start_y, start_x] == region[goal_y, goal_x])


def cube_course(field: Field, radius_m: float, rng: np.random.Generator) -> Course:
    """Draw a course along the field's length through 5 to 10 cubes of 0.13 m; a route need not exist."""
    half_x, half_y = field.length_m / 2, field.width_m / 2
    start, goal = _ends(field, radius_m, rng, 0.7)
    count = int(rng.integers(CUBES[0], CUBES[1] + 1))
    boxes: list[Box] = []
    for _ in range(_TRIES):
        if len(boxes) == count:
            return Course(field, tuple(boxes), start, goal)
        x, y = rng.uniform((-half_x, -half_y), (half_x, half_y)).tolist()
        box = Box(x, y, float(rng.uniform(0, math.pi / 2)), color_bgr=any_box_color(rng))
        keeps_off = all(box.distance_m(*place) > radius_m + _ROOM_M for place in ((start.x_m, start.y_m), goal))
        apart = all(math.hypot(box.x_m - b.x_m, box.y_m - b.y_m) > math.sqrt(2) * box.width_m for b in boxes)
        if keeps_off and apart and field.contains(box.corners).all():
            boxes.append(box)
    raise ArgumentError(f"field '{field.name}' has no room for {count} cubes")


def pocket_course(field: Field, radius_m: float, rng: np.random.Generator) -> Course:
    """Draw a course whose straight way leads into a dead end of three walls (a U); a route need not exist."""
    start, goal = _ends(field, radius_m, rng, 0.25)
    thick_m, room_m = 0.06, 2 * (radius_m + _ROOM_M)
    mouth_m = float(rng.uniform(1.5 * room_m, 2.4 * room_m))
    depth_m = float(rng.uniform(0.7 * room_m, 1.6 * room_m))
    middle = Pose2(float(rng.uniform(-0.1, 0.3)), float(rng.uniform(-0.1, 0.1)), float(rng.uniform(-0.3, 0.3)))
    color = any_box_color(rng)
    walls = [
        # back, and the two arms towards the start
        (depth_m / 2, 0.0, thick_m, mouth_m + 2 * thick_m),
        *((0.0, side * (mouth_m + thick_m) / 2, depth_m, thick_m) for side in (-1, 1)),
    ]
    boxes = []
    for x, y, width_m, length_m in walls:
        place = middle.compose(Pose2(x, y, 0.0))
        boxes.append(Box(place.x_m, place.y_m, middle.theta_rad, width_m, length_m, color_bgr=color))
    return Course(field, tuple(boxes), start, goal)


def _ends(field: Field, radius_m: float, rng: np.random.Generator, spread: float) -> tuple[Pose2, Point]:
    x = field.length_m / 2 - radius_m - _ROOM_M
    limit_y = spread * (field.width_m / 2 - radius_m - _ROOM_M)
    start_y, goal_y = rng.uniform(-limit_y, limit_y, 2).tolist()
    return Pose2(-x, start_y, float(rng.uniform(-math.pi, math.pi))), (x, goal_y)


class Decision(Protocol):
    """A pilot's decision."""

    @property
    def velocity_mps(self) -> FloatArray:
        """(2,) float64: velocity to command, robot frame, m/s."""


class Pilot(Protocol):
    """Steers a robot towards a target; `Steering` is one."""

    def steer(
        self,
        free_space: FreeRanges,
        velocity_mps: Sequence[float],
        target_bearing_rad: float,
        target_distance_m: float,
        pending_mps: Sequence[float],
    ) -> Decision:
        """Choose the next velocity by the free space."""


@dataclass(frozen=True, slots=True)
class Drive:
    """The result of a drive: whether anything was touched, time to the goal (None: not reached), least clearance."""

    collided: bool
    seconds: float | None
    clearance_m: float


def nearest_seen_m(field: Field, camera: OmniCamera) -> float:
    """Return the range of the nearest floor that a drive's cells show; nearer obstacles must count as touched."""
    return float(
        Vision(
            field, camera, directions=FloorPerception().directions, rings=FloorPerception().rings
        ).grid.ring_bounds_m[0]
    )


def drive_course(
    course: Course,
    pilot: Pilot,
    camera: OmniCamera,
    limits: RobotLimits,
    rng: np.random.Generator,
    *,
    patience_s: float,
    perception: FloorPerception = FloorPerception(),
    watch: Callable[[Pose2], None] | None = None,
) -> Drive:
    """Drive a course by the camera's frames, until the goal, a collision, or the time limit.

    With `perception.remembers` a `Wayfinder` finds the way.

    Parameters
    ----------
    course : Course
        `course.start` must be clear of obstacles.
    pilot : Pilot
        Steers to a target direction 30 times per second; a new one for each course.
    patience_s : float
        Longest drive, seconds.
    watch : callable, optional
        Called with the true pose before every decision.
    """
    world = World.course(course.field, course.boxes, [course.start], limits, rng)
    eye = MatchCamera(course.field, camera, limits, rng, boxes=course.boxes)
    vision = Vision(
        course.field,
        camera,
        directions=perception.directions,
        rings=perception.rings,
        free_ratio=perception.free_ratio,
        memory=Memory(course.field),
    )
    floor = SteadyFreeSpace()
    way = Wayfinder(max(float(vision.grid.ring_bounds_m[0]), limits.radius_m))
    scene = Scene(course.field, boxes=course.boxes)
    wheels = WheelVelocity(limits)
    clearance_m = math.inf
    while world.state.t_s <= patience_s:
        state = world.state
        pose = state.robots[0].pose
        if watch is not None:
            watch(pose)
        clearance_m = min(clearance_m, scene.clearance_m(pose.x_m, pose.y_m) - limits.radius_m)
        if clearance_m <= 0.0 or any(event.kind == "collision" for event in state.events):
            return Drive(True, None, min(clearance_m, 0.0))
        if math.hypot(pose.x_m - course.goal[0], pose.y_m - course.goal[1]) <= ARRIVED_M:
            return Drive(False, state.t_s, clearance_m)
        odometry = world.odometry(0)
        view = vision.look(eye.render(state, 0), state.t_s, odometry)
        assert view.belief is not None
        free_space: FreeRanges = view.free_space
        if perception.remembers:
            free_space = floor.update(view.free_space, odometry)
            way.update(free_space, odometry)
        wheels.sense(odometry)
        known = view.belief.pose
        wanted = (0.0, 0.0)
        if known:
            x, y = known.pose.inverse().transform(course.goal).tolist()
            bearing_rad, distance_m = math.atan2(y, x), math.hypot(x, y)
            if perception.remembers:
                heading = way.head(bearing_rad, distance_m, wheels.now_mps)
                bearing_rad, distance_m = heading.bearing_rad, heading.distance_m
            decision = pilot.steer(free_space, wheels.now_mps, bearing_rad, distance_m, wheels.pending_mps)
            wanted = (float(decision.velocity_mps[0]), float(decision.velocity_mps[1]))
        wheels.command(wanted)
        world.step({0: Command(*wanted)})
    return Drive(False, None, clearance_m)
