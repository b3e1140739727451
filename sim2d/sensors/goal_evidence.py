"""Counts how often the goal localiser finds a goal and its side, on rendered pictures from random places on a field.

The planner of looks (robocup_vision.planning.gaze.goal_question) uses these counts.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.planning.gaze.goal_evidence import CORNERS
from sim2d.rendering.pinhole import COARSE, render_pinhole
from sim2d.rendering.scene import Light, Robot, Room, Scene
from sim2d.sensors.match_camera import CARPET_MARGIN_M, MATCH_SENSOR

WIDTHS_PX = (15.0, 25.0, 40.0, 60.0, 90.0)
# largest deviation of a look from a goal's middle, and of a second look from the first; standard deviation of the tilt
STRAY_RAD, AGAIN_RAD, TILT_RAD = 0.7, 0.15, 0.03
MAX_ROBOTS = 6
RIGHT, WRONG, NOTHING = range(3)


@dataclass(frozen=True, eq=False)
class Counts:
    """Counts of outcomes."""

    #: (CORNERS + 1, K, 3) int64: first looks by corners in view, apparent width, and outcome as above.
    first: npt.NDArray[np.int64]
    #: Numbers of second looks at whole goals that the first look had missed.
    again_found: int
    again_missed: int

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.first + other.first, self.again_found + other.again_found, self.again_missed + other.again_missed
        )


def count_evidence(field: Field, camera: PinholeCamera, seed: int, indices: Iterable[int]) -> Counts:
    """Look at goals from random places, and count the outcomes; look i depends only on `seed` and i.

    Parameters
    ----------
    field : Field
        Field with goals of posts, of different colours.
    camera : PinholeCamera
        Camera of a head; its tilt must be known.

    Raises
    ------
    ArgumentError
        If the field's goals have the same colour, or the goal localiser does not support them.
    """
    if len({goal.color for goal in field.goals}) < 2:
        raise ArgumentError(
            f"the goals of field '{field.name}' do not differ in colour, so looks cannot decide between the sides"
        )
    estimator = GoalPoseEstimator(field, camera)
    total = Counts(np.zeros((CORNERS + 1, len(WIDTHS_PX) + 1, 3), dtype=np.int64), 0, 0)
    for index in indices:
        total = total + _look(field, camera, estimator, np.random.default_rng([seed, index]))
    return total


def _look(field: Field, camera: PinholeCamera, estimator: GoalPoseEstimator, rng: np.random.Generator) -> Counts:
    half = np.array([field.length_m, field.width_m]) / 2 - 0.15
    x, y = rng.uniform(-half, half).tolist()
    goal = field.goals[int(rng.integers(len(field.goals)))]
    heading = math.atan2(-y, goal.line_x_m - x) + float(rng.uniform(-STRAY_RAD, STRAY_RAD))
    scene = draw_scene(field, (x, y), rng)
    tilted = dataclasses.replace(camera, tilt_rad=(camera.tilt_rad or 0.0) + float(rng.normal(0, TILT_RAD)))
    first = np.zeros((CORNERS + 1, len(WIDTHS_PX) + 1, 3), dtype=np.int64)
    pose = Pose2(x, y, heading)
    corners, width_px = corners_in_view(scene, tilted, pose, goal.side)
    outcome = _outcome(estimator, scene, tilted, pose, goal.side, rng)
    first[corners, int(np.searchsorted(WIDTHS_PX, width_px, side="right")), outcome] = 1
    if outcome != NOTHING or corners < CORNERS:
        return Counts(first, 0, 0)
    pose = Pose2(x, y, heading + float(rng.uniform(-AGAIN_RAD, AGAIN_RAD)))
    if corners_in_view(scene, tilted, pose, goal.side)[0] < CORNERS:
        return Counts(first, 0, 0)
    found = _outcome(estimator, scene, tilted, pose, goal.side, rng) == RIGHT
    return Counts(first, int(found), int(not found))


def draw_scene(field: Field, place: tuple[float, float], rng: np.random.Generator) -> Scene:
    """Draw random robots on the field, at least 0.4 m from a place, and a random indoor light."""
    half = np.array([field.length_m, field.width_m]) / 2 - 0.15
    spots = rng.uniform(-half, half, (int(rng.integers(MAX_ROBOTS + 1)), 2))
    robots = tuple(
        Robot(float(x), float(y), field.robot_radius_m, float(rng.uniform(0.2, 0.3)))
        for x, y in spots
        if math.hypot(x - place[0], y - place[1]) > 0.4
    )
    light = Light(
        level=float(rng.uniform(0.8, 1.05)),
        gradient=float(rng.uniform(0.0, 0.25)),
        gradient_direction_rad=float(rng.uniform(-math.pi, math.pi)),
    )
    room = Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.5, 1.5)))
    return Scene(field, (), robots, None, light, room, 0.0 if field.is_bounded else CARPET_MARGIN_M)


def corners_in_view(scene: Scene, camera: PinholeCamera, pose: Pose2, side: int) -> tuple[int, float]:
    """Return how many feet and tops of a goal's posts are visible in a picture, and the goal's width in it, pixels."""
    goal = next(goal for goal in scene.field.goals if goal.side == side)
    eye = np.array([pose.x_m, pose.y_m, camera.height_m])
    count, bearings = 0, []
    for y in (goal.width_m / 2, -goal.width_m / 2):
        flat = pose.inverse().transform((goal.line_x_m, y))
        bearings.append(math.atan2(flat[1], flat[0]))
        for up in (0.0, goal.height_m):
            u, v = camera.ray_to_pixel((flat[0], flat[1], up - camera.height_m))
            inside = 0 <= u <= camera.size_px[0] - 1 and 0 <= v <= camera.size_px[1] - 1
            count += inside and not any(_hides(robot, eye, np.array([goal.line_x_m, y, up])) for robot in scene.robots)
    span = abs(math.remainder(bearings[0] - bearings[1], math.tau))
    return count, span * camera.focal_px[0]


def _hides(robot: Robot, eye: npt.NDArray[np.float64], point: npt.NDArray[np.float64]) -> bool:
    way = point[:2] - eye[:2]
    along = float((np.array([robot.x_m, robot.y_m]) - eye[:2]) @ way / (way @ way))
    if not 0 < along < 1:
        return False
    nearest = eye + along * (point - eye)
    aside = math.hypot(nearest[0] - robot.x_m, nearest[1] - robot.y_m)
    return bool(aside < robot.radius_m and nearest[2] < robot.height_m)


def _outcome(
    estimator: GoalPoseEstimator, scene: Scene, camera: PinholeCamera, pose: Pose2, side: int, rng: np.random.Generator
) -> int:
    frame = MATCH_SENSOR.expose(render_pinhole(camera, scene, pose, supersample=COARSE), rng)
    seen = estimator.locate_camera(frame)
    if isinstance(seen, NotLocated) or len(seen.sides) > 1:
        return NOTHING
    return RIGHT if seen.sides[0] == side else WRONG
