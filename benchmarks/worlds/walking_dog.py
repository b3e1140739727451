"""A four-legged robot that walks among five others and pans its head: the scene of gaze_pose.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from field_models import load_field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2, compose_covariance, wrap_angle
from robocup_vision.localization.filter.pose_filter import OdometryNoise
from robocup_vision.planning.gaze.field_landmarks import field_landmarks
from robocup_vision.planning.gaze.pose_gaze import DETECTORS, Neck
from robocup_vision.planning.gaze.uncertainty import clear_probability
from sim2d.match.setups import camera_for

FIELD = load_field("four_legged_2007")
HEAD_CAMERA = camera_for(FIELD)
assert isinstance(HEAD_CAMERA, PinholeCamera)
CAMERA = replace(HEAD_CAMERA, pan_rad=0.0)
NECK = Neck(limit_rad=1.4, speed_rps=8.0, std_rad=0.01)
FRAME_S, RUN_S = 1 / 15, 20.0
WALK_MPS, TURN_RPS = 0.3, 1.5
OTHERS, OTHER_RADIUS_M, OTHER_HEIGHT_M = 5, 0.15, 0.28
TRACKED_RATIO, TRACK_STD_M = 0.8, 0.08
ODOMETRY_RATIO, PUSH = 0.2, np.array([0.02, 0.02, 0.05])
# what the filter of frames reckons with: a slip that lasts for a run
ODOMETRY = OdometryNoise(slip_ratio=ODOMETRY_RATIO / 2, slip_s=RUN_S, push_m=PUSH[0], push_rad=PUSH[2])


@dataclass(frozen=True)
class Walk:
    """A dog's way: true poses and odometry by frames, and where the others are."""

    poses: list[Pose2]
    odometry: list[Pose2]
    others: FloatArray
    tracked: npt.NDArray[np.bool_]
    seed: list[int]


def draw_walk(seed: Sequence[int], seconds: float, frame_s: float) -> Walk:
    """Walk from waypoint to waypoint; the others stroll."""
    rng = np.random.default_rng(list(seed))
    half = np.array([FIELD.length_m / 2 - 0.3, FIELD.width_m / 2 - 0.2])
    x, y = rng.uniform(-half, half).tolist()
    pose = Pose2(x, y, float(rng.uniform(-math.pi, math.pi)))
    target = rng.uniform(-half, half)
    others = rng.uniform(-half, half, (OTHERS, 2))
    aims = rng.uniform(-half, half, (OTHERS, 2))
    tracked = rng.random(OTHERS) < TRACKED_RATIO
    poses, odometry, places = [pose], [Pose2(0, 0, 0)], [others.copy()]
    slip = rng.normal(0, ODOMETRY_RATIO / 2, 3)
    for _ in range(round(seconds / frame_s)):
        bearing = wrap_angle(math.atan2(target[1] - pose.y_m, target[0] - pose.x_m) - pose.theta_rad)
        turn = max(-TURN_RPS, min(TURN_RPS, 4 * bearing)) * frame_s
        ahead = WALK_MPS * frame_s * max(0.0, math.cos(bearing))
        reported = Pose2(ahead, 0.0, turn)
        pushed = rng.normal(0, 1, 3) * PUSH * math.sqrt(frame_s)
        pose = pose.compose(
            Pose2(ahead * (1 + slip[0]) + pushed[0], ahead * slip[1] + pushed[1], turn * (1 + slip[2]) + pushed[2])
        )
        if math.hypot(target[0] - pose.x_m, target[1] - pose.y_m) < 0.3:
            target = rng.uniform(-half, half)
        for k in range(OTHERS):
            way = aims[k] - others[k]
            others[k] += way / max(np.hypot(*way), 1e-6) * 0.2 * frame_s
            if np.hypot(*way) < 0.2:
                aims[k] = rng.uniform(-half, half)
            off = others[k] - (pose.x_m, pose.y_m)
            if np.hypot(*off) < 0.4:  # they keep their distance
                others[k] = (pose.x_m, pose.y_m) + off / max(np.hypot(*off), 1e-6) * 0.4
        poses.append(pose)
        odometry.append(reported)
        places.append(others.copy())
    return Walk(poses, odometry, np.array(places), tracked, list(seed))


def drift_of(step: Pose2, frame_s: float) -> FloatArray:
    """Covariance (3, 3) of an odometry step in the robot's frame, as `PoseFilter` takes it."""
    way = (ODOMETRY_RATIO * math.hypot(step.x_m, step.y_m)) ** 2
    return np.diag([way, way, (ODOMETRY_RATIO * step.theta_rad) ** 2] + PUSH**2 * frame_s)


