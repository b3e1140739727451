"""Runs through rendered halls for landmark_poses.py and paper_hall.py, and the landmark maps made of such runs.

In the easy hall a rig of three cameras goes first and makes the map; one camera goes a little aside in dim light, and
once more after some posters have changed. In a lecture hall as hard as that of Ogawa et al. (2011) the rig goes 9.9 m
among people and under light that changes; on another visit, with other people, less light and a fifth of the posters
changed, one camera goes the same way a little aside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.harness import Kind, Pool, Table, verdict
from robocup_vision.arguments import as_frame
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.landmarks.features import Features, features_of
from robocup_vision.landmarks.landmark_map import LandmarkMap
from robocup_vision.landmarks.mapping.stereo_mapper import StereoMapper
from sim2d.hall_drive import SPEED_MPS
from sim2d.rendering.hall.bustle import Bustle
from sim2d.rendering.hall.hall import Hall, HallLight, loop_path, make_hall
from sim2d.rendering.hall.lecture_hall import LECTURE_SENSOR, WAY_M, make_lecture_hall, visit, way
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, HallFrame, take

SHIFT_M, DIM, MOVED = 0.2, 0.5, 0.3


class OrbExtractor:
    """Finds ORB features: a fraction of SIFT's time, and coarser. A map must be made with what it is used with."""

    def __init__(self, camera: PinholeCamera) -> None:
        self.camera = camera
        self._orb = cv2.ORB.create(nfeatures=800)

    def extract(self, frame: UInt8Array) -> Features:
        """Find the features of a frame, (H, W, 3) uint8 BGR; the descriptors' 256 bits as unit vectors."""
        as_frame(frame, self.camera.size_px)
        keypoints, packed = self._orb.detectAndCompute(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), None)
        if packed is None:
            return features_of(self.camera, (), None)
        bits = np.unpackbits(np.asarray(packed, dtype=np.uint8), axis=1)
        features = features_of(self.camera, keypoints, bits.astype(np.float32))
        octave = np.array([k.octave for k in keypoints], dtype=np.float64)
        scale = np.asarray(float(self._orb.getScaleFactor()) ** octave, dtype=np.float64)
        return Features(features.pixels, features.size_px, scale, features.contrast, features.descriptors)


class Built(NamedTuple):
    """A landmark map, the poses of the moments in it as the map's run takes them to have been, and which these are."""

    landmarks: LandmarkMap
    poses: list[Pose2]
    used: list[bool]


@dataclass(frozen=True, eq=False)
class HallRuns:
    """The three runs; the map of the first, that without drift bounds, and that of ORB."""

    first: list[HallFrame]
    second: list[HallFrame]
    third: list[HallFrame]
    map: Built
    drifted: Built
    orb: Built


def make_runs(seed: int, count: int, located: int, turns: float, rng: np.random.Generator, pool: Pool) -> HallRuns:
    """Render `turns` rounds, `count` frames of the first run and `located` of each other one, and build the maps."""
    hall = make_hall(seed)
    first_path, second_path = loop_path(count, turns=turns), loop_path(located, shift_m=SHIFT_M, turns=turns)
    changed = hall.rearranged(MOVED, rng)
    dim = HallLight(level=DIM)
    step = 12
    jobs: list[tuple[Hall, str, list[Pose2], int, int, HallLight | None]]
    jobs = [(hall, "rig", first_path[k : k + step], seed, k, None) for k in range(0, count, step)]
    rigs = len(jobs)
    for number, place in enumerate((hall, changed)):
        jobs += [(place, "one", second_path[k : k + step], seed + 1 + number, k, dim) for k in range(0, located, step)]
    parts_of_run = math.ceil(located / step)
    parts = list(pool.map(render, jobs))
    first_run = [f for part in parts[:rigs] for f in part]
    second = [f for part in parts[rigs : rigs + parts_of_run] for f in part]
    third = [f for part in parts[rigs + parts_of_run :] for f in part]
    ways = (
        partial(build, first_run, bound_drift=False),
        partial(build, first_run, orb=True),
        partial(build, first_run),
    )
    drifted, with_orb, built = pool.map(_built, ways)
    return HallRuns(first_run, second, third, built, drifted, with_orb)


