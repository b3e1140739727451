"""Poses from one picture of a goal: the direct fit, two perspective solvers and Yako et al.'s method side by side.

The 66 places of the paper, under each condition; then pictures that show no whole goal, on which any pose is false.
"plain" is nearest to what the paper describes: no glare, an even wall behind the goal. "printed" is what the paper says
of its 66 photographs (tables 3 and 4); "angles" its method as printed, and by the closed form instead of the table;
"ours" the direct fit; "goal alone" the same on pictures without any line, by a field file without any. The columns are
the ratios of all pictures within 20 cm, and within 20, 10 and 1 % of the distance to the goal's middle.

The solvers get the best four corners that the direct fit's own sub-pixel edges give, measured around the goal it takes:
through the samples of each silhouette edge a robust line; the axes of posts and bar half-way between their edges, as
angles; the bar's axis crossed with the posts' axes, and these with the feet.
"""

from __future__ import annotations

import dataclasses
import math
from argparse import Namespace
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.harness import Pool, Table, judge, percent, program, verdict
from field_models import load_field
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.baselines.goal_angles import GoalAnglesEstimator
from robocup_vision.localization.forward import GoalLocalizer
from robocup_vision.localization.goal.edges import FOOT_OFFSETS
from robocup_vision.localization.goal.geometry import (
    BAR_BOTTOM,
    BAR_TOP,
    LEFT_INNER,
    LEFT_OUTER,
    RIGHT_INNER,
    RIGHT_OUTER,
)
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.localizer import frame_alone
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, NEGATIVE_VIEWS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
BARE_FIELD = dataclasses.replace(FIELD, lines=np.empty((0, 4)), arcs=np.empty((0, 5)))
CONDITIONS = {
    "plain_416x320": dataclasses.replace(GOAL_CONDITIONS["clean_416x320"], backdrop="plain")
} | GOAL_CONDITIONS
# condition -> least ratios within 20 cm, and within 20 %, 10 % and 1 % of the distance, with lines
MIN = {
    "plain_416x320": (1.0, 1.0, 1.0, 0.85),
    "clean_416x320": (1.0, 1.0, 1.0, 0.85),
    "mild_glare_416x320": (0.99, 1.0, 1.0, 0.80),
    "heavy_glare_416x320": (0.97, 0.97, 0.97, 0.75),
    "streaks_416x320": (0.97, 0.97, 0.97, 0.75),
    "mild_glare_208x160": (0.92, 0.99, 0.99, 0.58),
}
# and by the goal alone, where that is measured
MIN_ALONE = {
    "plain_416x320": (1.0, 1.0, 1.0, 0.85),
    "mild_glare_416x320": (1.0, 1.0, 1.0, 0.85),
    "heavy_glare_416x320": (0.97, 0.97, 0.97, 0.75),
}
# of 66 photographs, 64 located
PRINTED = (33 / 66, 52 / 66, 38 / 66, 16 / 66)
OURS, ALONE = "ours", "ours, goal alone"
ANGLES, CLOSED = "angles, as printed", "angles, closed form"
METHODS = (OURS, ALONE, "IPPE", "SQPNP", ANGLES, CLOSED)
NEES_RANGE = (1.5, 6.0)
MIN_SAMPLES = 4
# a pose by lines on a field of white goals is false if it is off by more
MAX_OFF_M = 0.2


@dataclass(frozen=True)
class Score:
    """One method on one picture: errors (m, of the distance, degrees), infinite where not located, and NEES."""

    error_m: float
    relative: float
    angle_deg: float
    nees: float


MISSED = Score(math.inf, math.inf, math.inf, math.nan)


def axis(candidate: Candidate, edges: tuple[int, int]) -> FloatArray | None:
    """Line (3,) in the ideal image, a u + b v + c = 0, of a post's or the bar's axis; None with too few samples."""
    samples, view = candidate.fit.samples, candidate.model.view
    planes = []
    for edge in edges:
        uv = samples.uv[samples.edge == edge].astype(np.float32)
        if len(uv) < MIN_SAMPLES:
            return None
        du, dv, u, v = cv2.fitLine(uv, cv2.DIST_HUBER, 0, 0.01, 0.01).ravel().tolist()
        # through the camera and the edge; both edges run the same way, upwards or to the right
        sign = math.copysign(1.0, du if edge in (BAR_TOP, BAR_BOTTOM) else -dv)
        line = sign * np.array([-dv, du, u * dv - v * du])
        plane = line @ intrinsics(view.focal_px, view.center_px)
        planes.append(plane / np.linalg.norm(plane))
    return np.asarray((planes[0] + planes[1]) @ np.linalg.inv(intrinsics(view.focal_px, view.center_px)))


