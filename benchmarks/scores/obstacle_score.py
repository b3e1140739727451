"""Obstacles of one picture against the robots that stand there: which are found, and what the others are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.standing_robots import Camera, SeenRobot, StandingFrame, pixel_on_floor_m
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.perception.obstacles import Obstacle
from robocup_vision.view import View

# an obstacle this near the ball, or a goal or beacon, is by it
_NEAR_M = 0.10
# a disc's near side, averaged over the bearings that meet it, lies this fraction of its radius before its centre
_NEAR_SIDE = math.pi / 4
_NEARER_M = 6.0

CAUSES = ("again", "ball", "goal", "beacon", "floor's end", "floor")


@dataclass(frozen=True, slots=True)
class Listed:
    """How many robots are certain to be in view, and how many obstacles are those, others, or nothing."""

    #: robots that must be listed, those of them that are, and listed ones that need not be
    certain: int
    found: int
    doubtful: int
    false: tuple[str, ...]  #: what each further obstacle is
    errors_m: tuple[float, ...]  #: distance of each found robot's obstacle from the middle of its near side
    #: width of each found robot's obstacle less the robot's, of those that are whole in view
    widths_m: tuple[float, ...]
    #: where the free floor ends in the direction of each robot that is certain and nearer than 6 m, of its range
    floor_ends: tuple[float, ...]

    @property
    def count_error(self) -> int:
        """Number listed less number certain, without the doubtful ones."""
        return self.found + len(self.false) - self.certain


def judge(view: View, frame: StandingFrame, camera: Camera) -> Listed:
    """Match obstacles to robots, the nearest pairs first."""
    obstacles = view.obstacles
    pairs = []
    for i, one in enumerate(obstacles):
        for j, robot in enumerate(frame.robots):
            along, across = _off(one, robot, camera)
            if across < 1.2 * robot.radius_m and along < 1.5 * robot.radius_m + 2 * robot.error_m:
                pairs.append((math.hypot(along, across), i, j))
    of_robot: dict[int, int] = {}
    errors, widths = [], []
    for error, i, j in sorted(pairs):
        if i not in of_robot and j not in of_robot.values():
            of_robot[i] = j
            if frame.robots[j].is_certain:
                errors.append(error)
                if frame.robots[j].in_view == 1.0:
                    widths.append(obstacles[i].width_m - 2 * frame.robots[j].radius_m)
    near = {i for _, i, _ in pairs}
    false = tuple(
        "again" if i in near else _cause(one, frame, camera) for i, one in enumerate(obstacles) if i not in of_robot
    )
    return Listed(
        sum(robot.is_certain for robot in frame.robots),
        len(errors),
        len(of_robot) - len(errors),
        false,
        tuple(errors),
        tuple(widths),
        tuple(_floor_end(view.free_space, robot) for robot in frame.robots if _is_near(robot)),
    )


def _is_near(robot: SeenRobot) -> bool:
    return robot.is_certain and math.hypot(robot.x_m, robot.y_m) - robot.radius_m <= _NEARER_M


def _floor_end(free_space: FreeSpace, robot: SeenRobot) -> float:
    away_m, bearing = math.hypot(robot.x_m, robot.y_m), math.atan2(robot.y_m, robot.x_m)
    off = np.abs(np.remainder(free_space.bearing_rad - bearing + math.pi, math.tau) - math.pi)
    # directions before the middle half of it: the nearest of them, at least
    before = off <= max(math.asin(min(0.5 * robot.radius_m / away_m, 1.0)), float(off.min()))
    return float(np.nanmin(free_space.range_m[before])) / (away_m - robot.radius_m)


def _off(one: Obstacle, robot: SeenRobot, camera: Camera) -> tuple[float, float]:
    """Distance of an obstacle from the middle of a robot's near side, along and across the camera's line of sight."""
    center = np.array([robot.x_m, robot.y_m]) - camera.offset_m
    ahead = center / np.hypot(*center)
    off = np.array([one.x_m, one.y_m]) - camera.offset_m - (center - _NEAR_SIDE * robot.radius_m * ahead)
    return abs(float(off @ ahead)), abs(float(off[0] * ahead[1] - off[1] * ahead[0]))


def _cause(one: Obstacle, frame: StandingFrame, camera: Camera) -> str:
    """Return what stands where an obstacle is listed that is no robot."""
    field, ball = frame.scene.field, frame.scene.ball
    from_camera = np.array([one.x_m, one.y_m]) - camera.offset_m
    range_m = max(float(np.hypot(*from_camera)), 1e-3)
    error_m = pixel_on_floor_m(camera, math.atan2(from_camera[1], from_camera[0]), range_m)
    near_m = _NEAR_M + min(2 * error_m, range_m)
    place = frame.pose.transform((one.x_m, one.y_m))
    if ball is not None and math.dist(place, (ball.x_m, ball.y_m)) < ball.radius_m + near_m:
        return "ball"
    for goal in field.goals:
        deep = goal.side * place[0] > abs(goal.line_x_m) - near_m
        if deep and abs(place[1]) < goal.width_m / 2 + near_m:
            return "goal"
    if any(math.dist(place, (b.x_m, b.y_m)) < b.radius_m + near_m for b in field.beacons):
        return "beacon"
    behind = frame.pose.transform(np.array([one.x_m, one.y_m]) + from_camera / range_m * near_m)
    return "floor" if field.contains(behind) else "floor's end"
