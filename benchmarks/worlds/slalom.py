"""Gaps between opponents in a row, driven at a constant speed or as planned: for speed.py and other_errors.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.error_law import MATCHED, Errors
from benchmarks.worlds.uncertain_robot import DISC_STD_M, PATIENCE_S, PERIOD_S, PLAN_EVERY, RADIUS_M, UncertainRobot
from robocup_vision.arrays import FloatArray
from robocup_vision.planning import Disc

LATEST_S = 60.0


@dataclass(frozen=True, eq=False)
class Slalom:
    """Opponents in pairs, as they stand and as the robot estimates them, and the path it has planned between them."""

    discs: FloatArray
    believed: tuple[Disc, ...]
    path_m: FloatArray


@dataclass(frozen=True)
class SlalomDrive:
    """How a drive went."""

    seconds: float
    collided: bool
    refused: bool
    # whether it stood still for want of a safe speed
    stopped: bool


def draw_slalom(widths_m: FloatArray, rng: np.random.Generator, errors: Errors = MATCHED) -> Slalom:
    """Draw a course through gaps of these widths, 1.2 to 1.8 m apart."""
    discs, believed, path = [], [], [(0.0, 0.0)]
    x = 0.0
    for width in widths_m:
        x, y = x + rng.uniform(1.2, 1.8), rng.uniform(-0.4, 0.4)
        pair = []
        for side in (-1, 1):
            place = np.array([x, y + side * (0.5 * width + RADIUS_M)])
            seen = place + DISC_STD_M * errors.obstacle.draw(rng, 2)
            discs.append((*place, RADIUS_M))
            pair.append(Disc(float(seen[0]), float(seen[1]), RADIUS_M, DISC_STD_M**2 * np.eye(2)))
        believed += pair
        middle = 0.5 * (pair[0].y_m + pair[1].y_m)
        path += [(x - 0.45, middle), (x + 0.45, middle)]
    path.append((x + 1.5, 0.0))
    return Slalom(np.array(discs), tuple(believed), np.array(path))


def drive_slalom(
    course: Slalom, constant_mps: float | None, rng: np.random.Generator, errors: Errors = MATCHED
) -> SlalomDrive:
    """Drive it, at a constant speed or as planned (None)."""
    robot, collided, stopped, missed_s, speed = UncertainRobot(rng, errors), False, False, 0.0, constant_mps or 0.0

    def ended(refused: bool) -> SlalomDrive:
        return SlalomDrive(robot.seconds, collided, refused, stopped)

    while robot.seconds < LATEST_S:
        if math.dist((robot.pose.x_m, robot.pose.y_m), course.path_m[-1]) < 0.05:
            return ended(False)
        robot.look()
        if constant_mps is None and robot.plans_now:
            plan = robot.plan(course.path_m, course.believed)
            speed, missed_s = plan.speed_mps, 0.0 if plan.safe else missed_s + PLAN_EVERY * PERIOD_S
            stopped |= not plan.safe and robot.stands
            if missed_s > PATIENCE_S:
                return ended(True)
        robot.follow(course.path_m, speed)
        collided |= robot.touches(course.discs)
    return ended(True)