class LandmarkFilter:
    """A Kalman filter of bearings and elevations of known landmarks, whose neck error a frame's landmarks share."""

    def __init__(self, pose: Pose2, covariance: FloatArray) -> None:
        self.pose, self.covariance = pose, covariance

    def predict(self, step: Pose2, noise: FloatArray) -> None:
        """Move by odometry."""
        self.covariance = compose_covariance(self.pose, self.covariance, step, noise)
        self.pose = self.pose.compose(step)

    def update(self, marks: FloatArray, measured: FloatArray, std_rad: FloatArray) -> None:
        """Take in bearings and elevations (N, 2), robot frame, of landmarks (N, 3)."""
        way = marks[:, :2] - (self.pose.x_m, self.pose.y_m)
        away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 0.05)
        up = marks[:, 2] - CAMERA.height_m
        n = len(marks)
        rows = np.zeros((2 * n, 3))
        rows[:n, 0], rows[:n, 1], rows[:n, 2] = way[:, 1] / away**2, -way[:, 0] / away**2, -1.0
        rows[n:, :2] = (up / (away**2 + up**2) / away)[:, None] * way
        bearing = measured[:, 0] - (np.arctan2(way[:, 1], way[:, 0]) - self.pose.theta_rad)
        off = np.concatenate(
            [np.remainder(bearing + math.pi, math.tau) - math.pi, measured[:, 1] - np.arctan2(up, away)]
        )
        noise = np.diag(np.tile(std_rad**2, 2))
        noise[:n, :n] += NECK.std_rad**2
        noise[n:, n:] += NECK.std_rad**2
        gain = np.linalg.solve(rows @ self.covariance @ rows.T + noise, rows @ self.covariance).T
        self.pose = Pose2(*(self.pose.array + gain @ off))
        rest = np.eye(3) - gain @ rows
        self.covariance = rest @ self.covariance @ rest.T + gain @ noise @ gain.T


def blockers_of(walk: Walk, k: int, rng: np.random.Generator) -> list[Disc]:
    """Those of the others that are tracked, where the tracker has them."""
    places = walk.others[k] + rng.normal(0, TRACK_STD_M, walk.others[k].shape)
    covariance = np.eye(2) * TRACK_STD_M**2
    return [Disc(x, y, OTHER_RADIUS_M, covariance, height_m=OTHER_HEIGHT_M) for x, y in places[walk.tracked]]


MARKS = field_landmarks(FIELD)
PLACES = np.array([[m.x_m, m.y_m, m.height_m] for m in MARKS])
MARK_STD_RAD = np.array([DETECTORS[m.kind].std_px / CAMERA.focal_px[0] for m in MARKS])
MARK_FOUND = np.array([DETECTORS[m.kind].detection_probability for m in MARKS])
MARK_ALONE = np.array(
    [
        d.detection_probability if (d := DETECTORS[m.kind]).alone_probability is None else d.alone_probability
        for m in MARKS
    ]
)
# of a post's foot and top those of the goal's other post
PARTNER = np.array(
    [
        next((k for k, o in enumerate(MARKS) if m.kind == "post" and o == replace(m, y_m=-m.y_m)), i)
        for i, m in enumerate(MARKS)
    ]
)
MARK_FARTHEST_M = np.array([DETECTORS[m.kind].max_range_m for m in MARKS])


def see_landmarks(
    pose: Pose2, pan_rad: float, others: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Landmarks (N, 3) that a frame shows, their bearings and elevations (N, 2), and standard deviations (N,)."""
    eye = (pose.x_m, pose.y_m, CAMERA.height_m)
    way = PLACES - eye
    rotation = camera_rotation(pose.theta_rad + pan_rad, CAMERA.tilt_rad or 0.0, 0.0)
    pixels = CAMERA.camera_ray_to_pixel(way @ rotation)
    with np.errstate(invalid="ignore"):
        seen = ((pixels >= 0) & (pixels <= np.array(CAMERA.size_px) - 1)).all(axis=1)
    seen &= np.hypot(way[:, 0], way[:, 1]) < MARK_FARTHEST_M
    exact = 1e-8 * np.eye(2)
    hidden = (
        clear_probability(eye, PLACES, [Disc(x, y, OTHER_RADIUS_M, exact, height_m=OTHER_HEIGHT_M) for x, y in others])
        < 0.5
    )
    seen &= ~hidden
    seen &= rng.random(len(MARKS)) < np.where(seen[PARTNER], MARK_FOUND, MARK_ALONE)
    away = np.hypot(way[seen, 0], way[seen, 1])
    true = np.column_stack([np.arctan2(way[seen, 1], way[seen, 0]) - pose.theta_rad, np.arctan2(way[seen, 2], away)])
    std = MARK_STD_RAD[seen]
    noise = rng.standard_normal(true.shape) * std[:, None] + rng.normal(0, NECK.std_rad, 2)
    return PLACES[seen], true + noise, std


def project(pose: Pose2, tilt_rad: float, roll_rad: float, height_m: float) -> FloatArray:
    """Pixels (L, 2) of all landmarks for a camera at a pose."""
    way = PLACES - (pose.x_m, pose.y_m, height_m)
    return CAMERA.camera_ray_to_pixel(way @ camera_rotation(pose.theta_rad, tilt_rad, roll_rad))
