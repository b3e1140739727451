"""The ball as a walking robot with a forward camera sees it: found, how far off, and whether its covariance is honest.

Sequences are those of forward_sequences ("FL": four_legged_2007, 208 x 160, a body that nods by 1.2 degrees RMS), eight
of them with seeds from --seed on (--quick: one), 150 frames each. `Vision` gets frames, time, odometry and the neck's
pan, and a rough pose once; balls count where the frame was located. "in view": the ball's centre lies in the picture,
though a robot may hide it. "others": finds farther than a ball from its place in the picture. NEES: squared error over
the covariance that is stated, 2 on average where it is honest; more is worse than less. Times are those of whole looks,
as ratios to cv2.cvtColor(BGR2HSV) of the same frame.
"""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass, field

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.timing import timed_look, unit_s
from benchmarks.worlds.walks import FL, WalkFrame, walk
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2

FIELD = load_field(FL.field_name)
START_STD = np.array([0.10, 0.10, math.radians(5.0)])
FRAMES = 150
MAX_ERROR_RATIO, MAX_NEES = 0.03, 4.0


def shown_px(one: WalkFrame, camera: PinholeCamera) -> tuple[float, float, float] | None:
    """Return where the ball's centre is in a picture, or beyond its edge, and its radius there, pixels."""
    if one.ball is None:
        return None
    x, y = one.camera_pose.inverse().transform((one.ball.x_m, one.ball.y_m)).tolist()
    as_held = camera.with_orientation(0.0, one.tilt_rad, one.roll_rad)
    ray = np.array([x, y, one.ball.radius_m - one.height_m])
    away = float(np.linalg.norm(ray))
    u, v = as_held.ray_to_pixel(ray / away).tolist()
    return (u, v, camera.focal_px[0] * one.ball.radius_m / away) if x > 0 else None


@dataclass
class Followed:
    """What walks gave: range (m), error (m) and NEES of each ball found, counts, times by whether a ball was found."""

    found: list[tuple[float, float, float]] = field(default_factory=list)
    in_view: int = 0
    others: int = 0
    located: int = 0
    time_s: dict[bool, list[float]] = field(default_factory=lambda: {False: [], True: []})
    unit_s: list[float] = field(default_factory=list)


def follow(seed: int, into: Followed) -> None:
    """Follow a walk."""
    frames = walk(FL, seed, FRAMES)
    vision = Vision(FIELD, FL.camera)
    rng = np.random.default_rng([seed, 0xBA11])
    covariance: FloatArray = np.diag(START_STD**2)
    noise = START_STD * rng.standard_normal(3)
    start = Pose2(*(frames[0].robot.array + noise).tolist())
    for index, one in enumerate(frames):
        prior = None if index else PoseEstimate(start, covariance, 1.0, 0.0)
        odometry = one.odometry if index else None
        view, took_s = timed_look(vision, one.frame, t_s=one.t_s, odometry=odometry, prior=prior, pan_rad=one.pan_rad)
        if index:
            # the first learns the colours
            into.time_s[bool(view.balls)].append(took_s)
            into.unit_s.append(unit_s(one.frame))
        if not view.pose:
            continue
        into.located += 1
        shown = shown_px(one, FL.camera)
        is_shown = shown is not None and 0 <= shown[0] < FL.camera.size_px[0] and 0 <= shown[1] < FL.camera.size_px[1]
        into.in_view += is_shown
        is_found = False
        for ball in view.balls:
            if is_found or shown is None or math.dist((ball.u_px, ball.v_px), shown[:2]) > 2 * shown[2] + 2.0:
                into.others += 1
                continue
            is_found = True
            if one.ball is None or not is_shown:
                continue  # cut by the picture's edge
            there = one.robot.inverse().transform((one.ball.x_m, one.ball.y_m))
            error = np.array([ball.x_m, ball.y_m]) - there
            nees = float(error @ np.linalg.solve(ball.covariance, error))
            into.found.append((float(np.hypot(*there)), float(np.hypot(*error)), nees))


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    seeds = range(arguments.seed, arguments.seed + (1 if arguments.quick else 8))
    followed = Followed()
    for seed in seeds:
        follow(seed, followed)
    found = np.array(followed.found).reshape(-1, 3)
    ratio = found[:, 1] / found[:, 0]
    columns = (
        "walking, FL | located: rate | found in view: rate | others: count | "
        "median error, of the range: error 0.005 | 95 %: error 0.02 | NEES mean: error 1 | target | verdict: verdict"
    )
    table = Table(columns, name="walking balls")
    median, far, nees = float(np.median(ratio)), float(np.percentile(ratio, 95)), float(found[:, 2].mean())
    is_met = median <= MAX_ERROR_RATIO and nees <= MAX_NEES
    table.row(
        f"{len(seeds)} x {FRAMES} frames",
        f"{followed.located}/{len(seeds) * FRAMES}",
        f"{len(found)}/{followed.in_view}",
        str(followed.others),
        f"{median:.3f}",
        f"{far:.3f}",
        f"{nees:.2f}",
        f"<= {MAX_ERROR_RATIO}, {MAX_NEES:g}",
        verdict(is_met),
    )
    table = Table("whole looks      | frames | x cvtColor: time ratio | p99: time ratio", name="time")
    for is_found, name in ((False, "no ball found"), (True, "a ball found")):
        times = np.array(followed.time_s[is_found]) / np.median(followed.unit_s)
        table.row(name, len(times), float(np.median(times)), float(np.quantile(times, 0.99)))
