"""The robot's state from matched landmarks: Mahalanobis least squares (Ogawa et al. 2011, eqs. 7 to 11 and 14 to 19).

Gauss-Newton with redescending weights in place of the paper's exhaustive search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.landmarks.projection import point_by_pose, to_camera, world_to_camera

# 99 % of right matches are within these (the paper's gate of 1 keeps a fifth of them)
CHI2_2DOF = 9.21
CHI2_3DOF = 11.34
# widths of the weights, in standard deviations, from the first iteration to the last
WEIGHT_WIDTHS = (30.0, 15.0, 8.0, 5.0, 3.5, 3.5, 3.5, 3.5)


@dataclass(frozen=True, slots=True, eq=False)
class PoseFit:
    """A fitted state.

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta of the robot in the field frame.
    covariance : (3, 3) float64
        (J^T W J)^-1 over the inliers: the paper's eq. 12 is not one.
    inliers : (N,) bool
        Matches within the 99 % bound.
    squared : (N,) float64
        Squared Mahalanobis distances.
    """

    pose: FloatArray
    covariance: FloatArray
    inliers: npt.NDArray[np.bool_]
    squared: FloatArray


def fit_stereo(
    camera: PinholeCamera,
    start: FloatArray,
    landmarks_m: FloatArray,
    landmark_cov: FloatArray,
    points_m: FloatArray,
    point_cov: FloatArray,
) -> PoseFit:
    """Fit the state to landmarks (N, 3) of the map seen as points (N, 3) of the camera frame. Eqs. 7 to 11."""

    def linearise(pose: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Squared distances (N,), residuals (N, 3), derivatives by the pose (N, 3, 3), weights (N, 3, 3)."""
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
