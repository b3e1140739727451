"""Where to look for the own pose: the planned gaze beside a fixed sweep, by landmarks and by rendered frames.

Miura and Shirai 2004, section 6.1. A dog walks among five others and pans its head. Landmarks are measured as the
detectors of the first table measure them, and followed by a Kalman filter of bearings and elevations; then the same
with rendered frames, the goal localiser and PoseFilter themselves. RMS and |P|^(1/6) are medians over runs; both must
hold the targets. A frame is lost where the position errs by over 0.5 m.
"""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.worlds.walking_dog import (
    CAMERA,
    FIELD,
    FRAME_S,
    MARK_FARTHEST_M,
    MARKS,
    NECK,
    ODOMETRY,
    OTHER_HEIGHT_M,
    OTHER_RADIUS_M,
    PLACES,
    RUN_S,
    LandmarkFilter,
    blockers_of,
    draw_walk,
    drift_of,
    project,
    see_landmarks,
)
from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.localization.goal.geometry import HEIGHT, ROLL, TILT
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.planning.gaze.pose_gaze import DETECTORS, GOAL_DETECTORS, PoseGaze, PoseGazeSettings
from robocup_vision.vision import Vision
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Robot, Scene
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

LOST_M = 0.5
RULES = ("planned", "planned, |P|", "fixed sweep")
MAX_RMS, MAX_SPREAD = 0.95, 0.85
RENDERED_S, QUICK_RENDERED_S, RENDERED_FRAME_S = 6.0, 1.5, 0.1


@dataclass(frozen=True)
class RunScore:
    """One run: RMS of the position (m), mean |P|^(1/6), ratios of frames lost and of frames that showed nothing."""

    rms_m: float
    spread: float
    lost: float
    empty: float


def landmark_run(job: tuple[list[int], str]) -> RunScore:
    """Follow one walk by landmarks under one rule."""
    seed, rule = job
    walk = draw_walk(seed, RUN_S, FRAME_S)
    rng = np.random.default_rng([*seed, 1])
    start = np.array([0.15, 0.15, 0.1])
    first = Pose2(*(walk.poses[0].array + start * rng.standard_normal(3)))
    track = LandmarkFilter(first, np.diag(start**2))
    criterion: Literal["volume", "position"] = "volume" if rule.endswith("|P|") else "position"
    gaze = PoseGaze(FIELD, CAMERA, NECK, settings=PoseGazeSettings(criterion=criterion, frame_s=FRAME_S))
    pan, errors, spreads, empty = 0.0, [], [], 0
    for k in range(1, len(walk.poses)):
        noise = drift_of(walk.odometry[k], FRAME_S)
        track.predict(walk.odometry[k], noise)
        marks, measured, std = see_landmarks(walk.poses[k], pan, walk.others[k], rng)
        if len(marks):
            track.update(marks, measured, std)
        empty += not len(marks)
        t_s = k * FRAME_S
        blockers = blockers_of(walk, k, rng)
        wanted = 0.0
        if rule.startswith("planned"):
            gaze.observe(len(marks) > 0, pan)
            belief = PoseEstimate(track.pose, track.covariance, 1.0, 0.0)
            wanted = gaze.choose(belief, t_s, pan, blockers, noise / FRAME_S).pan_rad
        elif rule == "fixed sweep":
            wanted = NECK.sweep(t_s)
        pan = NECK.turned(pan, wanted, FRAME_S)
        errors.append(track.pose.error_to(walk.poses[k])[0])
        spreads.append(max(float(np.linalg.det(track.covariance)), 0.0) ** (1 / 6))
    return _scored(errors, spreads, empty)


def _scored(errors_m: list[float], spreads: list[float], empty: int) -> RunScore:
    """Sum up a run; NaN where nothing was believed."""
    error = np.array(errors_m)
    lost = float((~(error <= LOST_M)).mean())
    return RunScore(float(np.sqrt(np.nanmean(error**2))), float(np.nanmean(spreads)), lost, empty / len(error))


