"""Random obstacle courses driven by what a mirror camera shows: four ways to steer, at three speeds, and pockets.

Velocity-aware steering; the paper's variant that does not reckon with the robot's velocity, with the paper's threshold
2 v / alpha plus the dead time; the same with the threshold of the velocity-aware one; and a plain dynamic window. All
drive the same courses where the same wayfinder leads them: 5 to 10 cubes of 0.13 m on ssl_2001, through rendered frames
with noise, localisation, slipping wheels and dead time. Courses count where a planner with the truth finds a way
with 3 cm of clearance. The default drives the first 16 courses at each speed and 16 pockets, --full all 500 and 100.
Judged is the first speed. Whatever the velocity-aware steering touches or does not reach is listed below the table.
--jobs N: on how many processes; the figures do not depend on it. --aware: the velocity-aware
steering alone, at the first speed, which --full then drives through in minutes instead of hours.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from field_models import load_field
from robocup_vision.arrays import FloatArray
from robocup_vision.avoidance import Steering, SteeringSettings
from robocup_vision.avoidance.steering import FreeRanges
from sim2d.match.courses import Drive, cube_course, drive_course, nearest_seen_m, pocket_course
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits

FIELD = load_field("ssl_2001")
# m/s, m/s2; the first is the issue's
MOTIONS = ((0.4, 0.3), (0.8, 1.2), (1.5, 4.0))
AWARE, PAPER, UNAWARE, WINDOW = METHODS = ("velocity-aware", "paper, no velocity", "no velocity", "dynamic window")
MIN_REACHED = 0.98
# a drive is given up after the time of the way at this ratio of the speed
PATIENCE_RATIO = 0.1
POCKETS = "pockets"


@dataclass(frozen=True)
class Window:
    """The choice of a dynamic window."""

    velocity_mps: FloatArray


class DynamicWindow:
    """The dynamic window approach (Fox et al. 1997) for a robot that moves in any direction, in its plainest form.

    Of the velocities that can be reached within a period, those from which the robot can stop before it touches
    anything along the way; of them, the one that best weighs heading, clearance and speed.
    """

    def __init__(self, radius_m: float, limits: RobotLimits) -> None:
        self._radius_m, self._limits = radius_m, limits

    def steer(
        self,
        free_space: FreeRanges,
        velocity_mps: Sequence[float],
        target_bearing_rad: float,
        target_distance_m: float,
        pending_mps: Sequence[float],
    ) -> Window:
        """Choose the next velocity."""
        limits = self._limits
        reach = limits.acceleration_mps2 * CONTROL_PERIOD_S
        angle = np.arange(24) * (math.tau / 24)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        tried = np.array(velocity_mps) + np.vstack([[[0.0, 0.0]], *(reach * part * ring for part in (0.5, 1.0))])
        speed = np.hypot(*tried.T)
        tried *= np.minimum(1.0, limits.speed_mps / np.maximum(speed, 1e-9))[:, None]
        speed = np.minimum(speed, limits.speed_mps)
        towards = np.stack([np.cos(free_space.bearing_rad), np.sin(free_space.bearing_rad)], axis=1)
        ends = towards * free_space.range_m[:, None]
        unit = tried / np.maximum(speed, 1e-9)[:, None]
        along, aside = unit @ ends.T, np.abs(unit[:, :1] * ends[:, 1] - unit[:, 1:] * ends[:, 0])
        chord = np.sqrt(np.maximum(self._radius_m**2 - aside**2, 0.0))
        clear = np.where((aside < self._radius_m) & (along > 0), np.maximum(along - chord, 0.0), np.inf).min(axis=1)
        late_s = limits.dead_time_s + CONTROL_PERIOD_S
        admissible = speed**2 / (2 * limits.acceleration_mps2) + speed * late_s <= clear
        admissible &= speed**2 / (2 * limits.acceleration_mps2) <= target_distance_m + 0.05
        if not admissible.any():
            return Window(np.zeros(2))
        goal = np.array([math.cos(target_bearing_rad), math.sin(target_bearing_rad)])
        score = 0.8 * unit @ goal + 0.2 * np.minimum(clear, 1.0) + 0.4 * speed / limits.speed_mps
        return Window(tried[int(np.argmax(np.where(admissible, score, -np.inf)))])


@dataclass(frozen=True)
class Job:
    """A course, and how it is driven."""

    kind: str
    speed_mps: float
    acceleration_mps2: float
    seed: int
    index: int
    methods: tuple[str, ...]


def one(job: Job) -> list[Drive] | None:
    """All methods on one course; None where there is no way."""
    kind, speed, acceleration, seed, index = job.kind, job.speed_mps, job.acceleration_mps2, job.seed, job.index
    limits = RobotLimits(speed_mps=speed, acceleration_mps2=acceleration)
    draw = pocket_course if kind == POCKETS else cube_course
    course = draw(FIELD, limits.radius_m, np.random.default_rng([seed, index, kind == POCKETS]))
    if not course.has_route(limits.radius_m):
        return None
    camera = sekimori_camera()
    radius = max(nearest_seen_m(FIELD, camera), limits.radius_m)
    patience_s = FIELD.length_m / (PATIENCE_RATIO * speed)
    drives = []
    for method in job.methods:
        pilot: Steering | DynamicWindow
        if method == WINDOW:
            pilot = DynamicWindow(radius, limits)
        else:
            pilot = Steering(
                radius,
                limits,
                SteeringSettings(
                    use_velocity=method == AWARE,
                    time_threshold_s=2 * speed / acceleration + limits.dead_time_s if method == PAPER else None,
                    keep_side=False,
                ),
            )
        rng = np.random.default_rng([seed, index, 2])
        drives.append(drive_course(course, pilot, camera, limits, rng, patience_s=patience_s))
    return drives


def jobs(count: int, pockets: int, seed: int, *, aware: bool) -> Iterator[Job]:
    """Everything that is driven."""
    for motion in MOTIONS[:1] if aware else MOTIONS:
        yield from (Job("cubes", *motion, seed, index, (AWARE,) if aware else METHODS) for index in range(count))
    yield from (Job(POCKETS, *MOTIONS[0], seed, index, (AWARE,)) for index in range(pockets))


@program({"--aware": {"action": "store_true", "help": "the velocity-aware steering alone"}}, pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    count, pockets = (1, 1) if arguments.quick else (500, 100) if arguments.full else (16, 16)
    todo = list(jobs(count, pockets, arguments.seed, aware=arguments.aware))
    driven = dict(zip(todo, pool.map(one, todo), strict=True))
    table = Table(
        (
            "courses | speed: label | alpha: label | steering: label | routes | collided: count | "
            "reached %: rate | s, both: error | mm | verdict"
        ),
        name="courses",
        samples=count,
    )
    for speed, acceleration in MOTIONS[:1] if arguments.aware else MOTIONS:
        rows = [d for job, d in driven.items() if job.kind == "cubes" and job.speed_mps == speed and d is not None]
        for column, method in enumerate((AWARE,) if arguments.aware else METHODS):
            drives = [row[column] for row in rows]
            # alone, it is beside itself
            pairs = [(row[0].seconds, row[0 if arguments.aware else 1].seconds) for row in rows]
            both = np.array([pair for pair in pairs if pair[0] is not None and pair[1] is not None], dtype=np.float64)
            seconds = both.mean(axis=0).tolist() if len(both) else [math.nan] * 2
            reached = sum(d.seconds is not None for d in drives) / max(len(drives), 1)
            collided = sum(d.collided for d in drives)
            ok: bool | None = None
            if column == 0:
                ok = not collided and reached >= MIN_REACHED and seconds[0] <= seconds[1]
            # the first speed is judged; the others are for comparison
            table.row(
                "cubes", f"{speed:g}", f"{acceleration:g}", method, str(len(drives)), str(collided), percent(reached),
                seconds[column] if column < 2 else None,
                1000 * min((d.clearance_m for d in drives), default=math.nan),
                verdict(ok) if ok is not None and speed == MOTIONS[0][0] else None,
            )  # fmt: skip
    drives = [d[0] for job, d in driven.items() if job.kind == POCKETS and d is not None]
    reached = sum(d.seconds is not None for d in drives) / max(len(drives), 1)
    collided = sum(d.collided for d in drives)
    ok = not collided and reached >= MIN_REACHED
    table.row(
        POCKETS, f"{MOTIONS[0][0]:g}", f"{MOTIONS[0][1]:g}", AWARE, str(len(drives)), str(collided),
        percent(reached), float(np.mean([d.seconds for d in drives if d.seconds is not None] or [math.nan])),
        1000 * min((d.clearance_m for d in drives), default=math.nan), verdict(ok),
    )  # fmt: skip
    for job, row in driven.items():
        if row is not None and row[0].seconds is None:
            print(f"{job.kind} {job.index} at {job.speed_mps:g} m/s: {'touched' if row[0].collided else 'not reached'}")
