"""Runs through a lecture hall as hard as that of Ogawa et al. (2011), and the map of the first: for paper_hall.py.

A rig of three cameras goes 9.9 m among people and under light that changes, and makes the map. On another visit, with
other people, less light and a fifth of the posters changed, one camera goes the same way a little aside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from benchmarks.harness.pool import Pool
from benchmarks.worlds.hall_runs import build
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.landmark_map import LandmarkMap
from sim2d.hall_drive import SPEED_MPS
from sim2d.rendering.hall.bustle import Bustle
from sim2d.rendering.hall.hall import Hall
from sim2d.rendering.hall.lecture_hall import LECTURE_SENSOR, WAY_M, make_lecture_hall, visit, way
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, HallFrame, take

ASIDE_M, LATER_LEVEL, CHANGED = 0.15, 0.6, 0.2
MOMENTS = 143
INTERVAL_S = WAY_M / SPEED_MPS / MOMENTS
_PIECE = 12


@dataclass(frozen=True, eq=False)
class LectureRuns:
    """The runs and the map."""

    first: list[HallFrame]  #: of the moments that are in the map: its three pictures and the depths they show
    poses: list[Pose2]  #: where the map's run takes the robot to have been at these
    lost: int  #: moments of which the mapper knew no pose
    landmarks: LandmarkMap  #: the map
    later: list[HallFrame]  #: pictures of one camera on another visit


@lru_cache(maxsize=2)
def lecture(seed: int, later: bool) -> tuple[Hall, Bustle]:
    """Return the hall of a seed and what goes on there on the map's visit, or later."""
    hall = make_lecture_hall(seed)
    if not later:
        return visit(hall, seed)
    return visit(hall.rearranged(CHANGED, np.random.default_rng([seed, 2])), seed + 1, level=LATER_LEVEL)


def make_lecture_runs(seed: int, moments: int, pool: Pool) -> LectureRuns:
    """Render the runs, so many moments from the way's start on, and build the map."""
    starts = range(0, moments, _PIECE)
    jobs = [(seed, later, k, min(k + _PIECE, moments)) for later in (False, True) for k in starts]
    parts = list(pool.map(_render, jobs))
    first = [frame for part in parts[: len(starts)] for frame in part]
    later = [frame for part in parts[len(starts) :] for frame in part]
    built = build(first)
    known = [frame for frame, is_used in zip(first, built.used, strict=True) if is_used]
    return LectureRuns(known, built.poses, len(first) - len(known), built.landmarks, later)


def _render(job: tuple[int, bool, int, int]) -> list[HallFrame]:
    seed, later, start, end = job
    hall, bustle = lecture(seed, later)
    poses: Sequence[Pose2] = way(MOMENTS, shift_m=ASIDE_M if later else 0.0)[start:end]
    cameras = (HALL_CAMERA,) if later else (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top)
    return list(
        take(
            hall, cameras, poses, seed + later, bustle=bustle, interval_s=INTERVAL_S, sensor=LECTURE_SENSOR,
            first=start, depths=True,
        )
    )  # fmt: skip
