"""The experiments of Ogawa et al. (2011) in a rendered hall as hard as theirs: Tables 1 and 2, and the drive.

One kind of chair and three posters many times over, lamps that go on and off, people who pass: three cameras go 9.9 m
through it once and make the map. Then

- the paper's protocol: the left camera's images of that run; the truth is where the map puts that camera;
- another visit, with other people, less light and a fifth of the posters changed, 0.15 m aside, against the real truth;
- the drive: 0.15 m/s along the map's run by `LandmarkVision` alone, from 0.2 m aside, on that other visit.

The prior of a frame is the estimate of the frame before, and never the truth. Nobody searches the whole map in the
first two: where a frame gives no pose, the last one stays, as prior and as the pose whose error counts. Errors are
mean absolute ones of all frames. A match is wrong if its landmark is more than 6 pixels from its feature when seen from
the true pose, or if what the feature shows is over a quarter nearer or farther. Matching time is what finding the
landmarks among an image's features takes, the lesser of two looks, the median of the frames: others use the processors,
too. It contains no feature extraction, selection or fit.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.harness import Kind, Pool, Table, percent, program
from benchmarks.worlds.hall_runs import (
    ASIDE_M,
    MOMENTS,
    Acceptance,
    lecture,
    make_lecture_runs,
    off_by,
    print_acceptance,
)
from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.features import Features, SiftExtractor
from robocup_vision.landmarks.landmark_map import LandmarkMap
from robocup_vision.landmarks.locate import LandmarkMatch, LandmarkPoseEstimator
from robocup_vision.landmarks.mapping.stereo import correspond
from robocup_vision.landmarks.pose_fit import project, to_camera
from robocup_vision.landmarks.selection import Selection
from robocup_vision.landmarks.vision import LandmarkVision
from sim2d.hall_drive import DriveStep, drive
from sim2d.rendering.hall.lecture_hall import LECTURE_SENSOR, WAY_M
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_RIG, HallFrame

# printed: x mm, y mm, degrees, ms, projected, matched
PAPER_ALL = (14.95, 10.70, 0.16, 472.36, 1924.59, 58.00)
PAPER_CELLS = {
    (0.1, 0.1): (12.76, 10.33, 0.10, 32.14, 169.37, 63.45),
    (0.1, 0.3): (11.55, 9.09, 0.08, 23.52, 129.10, 52.24),
    (0.1, 0.5): (11.91, 9.22, 0.08, 21.29, 120.38, 49.61),
    (0.3, 0.1): (12.93, 12.46, 0.15, 9.37, 59.07, 26.04),
    (0.3, 0.3): (16.03, 20.18, 0.22, 4.71, 34.00, 15.86),
    (0.3, 0.5): (17.32, 20.37, 0.22, 4.25, 28.02, 13.01),
    (0.5, 0.1): (20.07, 25.36, 0.31, 6.23, 37.50, 17.50),
    (0.2, 0.2): (13.31, 9.72, 0.12, 10.13, 65.35, 28.38),
    (0.2, 0.3): (13.85, 14.37, 0.16, 8.88, 56.36, 24.81),
    (0.2, 0.4): (13.71, 13.98, 0.15, 7.96, 53.66, 23.97),
    (0.2, 0.5): (13.70, 13.19, 0.14, 8.30, 48.84, 22.05),
    (0.2, 0.6): (12.80, 12.18, 0.13, 7.19, 49.42, 22.49),
    (0.1, math.inf): (19.60, 12.29, 0.16, 20.26, 115.33, 54.44),
    (0.2, math.inf): (33.22, 39.87, 0.49, 6.1, 45.15, 22.96),
}
PAPER_FREQUENCY = (171.40, 268.63, 3.44, 7.92, 50.00, 15.45)
PAPER_NO_CONTRAST = (32.69, 38.28, 0.46, 8.13, 48.82, 24.59)
COLUMNS = (
    "landmarks                     | located: rate | x mm: error | y mm: error | deg: error | match ms | "
    "looked for | matched | paper: mm, mm, deg, ms, for, matched"
)
START_ASIDE_M = 0.2
_OFF_PX, _OFF_RATIO, _REPEATS = 6.0, 1.25, 2


@dataclass(frozen=True, eq=False)
class Track:
    """One way of choosing landmarks along a run, frame by frame."""

    errors: FloatArray  #: (N, 3) float64: absolute, mm, mm, degrees
    located: npt.NDArray[np.bool_]  #: (N,) bool: which frames gave a pose
    #: (N,) int64: landmarks, those that agree with the pose, and those of them that are wrong
    looked_for: npt.NDArray[np.int64]
    matched: npt.NDArray[np.int64]
    wrong: npt.NDArray[np.int64]
    match_ms: FloatArray  #: (N,) float64: matching time

    @property
    def mean(self) -> FloatArray:
        """Mean errors (3,)."""
        return np.asarray(self.errors.mean(axis=0))


def follow(
    estimator: LandmarkPoseEstimator,
    run: Sequence[Features],
    depths_m: Sequence[Float32Array],
    truth: Sequence[Pose2],
) -> Track:
    """Follow a run: it starts where the robot about is, and each frame starts from the estimate before."""
    pose = truth[0]
    rows = []
    for features, depth_m, true in zip(run, depths_m, truth, strict=True):
        looks = [estimator.look_near(features, pose) for _ in range(_REPEATS)]
        sight = looks[0]
        if sight.pose:
            pose = sight.pose.pose
        rows.append(
            (
                *off_by(pose, true), bool(sight.pose), len(sight.expected),
                int(sight.inliers.sum()), wrong_matches(estimator, sight, depth_m, true),
                1e3 * min(look.timings_s["match"] for look in looks),
            )
        )  # fmt: skip
    table = np.array(rows)
    counts = table[:, 4:7].astype(np.int64)
    return Track(table[:, :3], table[:, 3] > 0, counts[:, 0], counts[:, 1], counts[:, 2], table[:, 7])


def wrong_matches(estimator: LandmarkPoseEstimator, sight: LandmarkMatch, depth_m: Float32Array, truth: Pose2) -> int:
    """Return how many of the matches that agree with a pose are wrong."""
    if not sight.pose:
        return 0
    pixels = sight.pixels[sight.inliers]
    landmarks = estimator.landmarks.positions_m[sight.expected.landmark[sight.matched[sight.inliers]]]
    points = to_camera(estimator.camera, truth.array, landmarks)
    off = np.hypot(*(project(estimator.camera, points) - pixels).T)
    near, far = depth_range(depth_m, pixels)
    elsewhere = (points[:, 0] < near / _OFF_RATIO) | (points[:, 0] > far * _OFF_RATIO)
    return int((~(off <= _OFF_PX) | elsewhere).sum())


def depth_range(depth_m: Float32Array, pixels: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Return the least and the greatest depth within 4 pixels of some places (N, 2): features lie on edges, too."""
    window = np.ones((9, 9), dtype=np.uint8)
    column, row = np.rint(pixels).astype(np.int64).T
    near, far = cv2.erode(depth_m, window)[row, column], cv2.dilate(depth_m, window)[row, column]
    return np.asarray(near, dtype=np.float32), np.asarray(far, dtype=np.float32)