def intrinsics(focal_px: tuple[float, float], center_px: tuple[float, float]) -> FloatArray:
    """Return the camera matrix (3, 3)."""
    return np.array([[focal_px[0], 0, center_px[0]], [0, focal_px[1], center_px[1]], [0, 0, 1.0]])


def foot(candidate: Candidate, post: int, post_axis: FloatArray, camera_height_m: float) -> FloatArray | None:
    """Where a post's axis meets the floor, ideal pixels (2,): behind the near half of its foot, which is what shows."""
    samples, view, shape = candidate.fit.samples, candidate.model.view, candidate.model.shape
    at = samples.foot_post == post
    outer, inner = (LEFT_OUTER, LEFT_INNER) if post == 0 else (RIGHT_OUTER, RIGHT_INNER)
    if at.sum() < 2 or min(np.count_nonzero(samples.edge == e) for e in (outer, inner)) < MIN_SAMPLES:
        return None
    low, high = (np.median(samples.uv[samples.edge == e], axis=0) for e in (outer, inner))
    width_px = abs(post_axis[:2] @ (high - low)) / np.hypot(*post_axis[:2])
    distance_m = 2 * shape.radius_m * view.focal_px[0] / width_px
    sag_px = view.focal_px[1] * camera_height_m * shape.radius_m / distance_m**2
    hidden = sag_px * np.sqrt(1 - FOOT_OFFSETS[samples.foot_at[at]] ** 2)
    v = float(np.median(samples.foot_uv[at, 1] - hidden))
    return np.array([-(post_axis[1] * v + post_axis[2]) / post_axis[0], v])


def corners(candidate: Candidate, camera_height_m: float) -> FloatArray | None:
    """Left foot, left top, right top, right foot (4, 2) of the axes, ideal pixels; None where edges are missing."""
    posts = [axis(candidate, edges) for edges in ((LEFT_OUTER, LEFT_INNER), (RIGHT_OUTER, RIGHT_INNER))]
    bar = axis(candidate, (BAR_TOP, BAR_BOTTOM))
    found = []
    for k, post in enumerate(posts):
        low = None if post is None else foot(candidate, k, post, camera_height_m)
        if post is None or bar is None or low is None:
            return None
        top = np.cross(post, bar)
        found.append((low, top[:2] / top[2]))
    (left_foot, left_top), (right_foot, right_top) = found
    return np.array([left_foot, left_top, right_top, right_foot])


def solver(pixels: FloatArray, candidate: Candidate, height_m: float, flag: int) -> Pose2 | None:
    """Pose by a perspective solver; of several solutions the one nearest the camera's known height."""
    view, shape = candidate.model.view, candidate.model.shape
    half, top = shape.width_m / 2, shape.height_m
    # the goal's plane: X to the right as seen, Y up, Z towards the field
    points = np.array([[-half, 0, 0], [-half, top, 0], [half, top, 0], [half, 0, 0]], dtype=np.float64)
    _, turns, shifts, *_ = cv2.solvePnPGeneric(
        points, pixels, intrinsics(view.focal_px, view.center_px), np.zeros(4), flags=flag
    )
    best: tuple[float, Pose2] | None = None
    for turn, shift in zip(turns, shifts, strict=True):
        rotation = cv2.Rodrigues(turn)[0]
        eye, forward = (-rotation.T @ shift).ravel(), rotation[2]
        pose = Pose2(float(shape.line_x_m - eye[2]), float(-eye[0]), math.atan2(-forward[0], -forward[2]))
        off = abs(eye[1] - height_m)
        if best is None or off < best[0]:
            best = (off, pose)
    if best is None:
        return None
    return best[1] if candidate.sides[0] > 0 else best[1].half_turn()


def score(pose: Pose2 | None, truth: Pose2, covariance: npt.NDArray[np.float64] | None = None) -> Score:
    """Compare a pose with the truth."""
    if pose is None:
        return MISSED
    error, angle = pose.error_to(truth)
    distance = math.hypot(FIELD.length_m / 2 - truth.x_m, truth.y_m)
    nees = math.nan
    if covariance is not None:
        offset = pose.array - truth.array
        offset[2] = wrap_angle(offset[2])
        nees = float(offset @ np.linalg.solve(covariance, offset))
    return Score(error, error / distance, math.degrees(angle), nees)