def rendered_run(job: tuple[list[int], str, float]) -> RunScore:
    """Follow one shorter walk by rendered frames, the goal localiser and `PoseFilter`, under one rule."""
    seed, rule, seconds = job
    walk = draw_walk(seed, seconds, RENDERED_FRAME_S)
    rng = np.random.default_rng([*seed, 2])
    locate = GoalPoseEstimator(FIELD, CAMERA)
    believed = PoseFilter(odometry=ODOMETRY)
    believed.predict(Pose2(0, 0, 0), 0.0)
    start = np.array([0.15, 0.15, 0.1])
    first = Pose2(*(walk.poses[0].array + start * rng.standard_normal(3)))
    believed.update(PoseEstimate(first, np.diag(start**2), 1.0, 0.0), 0.0)
    gaze = PoseGaze(
        FIELD,
        CAMERA,
        NECK,
        detectors=GOAL_DETECTORS,
        settings=PoseGazeSettings(frame_s=RENDERED_FRAME_S, horizon_s=5 * RENDERED_FRAME_S),
    )
    pan, errors, spreads, empty = 0.0, [], [], 0
    for k in range(1, len(walk.poses)):
        t_s = k * RENDERED_FRAME_S
        believed.predict(walk.odometry[k], t_s)
        head = walk.poses[k].compose(Pose2(0.0, 0.0, pan + float(rng.normal(0, NECK.std_rad))))
        others = tuple(Robot(float(x), float(y), OTHER_RADIUS_M, OTHER_HEIGHT_M) for x, y in walk.others[k])
        scene = Scene(FIELD, (), others, None, MATCH_LIGHT, MATCH_ROOM, 0.5)
        frame = MATCH_SENSOR.expose(render_pinhole(CAMERA, scene, head, supersample=2), rng)
        prior, mount = believed.prior(t_s), Pose2(0.0, 0.0, pan)
        seen = locate.locate(frame, None if prior is None else prior.compose(mount))
        if seen:
            back = mount.inverse()
            turned = seen.covariance + np.diag([0.0, 0.0, NECK.std_rad**2])
            seen = replace(
                seen,
                pose=seen.pose.compose(back),
                covariance=turned,
                candidates=tuple(c.compose(back) for c in seen.candidates),
            )
            believed.update(seen, t_s)
        empty += not seen
        belief = believed.belief
        blockers = blockers_of(walk, k, rng)
        wanted = 0.0
        if rule == "planned":
            gaze.observe(bool(seen), pan)
            wanted = gaze.choose(
                belief, t_s, pan, blockers, drift_of(walk.odometry[k], RENDERED_FRAME_S) / RENDERED_FRAME_S
            ).pan_rad
        elif rule == "fixed sweep":
            wanted = NECK.sweep(t_s)
        pan = NECK.turned(pan, wanted, RENDERED_FRAME_S)
        errors.append(belief.pose.error_to(walk.poses[k])[0] if belief else math.nan)
        spreads.append(float(np.linalg.det(belief.covariance)) ** (1 / 6) if belief else math.nan)
    return _scored(errors, spreads, empty)


@dataclass(frozen=True)
class Sighting:
    """One frame under a prior: what was in view, and pixel errors of what was located by posts and by lines."""

    posts: int
    crossings: int
    by_posts_px: FloatArray | None
    by_lines_px: FloatArray | None


def sighting(seed: list[int]) -> Sighting:
    """Look at one rendered frame with both localisers, from a prior that errs by 0.1 m and 0.05 rad."""
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform((-2.4, -1.6, -math.pi), (2.4, 1.6, math.pi)))
    scene = Scene(FIELD, (), (), None, MATCH_LIGHT, MATCH_ROOM, 0.5)
    frame = MATCH_SENSOR.expose(render_pinhole(CAMERA, scene, pose, supersample=2), rng)
    std = np.array([0.1, 0.1, 0.05])
    prior = PoseEstimate(Pose2(*(pose.array + rng.normal(0, std))), np.diag(std**2), 1.0, 0.0)
    true = project(pose, CAMERA.tilt_rad or 0.0, 0.0, CAMERA.height_m)
    with np.errstate(invalid="ignore"):
        seen = ((true >= 0) & (true <= np.array(CAMERA.size_px) - 1)).all(axis=1)
    away = np.hypot(PLACES[:, 0] - pose.x_m, PLACES[:, 1] - pose.y_m)
    feet = seen & (PLACES[:, 2] == 0) & np.array([m.kind == "post" for m in MARKS])
    crossings = seen & (away < MARK_FARTHEST_M) & np.array([m.kind == "crossing" for m in MARKS])
    by_posts = by_lines = None
    sight = GoalPoseEstimator(FIELD, CAMERA).locate_camera(frame, prior.pose)
    if not isinstance(sight, NotLocated):
        found = sight.estimate(prior.pose).pose
        if found.error_to(pose)[0] < LOST_M:
            p = sight.unknowns
            by_posts = (project(found, p[TILT], p[ROLL], p[HEIGHT]) - true)[feet]
    found_by_lines = Vision(FIELD, CAMERA, method="field").look(frame, prior=prior).pose
    if found_by_lines and found_by_lines.pose.error_to(pose)[0] < LOST_M:
        by_lines = (project(found_by_lines.pose, CAMERA.tilt_rad or 0.0, 0.0, CAMERA.height_m) - true)[crossings]
    return Sighting(int(feet.sum()), int(crossings.sum()), by_posts, by_lines)