def _built(build_map: Callable[[], Built]) -> Built:
    return build_map()


def render(job: tuple[Hall, str, list[Pose2], int, int, HallLight | None]) -> list[HallFrame]:
    """Render a part of a run: ("rig" or "one"), poses, seed, number of the first frame, light."""
    hall, kind, poses, seed, first, light = job
    cameras = (HALL_RIG.right, HALL_RIG.left, HALL_RIG.top) if kind == "rig" else (HALL_CAMERA,)
    return list(take(hall, cameras, poses, seed, first=first, light=light))


def build(frames: Sequence[HallFrame], *, bound_drift: bool = True, orb: bool = False) -> Built:
    """Build a map of three pictures a moment."""
    extractor = OrbExtractor(HALL_CAMERA) if orb else None
    mapper = StereoMapper(HALL_RIG, frames[0].pose, bound_drift=bound_drift, extractor=extractor)
    used = []
    for frame in frames:
        right, left, top = frame.images
        used.append(bool(mapper.add(right, left, top).pose))
    return Built(mapper.finish(), list(mapper.poses), used)


def drift(poses: Sequence[Pose2], frames: Sequence[HallFrame]) -> npt.NDArray[np.float64]:
    """Mean errors (3,) of the map's run, mm, mm, degrees."""
    return np.asarray(np.mean([off_by(p, f.pose) for p, f in zip(poses, frames, strict=True)], axis=0))


def off_by(pose: Pose2, truth: Pose2) -> npt.NDArray[np.float64]:
    """Absolute errors (3,), mm, mm, degrees."""
    turn = wrap_angle(pose.theta_rad - truth.theta_rad)
    return np.abs((1e3 * (pose.x_m - truth.x_m), 1e3 * (pose.y_m - truth.y_m), math.degrees(turn)))


# name, figure as printed, target, whether it is met; the figure is compared with earlier ones by its kind
Acceptance = tuple[str, str, str, bool, Kind]


def print_acceptance(rows: Sequence[Acceptance], samples: int) -> None:
    """Print what is asked of a hall's benchmark."""
    columns = "acceptance                               | measured: by row | target | verdict: by row"
    table = Table(columns, name="acceptance", samples=samples)
    for name, measured, target, ok, kind in rows:
        table.row(name, measured, target, verdict(ok), kind=kind)


def building(landmarks: LandmarkMap, count: int, rng: np.random.Generator) -> LandmarkMap:
    """Return a map of `count` landmarks: this hall's, and the same again in hall after hall beside it."""
    turn = np.arange(count) // len(landmarks)
    copies = np.concatenate([rng.permutation(len(landmarks)) for _ in range(int(turn[-1]) + 1)])[:count]
    side = math.isqrt(int(turn[-1])) + 1
    shift = np.stack([turn % side * 9.5, turn // side * 7.5, np.zeros(count)], axis=-1)
    order = np.argsort(landmarks.view_landmark, kind="stable")
    number = np.bincount(landmarks.view_landmark, minlength=len(landmarks))
    first = np.cumsum(number) - number
    of = np.repeat(np.arange(count), number[copies])
    within = np.arange(len(of)) - np.repeat(np.cumsum(number[copies]) - number[copies], number[copies])
    rows = order[first[copies[of]] + within]
    return LandmarkMap(
        landmarks.positions_m[copies] + shift, landmarks.covariances[copies], landmarks.noise[copies],
        landmarks.seen[copies], landmarks.missed[copies], of, landmarks.view_direction[rows],
        landmarks.view_descriptors[rows], landmarks.view_contrast[rows], landmarks.view_size_m[rows],
        landmarks.view_spacing_m[rows], landmarks.trajectory.copy(), landmarks.trajectory_cov.copy(),
    )  # fmt: skip


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