def measure(job: tuple[str, int, tuple[int, ...], int]) -> list[dict[str, Score]]:
    """All methods on some of a condition's pictures."""
    name, seed, indices, supersample = job
    condition, places = CONDITIONS[name], paper_places(FIELD)
    direct, alone = (GoalPoseEstimator(field, condition.camera) for field in (FIELD, BARE_FIELD))
    angles, closed = (
        GoalAnglesEstimator(FIELD, condition.camera, closed_form=closed_form) for closed_form in (False, True)
    )
    search = GoalSearch(FIELD, condition.camera)
    pictures, bare = (
        sample_goal(field, condition, seed, 66, places=places, indices=indices, supersample=supersample)
        for field in (FIELD, BARE_FIELD)
    )
    rows = []
    for s in pictures:
        candidates, _ = search.candidates(search.picture(s.frame))
        pixels = corners(candidates[0], condition.camera.height_m) if candidates else None
        row = {}
        for method, estimator in ((OURS, direct), (ANGLES, angles), (CLOSED, closed)):
            estimate = estimator.locate(s.frame)
            row[method] = score(estimate.pose, s.pose, estimate.covariance) if estimate else MISSED
        if name in MIN_ALONE:
            shown = next(bare)
            estimate = alone.locate(shown.frame)
            row[ALONE] = score(estimate.pose, shown.pose, estimate.covariance) if estimate else MISSED
        for method, flag in (("IPPE", cv2.SOLVEPNP_IPPE), ("SQPNP", cv2.SOLVEPNP_SQPNP)):
            pose = None if pixels is None else solver(pixels, candidates[0], condition.camera.height_m, flag)
            row[method] = score(pose, s.pose)
        rows.append(row)
    return rows


def false_poses(job: tuple[str, int, int]) -> list[str]:
    """Name what was located without a whole goal; by lines, which do on a field of white goals, what is off."""
    name, seed, count = job
    is_white, camera = name.startswith("white"), GOAL_CONDITIONS[name].camera
    field = load_field("spl_2020") if is_white else FIELD
    localizer, found = GoalLocalizer(field, camera), []
    for s in sample_goal(field, GOAL_CONDITIONS[name], seed, count, views=NEGATIVE_VIEWS, supersample=2):
        pose = localizer.locate(frame_alone(s.frame, camera)).pose
        if pose and not (is_white and pose.pose.error_to(s.pose, symmetric=True)[0] <= MAX_OFF_M):
            found.append(f"{name} {s.view} {s.index}")
    return found


def ratios(scores: list[Score]) -> tuple[float, ...]:
    """Of all pictures, those within 20 cm, and within 20 %, 10 % and 1 % of the distance."""
    error, relative = (np.array([getattr(s, key) for s in scores]) for key in ("error_m", "relative"))
    return (float((error <= 0.2).mean()), *(float((relative <= most).mean()) for most in (0.2, 0.1, 0.01)))


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    seeds = 4 if arguments.full else 1
    step, parts, supersample = (33, 1, 2) if arguments.quick else (1, 4, 4)
    negatives = 1 if arguments.quick else 150 if arguments.full else 50
    places = list(range(0, 66, step))
    table = Table(
        "condition            | method: label | located: rate | 20 cm %: rate | 20 %: rate | 10 %: rate | "
        "1 %: rate | median m: error | NEES | verdict",
        name="poses",
        samples=seeds * len(places),
    )
    table.row("photographs", "printed", "64/66", *(percent(ratio) for ratio in PRINTED), None, None, None)
    for name in MIN:
        jobs = [
            (name, arguments.seed + k, tuple(places[i::parts]), supersample) for k in range(seeds) for i in range(parts)
        ]
        rows = [row for part in pool.map(measure, jobs) for row in part]
        for method in (method for method in METHODS if method in rows[0]):
            scores = [row[method] for row in rows]
            nees = np.array([s.nees for s in scores])
            mean_nees = float(np.nanmean(nees)) if np.isfinite(nees).any() else None
            least = {OURS: MIN, ALONE: MIN_ALONE}.get(method, {}).get(name)
            ok = True
            if least is not None:
                turned = [s.angle_deg for s in scores if s.error_m <= 0.2]
                ok = all(got >= need for got, need in zip(ratios(scores), least, strict=True))
                ok &= mean_nees is not None and NEES_RANGE[0] <= mean_nees <= NEES_RANGE[1]
                ok &= max(turned, default=math.inf) <= 1.0
            table.row(
                name if method == OURS else "",
                method,
                f"{sum(math.isfinite(s.error_m) for s in scores)}/{len(scores)}",
                *(percent(ratio) for ratio in ratios(scores)),
                float(np.median([s.error_m for s in scores])),
                mean_nees if method in (OURS, ALONE) else None,
                None if least is None else verdict(ok),
            )
    names = [name for name in GOAL_CONDITIONS if name != "clean_208x160"]
    found = [text for part in pool.map(false_poses, [(n, arguments.seed, negatives) for n in names]) for text in part]
    judge(not found)
    table = Table("pictures without a whole goal | pictures | false poses: count | verdict", name="false poses")
    table.row("all conditions", negatives * len(names), len(found), verdict(not found))
    for text in found:
        table.note(f"  {text}")
