"""Courses driven by the setting that Sekimori et al. (2001) print, and by ours, each with and without velocity.

Section 5.1 and figure 9 of the paper: a robot of 0.4 m/s and 0.3 m/s2 goes to a target behind obstacles, in the print
without a touch with and without regard to its velocity; how fast is not printed. "As printed": 6 x 32 cells, r_th 0.8,
T_th 2.75 s, nothing remembered of earlier frames and no wayfinder; slower speeds are tried where the full one is not
safe, as ours does. "Ours": as in avoidance.py. The courses are the first of avoidance.py whose straight way two cubes
block and that have a way with 3 cm of clearance. A drive ends after 60 s (--quick: 12 s). --picture FILE: also draws
the ways through the first course that all reach (if none, the first), the robot every 1/3 s, as the figure does.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from benchmarks.harness import Pool, Table, program, verdict
from field_models import load_field
from robocup_vision.avoidance import Steering, SteeringSettings
from robocup_vision.geometry import Pose2
from sim2d.match.courses import (
    PRINTED_PERCEPTION,
    Course,
    Drive,
    FloorPerception,
    cube_course,
    drive_course,
    nearest_seen_m,
)
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits

FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera()
LIMITS = RobotLimits(speed_mps=0.4, acceleration_mps2=0.3)
PATIENCE_S, QUICK_PATIENCE_S, PICTURED_EVERY_S = 60.0, 12.0, 1 / 3
_PRINTED = {"time_threshold_s": 2.75, "directions": PRINTED_PERCEPTION.directions, "keep_side": False}


@dataclass(frozen=True, slots=True)
class Method:
    """What steers, and how it sees the floor."""

    name: str
    settings: SteeringSettings
    perception: FloorPerception


METHODS = (
    Method("as printed, no velocity", SteeringSettings(use_velocity=False, **_PRINTED), PRINTED_PERCEPTION),  # type: ignore[arg-type]
    Method("as printed, velocity", SteeringSettings(**_PRINTED), PRINTED_PERCEPTION),  # type: ignore[arg-type]
    Method("ours, no velocity", SteeringSettings(use_velocity=False, keep_side=False), FloorPerception()),
    Method("ours, velocity", SteeringSettings(keep_side=False), FloorPerception()),
)


@dataclass(frozen=True, slots=True)
class Way:
    """A drive, and where the robot was before each decision."""

    drive: Drive
    poses: tuple[Pose2, ...]


def blocked_courses(seed: int) -> Iterator[int]:
    """Numbers of the courses of avoidance.py whose straight way two cubes block."""
    for index in range(1000):
        course = course_of(seed, index)
        straight = np.linspace((course.start.x_m, course.start.y_m), course.goal, 100).tolist()
        near = [box for box in course.boxes if min(box.distance_m(*place) for place in straight) < LIMITS.radius_m]
        if len(near) >= 2 and course.has_route(LIMITS.radius_m):
            yield index


def course_of(seed: int, index: int) -> Course:
    """Course of a number, that of avoidance.py."""
    return cube_course(FIELD, LIMITS.radius_m, np.random.default_rng([seed, index, False]))


def drive(job: tuple[int, int, Method, float]) -> Way:
    """Drive a course of a seed by a method, for so many seconds at most."""
    seed, index, method, patience_s = job
    poses: list[Pose2] = []
    pilot = Steering(max(nearest_seen_m(FIELD, CAMERA), LIMITS.radius_m), LIMITS, method.settings)
    rng = np.random.default_rng([seed, index, 2])
    driven = drive_course(
        course_of(seed, index),
        pilot,
        CAMERA,
        LIMITS,
        rng,
        patience_s=patience_s,
        perception=method.perception,
        watch=poses.append,
    )
    return Way(driven, tuple(poses))


def ending(of: Drive) -> str:
    """How a drive ended."""
    return "touched" if of.collided else "not reached" if of.seconds is None else f"{of.seconds:.1f} s"


def draw(course: Course, ways: dict[str, Way], path: Path) -> None:
    """Draw the ways through a course, one picture a method."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Polygon

    figure = Figure(figsize=(11, 6.4), layout="constrained")
    for axes, (name, way) in zip(figure.subplots(2, 2).flat, ways.items(), strict=True):
        axes.add_patch(Polygon(FIELD.floor_polygon, facecolor="#dcebd7", edgecolor="black", lw=1.0))
        for box in course.boxes:
            axes.add_patch(Polygon(box.corners, facecolor="tab:red"))
        for pose in way.poses[:: round(PICTURED_EVERY_S / CONTROL_PERIOD_S)]:
            axes.add_patch(Circle((pose.x_m, pose.y_m), LIMITS.radius_m, fill=False, color="tab:blue", lw=0.7))
        axes.plot([pose.x_m for pose in way.poses], [pose.y_m for pose in way.poses], "-", color="tab:blue", lw=1.0)
        axes.plot(*course.goal, "k+", ms=12)
        axes.set(aspect="equal", xlabel="x, m", ylabel="y, m", title=f"{name}: {ending(way.drive)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)


@program({"--picture": {"type": Path, "metavar": "FILE", "help": "draw the ways through a course"}}, pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    count = 1 if arguments.quick else 40 if arguments.full else 4
    courses = list(islice(blocked_courses(arguments.seed), count))
    patience_s = QUICK_PATIENCE_S if arguments.quick else PATIENCE_S
    jobs = [(arguments.seed, index, method, patience_s) for index in courses for method in METHODS]
    ways = dict(zip([(index, method.name) for _, index, method, _ in jobs], pool.map(drive, jobs), strict=True))
    table = Table("course | steering: label | end | clearance mm", name="courses")
    for index in courses:
        for method in METHODS:
            driven = ways[index, method.name].drive
            table.row(str(index), method.name, ending(driven), 1000 * driven.clearance_m)
    columns = "steering                | reached: rate | touched: count | mean s | verdict"
    table = Table(columns, name="all", samples=count)
    for method in METHODS:
        drives = [ways[index, method.name].drive for index in courses]
        seconds = [driven.seconds for driven in drives if driven.seconds is not None]
        touched = sum(driven.collided for driven in drives)
        is_ours = method is METHODS[-1]
        if is_ours:
            ok = not touched and len(seconds) == count
        mean_s = float(np.mean(seconds)) if seconds else math.nan
        table.row(method.name, f"{len(seconds)}/{count}", touched, mean_s, verdict(ok) if is_ours else None)
    if arguments.picture is not None:
        reached = [i for i in courses if all(ways[i, m.name].drive.seconds is not None for m in METHODS)]
        index = (reached or courses)[0]
        draw(course_of(arguments.seed, index), {m.name: ways[index, m.name] for m in METHODS}, arguments.picture)