def found(picture: UInt8Array) -> Features:
    """Find a picture's features."""
    return SiftExtractor(HALL_CAMERA).extract(picture)


def wrong_in_stereo(frame: HallFrame) -> tuple[int, int]:
    """Return how many correspondences of three images are wrong, by over 2 pixels of disparity, and of how many."""
    right, left, top = (found(image) for image in frame.images)
    points = correspond(HALL_RIG, right, left, top)
    near, far = depth_range(frame.depths_m[0], points.measured_px[:, :2])
    disparity, low, high = (
        HALL_CAMERA.focal_px[0] * HALL_RIG.baseline_m / depth for depth in (points.points_m[:, 0], far, near)
    )
    return int(((disparity < low - 2) | (disparity > high + 2)).sum()), len(points)


def row(table: Table, name: str, track: Track, paper: tuple[float, ...] = ()) -> None:
    """Print one way of choosing."""
    table.row(
        name, f"{track.located.sum()}/{len(track.located)}", *(float(v) for v in track.mean),
        float(np.median(track.match_ms)), float(track.looked_for.mean()), float(track.matched.mean()),
        ", ".join(f"{v:g}" for v in paper),
    )  # fmt: skip


def series(tracks: dict[str, Track], run: Sequence[Features]) -> None:
    """Print, and plot where Matplotlib is installed, what each frame took: the paper's Figure 7."""
    names = list(tracks)
    columns = ("frames    | features", *(f"{kind}, {name}" for kind in ("for", "ms") for name in names))
    table = Table(columns, "Along the run: landmarks looked for (means) and matching time (medians)", name="series")
    step = 13
    for first in range(0, len(run), step):
        part = slice(first, first + step)
        table.row(
            f"{first} to {min(first + step, len(run)) - 1}", float(np.mean([len(f) for f in run[part]])),
            *(float(tracks[name].looked_for[part].mean()) for name in names),
            *(float(np.median(tracks[name].match_ms[part])) for name in names),
        )  # fmt: skip
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("matplotlib: not installed, no plot")
        return
    figure = Figure(figsize=(7, 5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.semilogy([len(f) for f in run], color="grey", label="features of the image")
    for name in names:
        above.semilogy(tracks[name].looked_for, label=f"looked for: {name}")
        below.semilogy(tracks[name].match_ms, label=name)
    above.legend(fontsize=8)
    below.legend(fontsize=8)
    below.set_ylabel("matching time, ms")
    below.set_xlabel("frame")
    path = Path("out") / "ogawa_times.png"
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=100)
    print("plot:", path)


def driven(job: tuple[int, LandmarkMap, list[Pose2]]) -> list[DriveStep]:
    """Drive along a path from beside its start."""
    seed, landmarks, path = job
    hall, bustle = lecture(seed, True)
    start = path[0].compose(Pose2(0.0, START_ASIDE_M, 0.0))
    rng = np.random.default_rng([seed, 9])
    return list(drive(LandmarkVision(landmarks, HALL_CAMERA), hall, bustle, path, start, LECTURE_SENSOR, rng))


def print_drive(path: Sequence[Pose2], steps: Sequence[DriveStep]) -> float:
    """Print the drive; return how far from the path's end it ended, metres."""
    off = np.array([step.off_path_m for step in steps])
    settled_s = min(10.0, steps[-1].t_s / 2)
    settled = off[[step.t_s >= settled_s for step in steps]]
    errors = [1e3 * step.pose.pose.error_to(step.truth)[0] for step in steps if step.pose]
    away_m = math.hypot(*(steps[-1].truth.array - path[-1].array)[:2])
    table = Table(
        (
"start            | located: rate | s | worst mm: error | RMS mm: error | end mm: error | "
"error mm: error | worst"
),
        f"The drive, {WAY_M * len(path) / MOMENTS:.1f} m: off the path after {settled_s:g} s, off its end, "
        "error of the estimates",
        name="drive", samples=len(steps),
    )  # fmt: skip
    table.row(
        f"{START_ASIDE_M:g} m to the left", f"{len(errors)}/{len(steps)}", steps[-1].t_s,
        1e3 * float(settled.max(initial=0.0)), 1e3 * float(np.sqrt((settled**2).mean())), 1e3 * away_m,
        float(np.median(errors)), float(np.max(errors)),
    )  # fmt: skip
    return away_m


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    seed = arguments.seed
    acceptance: list[Acceptance] = []
    runs = make_lecture_runs(seed, 14 if arguments.quick else MOMENTS, pool)
    landmarks, own = runs.landmarks, runs.poses
    (steps,) = pool.map(driven, [(seed, landmarks, own)])
    pictures = [frame.images[1] for frame in runs.first] + [frame.images[0] for frame in runs.later]
    features = list(pool.map(found, pictures, chunksize=12))
    stereo = list(pool.map(wrong_in_stereo, runs.first[::4]))
    left, later = features[: len(runs.first)], features[len(runs.first) :]
    left_depths = [frame.depths_m[1] for frame in runs.first]
    samples = len(left)

    def along_own(how: Selection) -> Track:
        estimator = LandmarkPoseEstimator(landmarks, HALL_RIG.left, selection=how)
        return follow(estimator, left, left_depths, own)

    cells = Selection("cells")
    size = f"{samples} moments in the map, {runs.lost} left out; {len(landmarks)} landmarks"
    table = Table(COLUMNS, f"Table 1, the paper's protocol: {size}", name="table 1", samples=samples)
    everything = along_own(Selection("all"))
    informative = {count: along_own(Selection(at_most=count)) for count in (60, 120)}
    chosen = informative[60]
    row(table, "all", everything, PAPER_ALL)
    grid = list(PAPER_CELLS) if not arguments.quick else [(0.2, 0.5)]
    settings = {key: along_own(replace(cells, alpha=key[0], beta=key[0], gamma=min(key[1], 1e6))) for key in grid}
    for (alpha, gamma), track in settings.items():
        row(table, f"cells {alpha:g}, {alpha:g}, {gamma:g}", track, PAPER_CELLS[alpha, gamma])
    for count, track in informative.items():
        row(table, f"{count} informative ones of cells", track)

    proposed = settings[0.2, 0.5]
    frequency = along_own(Selection("frequency", at_most=50))
    table = Table(COLUMNS, "Table 2, the paper's protocol", name="table 2", samples=samples)
    row(table, "all", everything, PAPER_ALL)
    row(table, "cells 0.2, 0.2, 0.5", proposed, PAPER_CELLS[0.2, 0.5])
    row(table, "50 by frequency, no cells", frequency, PAPER_FREQUENCY)
    row(table, "cells, without contrast", along_own(replace(cells, by_contrast=False)), PAPER_NO_CONTRAST)
    row(table, "60 informative ones of cells", chosen)
    fails = float(np.hypot(*frequency.mean[:2]) / np.hypot(*proposed.mean[:2]))
    acceptance.append(("frequency alone / cells, error", f"{fails:.3g}", ">= 10; paper: 17", fails >= 10, Kind.TEXT))

    table = Table(
        "matches                | wrong %: loss | wrong | of | paper %", "Wrong matches", name="wrong",
        samples=samples,
    )  # fmt: skip
    wrong, of = (sum(part) for part in zip(*stereo, strict=True))
    table.row("three cameras, every 4th", percent(wrong / of), wrong, of, "0")
    for name, track in (("map, all", everything), ("map, cells", proposed), ("map, 60 informative", chosen)):
        wrong, of = int(track.wrong.sum()), int(track.matched.sum())
        table.row(name, percent(wrong / max(of, 1)), wrong, of, "0.03" if track is everything else "")
    series({"all": everything, "cells": proposed, "60": chosen}, left)

    later_depths, truth = [frame.depths_m[0] for frame in runs.later], [frame.pose for frame in runs.later]
    table = Table(COLUMNS, f"Another visit, {ASIDE_M} m aside, real truth", name="another visit", samples=len(later))
    visits = {}
    for name, how in (
        ("all", Selection("all")), ("cells 0.2, 0.2, 0.5", cells), ("60 informative ones of cells", Selection()),
        ("120 informative ones of cells", Selection(at_most=120)),
        ("50 by frequency, no cells", Selection("frequency", at_most=50)),
    ):  # fmt: skip
        visits[name] = follow(LandmarkPoseEstimator(landmarks, HALL_CAMERA, selection=how), later, later_depths, truth)
        row(table, name, visits[name])

    for count, few in informative.items():
        visited = visits[f"{count} informative ones of cells"]
        for name, ratio in (
            (f"own run: errors of {count} / all", few.mean / everything.mean),
            (f"another visit: errors of {count} / all", visited.mean / visits["all"].mean),
        ):
            text = ", ".join(f"{v:.2f}" for v in ratio)
            acceptance.append((name, text, "<= 1.5", bool((ratio <= 1.5).all()), Kind.VERDICT))
        saving = float(np.median(everything.match_ms) / np.median(few.match_ms))
        acceptance.append((f"matching time of all / {count}", f"{saving:.0f}", ">= 57", saving >= 57, Kind.TEXT))

    away_m = print_drive(own, steps)
    acceptance.append(("end of the drive, mm off", f"{1e3 * away_m:.0f}", "<= 100", away_m <= 0.1, Kind.TEXT))
    print_acceptance(acceptance, samples)