def detectors(arguments: Namespace, pool: Pool) -> None:
    """Print what the real detectors see, beside what the planner takes them to see."""
    count = 12 if arguments.quick else 160
    seen = list(pool.map(sighting, [[arguments.seed, 7, i] for i in range(count)], chunksize=8))
    table = Table(
        "in view             | frames | found %: rate | assumed | px: error | assumed",
        "detectors on rendered frames, with a prior",
        name="detectors",
    )
    post, crossing = DETECTORS["post"], DETECTORS["crossing"]
    whole, alone, crossed = post.detection_probability, post.alone_probability, crossing.detection_probability
    for name, of, key, found_ratio, std in (
        ("both posts of a goal", [s for s in seen if s.posts == 2], "by_posts_px", whole, post.std_px),
        ("one post", [s for s in seen if s.posts == 1], "by_posts_px", alone, post.std_px),
        ("crossings, by lines", [s for s in seen if s.crossings], "by_lines_px", crossed, crossing.std_px),
    ):
        errors = [e for s in of if (e := getattr(s, key)) is not None]
        px = 1.48 * float(np.median(np.abs(np.vstack(errors)))) if errors else None
        table.row(name, len(of), percent(len(errors) / len(of)), percent(found_ratio), px, std, samples=len(of))


def compare(table: Table, scores: dict[str, list[RunScore]], *, judged: bool) -> None:
    """Print each rule beside the fixed sweep."""
    middle = {
        rule: [float(np.median([getattr(s, key) for s in runs])) for key in ("rms_m", "spread")]
        for rule, runs in scores.items()
    }
    lost, empty = (
        {rule: float(np.mean([getattr(s, k) for s in runs])) for rule, runs in scores.items()}
        for k in ("lost", "empty")
    )
    for rule in scores:
        ratios = [got / base for got, base in zip(middle[rule], middle["fixed sweep"], strict=True)]
        text = ""
        if judged and rule == "planned":
            ok = ratios[0] <= MAX_RMS and ratios[1] <= MAX_SPREAD and lost[rule] <= lost["fixed sweep"]
            text = verdict(ok)
        table.row(
            rule,
            len(scores[rule]),
            middle[rule][0],
            ratios[0],
            middle[rule][1],
            ratios[1],
            percent(lost[rule]),
            percent(empty[rule]),
            text,
        )


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    detectors(arguments, pool)
    columns = (
        "rule           | runs | RMS m: error | ratio | |P|^1/6: error | ratio | lost %: loss | "
        "nothing seen %: loss | verdict"
    )
    runs = 1 if arguments.quick else 400 if arguments.full else 120
    table = Table(
        columns,
        f"pose by landmarks as measured above (targets: ratios {MAX_RMS} and {MAX_SPREAD}, lost no more)",
        name="landmarks",
        samples=runs,
    )
    scores = {
        r: list(pool.map(landmark_run, [([arguments.seed, i], r) for i in range(runs)], chunksize=4)) for r in RULES
    }
    compare(table, scores, judged=True)
    runs = 1 if arguments.quick else 120 if arguments.full else 40
    seconds = QUICK_RENDERED_S if arguments.quick else RENDERED_S
    table = Table(
        columns,
        "pose by rendered frames, the goal localiser and PoseFilter (the same targets)",
        name="rendered",
        samples=runs,
    )
    rules = ("planned", "fixed sweep")
    rendered = {
        r: list(pool.map(rendered_run, [([arguments.seed, i], r, seconds) for i in range(runs)])) for r in rules
    }
    # a few runs show nothing
    compare(table, rendered, judged=not arguments.quick)
