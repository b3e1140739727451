"""Projects landmarks into a robot's camera, and fits the robot's pose to matched ones.

Mahalanobis least squares of Ogawa et al. (2011), eqs. 7 to 11 and 14 to 19, by Gauss-Newton with redescending weights
instead of the paper's exhaustive search. The paper's state (X, Z, theta) on the floor corresponds to a `Pose2`: its Z
(ahead) is the robot's x, its X (right) is -y, its Y (down) is -z, and theta increases counter-clockwise. Landmarks are
in the field frame, metres, z up from the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera, project_ideal

# gates: 99 % of chi-square with 2 and 3 degrees of freedom (the paper's gate of 1 keeps a fifth of the right matches)
CHI2_2DOF = 9.21
CHI2_3DOF = 11.34
# widths of the weights, in standard deviations, from the first iteration to the last
WEIGHT_WIDTHS = (30.0, 15.0, 8.0, 5.0, 3.5, 3.5, 3.5, 3.5)


def world_to_camera(camera: PinholeCamera, theta_rad: FloatArray) -> FloatArray:
    """Return rotations (..., 3, 3) from the field frame into the camera frame at the robot's headings (...)."""
    theta = np.asarray(theta_rad, dtype=np.float64)
    c, s, zero, one = np.cos(theta), np.sin(theta), np.zeros_like(theta), np.ones_like(theta)
    turn = np.stack([np.stack([c, s, zero], -1), np.stack([-s, c, zero], -1), np.stack([zero, zero, one], -1)], -2)
    return np.asarray(camera.camera_to_robot.T @ turn)


def to_camera(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Transform points (N, 3) from the field frame into the camera frame of a robot at a pose (3,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points_m[:, 0] - pose[0], points_m[:, 1] - pose[1]
    robot = np.stack([c * dx + s * dy, c * dy - s * dx, points_m[:, 2]], axis=-1)
    return np.asarray((robot - camera.viewpoint_m) @ camera.camera_to_robot)


def to_world(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Transform points (N, 3) from the camera frame into the field frame; the inverse of `to_camera`."""
    robot = points_m @ camera.camera_to_robot.T + camera.viewpoint_m
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = robot[:, 0], robot[:, 1]
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y, robot[:, 2]], axis=-1)


def project(camera: PinholeCamera, points_m: FloatArray) -> FloatArray:
    """Ideal pixels (N, 2) of points (N, 3) in the camera frame; NaN behind the camera. Eq. 15."""
    return project_ideal(camera.focal_px, camera.center_px, points_m)


def point_by_pose(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return derivatives (N, 3, 3) of points in the camera frame by the pose, for points (N, 3) of the field frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points_m[:, 0] - pose[0], points_m[:, 1] - pose[1]
    robot = np.zeros((len(points_m), 3, 3))
    robot[:, 0, 0], robot[:, 0, 1], robot[:, 0, 2] = -c, -s, c * dy - s * dx
    robot[:, 1, 0], robot[:, 1, 1], robot[:, 1, 2] = s, -c, -c * dx - s * dy
    return np.asarray(camera.camera_to_robot.T @ robot)


@dataclass(frozen=True, slots=True, eq=False)
class PoseFit:
    """A fitted pose."""

    pose: FloatArray  #: (3,) float64: x, y, theta of the robot in the field frame
    covariance: FloatArray  #: (3, 3) float64: (J^T W J)^-1 over the inliers (the paper's eq. 12 is no covariance)
    inliers: npt.NDArray[np.bool_]  #: (N,) bool: matches within the 99 % bound
    squared: FloatArray  #: (N,) float64: squared Mahalanobis distances


def fit_stereo(
    camera: PinholeCamera,
    start: FloatArray,
    landmarks_m: FloatArray,
    landmark_cov: FloatArray,
    points_m: FloatArray,
    point_cov: FloatArray,
) -> PoseFit:
    """Fit the pose to landmarks (N, 3) of the map matched with points (N, 3) of the camera frame (eqs. 7 to 11).

    `landmark_cov` and `point_cov` are their covariances (N, 3, 3) in the field frame and in the camera frame.
    """

    def linearise(pose: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return squared distances (N,), residuals (N, 3), derivatives by the pose and weights (N, 3, 3)."""
        turn = world_to_camera(camera, pose[2])
        residual = points_m - to_camera(camera, pose, landmarks_m)
        weight = np.linalg.inv(turn @ landmark_cov @ turn.T + point_cov).astype(np.float64)
        squared = np.einsum("ni,nij,nj->n", residual, weight, residual)
        return squared, residual, -point_by_pose(camera, pose, landmarks_m), weight

    pose = np.array(start, dtype=np.float64)
    for width in WEIGHT_WIDTHS:
        squared, residual, jacobian, weight = linearise(pose)
        counts = 1.0 / (1.0 + squared / width**2) ** 2
        weighted = jacobian.transpose(0, 2, 1) @ (weight * counts[:, None, None])
        normal = (weighted @ jacobian).sum(axis=0)
        gradient = (weighted @ residual[:, :, None]).sum(axis=0)[:, 0]
        step = -np.linalg.solve(normal + 1e-9 * np.eye(3), gradient)
        pose = pose + step
        if width == WEIGHT_WIDTHS[-1] and np.abs(step).max() < 1e-7:
            break
    squared, _, jacobian, weight = linearise(pose)
    inliers = squared <= CHI2_3DOF
    normal = (jacobian.transpose(0, 2, 1) @ weight @ jacobian)[inliers].sum(axis=0)
    return PoseFit(pose, np.linalg.inv(normal + 1e-9 * np.eye(3)), inliers, squared)
