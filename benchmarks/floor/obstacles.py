"""Obstacles among robots: one for each robot in view, none for walls, goals, lines, the carpet's end or the ball.

On every built-in field none to all of the robots of a match stand anywhere, and a ball lies in half of the pictures; a
forward, a fisheye and a mirror camera of the robots' size look at them before a hall, or a room with bystanders.
"alone": each picture by itself, whether it shows a pose or not; "near a pose": with a prior 5 cm and 3 degrees off. A
robot must be listed if the foot of at least half of it is in view, and a pixel to either side of its foot leaves it
within its own size; others may be. "count right": as many listed as must be, those left out that may be. "error":
distance of what is listed from the middle of the robot's near side, median. "width": of what is whole in view, less the
robot's, without sign, median. "floor's end at feet": robots within 6 m in whose direction the free floor ends between
0.8 and 1.1 of their range. False ones are named by what is there: a robot listed "again", the ball, a goal, a beacon,
the end of the floor, or nothing but floor and lines.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.scores.obstacle_score import CAUSES, Listed, judge
from benchmarks.worlds.standing_robots import (
    Camera,
    fisheye_camera,
    forward_camera,
    mirror_camera,
    standing_frames,
)
from field_models import Field, field_names, load_field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.vision import Vision

START_STD = np.array([0.05, 0.05, math.radians(3.0)])
MIN_WITHIN_ONE = 0.90
FLOOR_ENDS = 0.8, 1.1
CAMERAS: dict[str, Callable[[Field], Camera]] = {
    "forward": forward_camera,
    "mirror": mirror_camera,
    "fisheye": fisheye_camera,
}
LOOKS = ("alone", "near a pose")


@dataclass(frozen=True, slots=True)
class Piece:
    """Pictures of one field by one kind of camera."""

    camera: str
    field: str
    seed: int
    count: int


def look_at(piece: Piece) -> dict[str, list[Listed]]:
    """Return what is listed in each picture, for each way to look."""
    field = load_field(piece.field)
    camera = CAMERAS[piece.camera](field)
    vision = Vision(field, camera)
    rng = np.random.default_rng([piece.seed, 0x5EE])
    listed: dict[str, list[Listed]] = {look: [] for look in LOOKS}
    for one in standing_frames(field, camera, piece.seed, piece.count):
        off = START_STD * rng.standard_normal(3)
        prior = PoseEstimate(Pose2(*(one.pose.array + off).tolist()), np.diag(START_STD**2), 1.0, 0.0)
        for look in LOOKS:
            vision.forget()
            view = vision.look(one.frame, prior=prior if look == LOOKS[1] else None)
            listed[look].append(judge(view, one, camera))
    return listed


def report(pieces: list[Piece], pool: Pool) -> None:
    """Print a table for each way to look."""
    results = list(pool.map(look_at, pieces))
    for look in LOOKS:
        table = Table(
            "camera and field          | count right: rate | within one: rate | found: rate | false: count | "
            f"error m: error 0.01 | width m: error 0.01 | floor's end at feet: rate | {' | '.join(CAUSES)} | "
            "target | verdict",
            f"Obstacles, {look}",
            name=look,
        )
        for camera in CAMERAS:
            parts = [
                (piece.field, result[look])
                for piece, result in zip(pieces, results, strict=True)
                if piece.camera == camera
            ]
            for name, listed in parts:
                _row(table, f"{camera}, {name}", listed, None)
            together = [one for _, listed in parts for one in listed]
            _row(table, f"{camera}, all", together, MIN_WITHIN_ONE)


def _row(table: Table, name: str, listed: Sequence[Listed], least: float | None) -> None:
    off = np.array([one.count_error for one in listed])
    within_one = float(np.mean(np.abs(off) <= 1))
    causes = Counter(cause for one in listed for cause in one.false)
    errors = [error for one in listed for error in one.errors_m]
    widths = [abs(off_m) for one in listed for off_m in one.widths_m]
    ends = np.array([end for one in listed for end in one.floor_ends])
    at_feet = (ends >= FLOOR_ENDS[0]) & (ends <= FLOOR_ENDS[1])
    is_met = least is None or within_one >= least
    table.row(
        name,
        percent(float(np.mean(off == 0))),
        percent(within_one),
        f"{sum(one.found for one in listed)}/{sum(one.certain for one in listed)}",
        sum(causes.values()),
        f"{np.median(errors):.3f}" if errors else None,
        f"{np.median(widths):.3f}" if widths else None,
        percent(float(at_feet.mean())) if len(ends) else None,
        *(causes[cause] for cause in CAUSES),
        None if least is None else percent(least),
        None if least is None else verdict(is_met),
        samples=len(listed),
    )


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    count = 1 if arguments.quick else 100 if arguments.full else 20
    kinds = [(camera, name) for camera in CAMERAS for name in field_names()]
    # the same seed draws as many robots on every field
    pieces = [Piece(*kind, arguments.seed + n, count) for n, kind in enumerate(kinds)]
    report(pieces, pool)
