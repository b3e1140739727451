"""What pose_filter.py compares with: the last single estimate carried by odometry, and filterpy's Kalman filter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robocup_vision import NotLocated, PoseEstimate
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2, half_turn_covariance, wrap_angle
from robocup_vision.localization.filter.pose_filter import OdometryNoise, PoseFilter

try:
    from filterpy.kalman import ExtendedKalmanFilter
except ImportError:
    ExtendedKalmanFilter = None

HAS_FILTERPY = ExtendedKalmanFilter is not None


class Single:
    """The last single estimate, carried on by odometry."""

    def __init__(self) -> None:
        self._clock = PoseFilter()
        self._pose: Pose2 | None = None
        self._covariance = np.zeros((3, 3))

    def expect(self, pose: Pose2) -> None:
        """Begin there."""
        self._pose = pose

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Carry it."""
        self._clock.predict(odometry, t_s)
        if self._pose is not None:
            self._pose = self._pose.compose(odometry)

    def update(self, estimate: PoseEstimate, t_s: float) -> None:
        """Forget what was before."""
        motion = self._clock.motion_since(t_s)
        if motion is None:
            return
        self._pose, self._covariance = nearest(estimate, motion, self._pose)

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """The pose, with the covariance the frame gave."""
        if self._pose is None:
            return NotLocated("no frame yet")
        return PoseEstimate(self._pose, self._covariance, 0.0, 0.0)


class Ekf:
    """filterpy's extended Kalman filter over the pose, odometry as its control."""

    def __init__(self) -> None:
        self._clock, self._noise = PoseFilter(), OdometryNoise()
        self._filter: Any = None
        self._t_s = 0.0
        self._expected: Pose2 | None = None

    def expect(self, pose: Pose2) -> None:
        """Take the first frame's candidate nearest to it."""
        self._expected = pose

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Carry it."""
        self._clock.predict(odometry, t_s)
        if self._filter is not None:
            ekf = self._filter
            theta = float(ekf.x[2])
            c, s = math.cos(theta), math.sin(theta)
            jacobian = np.eye(3)
            jacobian[:2, 2] = (-s * odometry.x_m - c * odometry.y_m, c * odometry.x_m - s * odometry.y_m)
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            moved = Pose2(*ekf.x).compose(odometry)
            ekf.F = jacobian
            ekf.Q = turn @ white_noise(self._noise, odometry, t_s - self._t_s) @ turn.T
            ekf.predict_x = lambda u=0: setattr(ekf, "x", moved.array)
            ekf.predict()
        self._t_s = t_s

    def update(self, estimate: PoseEstimate, t_s: float) -> None:
        """Correct it."""
        motion = self._clock.motion_since(t_s)
        if motion is None:
            return
        if self._filter is None:
            pose, covariance = nearest(estimate, motion, self._expected)
            self._filter = ExtendedKalmanFilter(3, 3)
            self._filter.x, self._filter.P = pose.array, covariance
            return
        pose, covariance = nearest(estimate, motion, Pose2(*self._filter.x))
        self._filter.update(pose.array, lambda x: np.eye(3), lambda x: x, R=covariance, residual=pose_difference)

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """Its state."""
        if self._filter is None:
            return NotLocated("no frame yet")
        return PoseEstimate(Pose2(*self._filter.x), self._filter.P, 0.0, 0.0)


Follower = Single | Ekf | PoseFilter


def white_noise(noise: OdometryNoise, motion: Pose2, seconds: float) -> FloatArray:
    """Covariance (3, 3) of a step's odometry, with errors as independent as add up to what lasting slip does."""
    slip = noise.slip(motion)
    return 2 * noise.slip_s / max(seconds, 0.01) * slip @ slip + noise.push(seconds)


def pose_difference(a: FloatArray, b: FloatArray) -> FloatArray:
    """Difference (3,) of two poses as arrays, its angle wrapped."""
    return np.array([a[0] - b[0], a[1] - b[1], wrap_angle(a[2] - b[2])])


def nearest(estimate: PoseEstimate, motion: Pose2, near: Pose2 | None) -> tuple[Pose2, FloatArray]:
    """Return the candidate nearest to a pose, carried by a motion, and its covariance."""
    poses = [pose.compose(motion) for pose in estimate.candidates]
    index = 0 if near is None else min(range(len(poses)), key=lambda k: sum(poses[k].error_to(near)))
    is_turned = sum(estimate.candidates[index].error_to(estimate.pose.half_turn())) < 1e-6
    return poses[index], half_turn_covariance(estimate.covariance) if is_turned else estimate.covariance
