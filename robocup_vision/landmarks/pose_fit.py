"""The robot's state from matched landmarks: Mahalanobis least squares (Ogawa et al. 2011, eqs. 7 to 11 and 14 to 19).

Gauss-Newton with redescending weights; the paper's exhaustive search is kept as a reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.landmarks.projection import pixel_by_point, point_by_pose, project, to_camera, world_to_camera

# 99 % of right matches are within these (the paper's gate of 1 keeps a fifth of them)
CHI2_2DOF = 9.21
CHI2_3DOF = 11.34
# widths of the weights, in standard deviations, from the first iteration to the last
_WIDTHS = (30.0, 15.0, 8.0, 5.0, 3.5, 3.5, 3.5, 3.5)
# the paper's search: steps and half-widths in x, y (m) and theta (rad)
SEARCH_STEP = (0.01, 0.01, math.radians(1.0))
SEARCH_HALF_STEPS = 10

# squared distances (N,), residuals (N, D), derivatives by the pose (N, D, 3) and weights (N, D, D) at a pose
Linearised = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


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
    *,
    exhaustive: bool = False,
) -> PoseFit:
    """Fit the state to landmarks (N, 3) of the map seen as points (N, 3) of the camera frame. Eqs. 7 to 11."""

    def linearise(pose: FloatArray) -> Linearised:
        turn = world_to_camera(camera, pose[2])
        residual = points_m - to_camera(camera, pose, landmarks_m)
        weight = _inverse(turn @ landmark_cov @ turn.T + point_cov)
        squared = np.einsum("ni,nij,nj->n", residual, weight, residual)
        return squared, residual, -point_by_pose(camera, pose, landmarks_m), weight

    return (_search if exhaustive else _descend)(linearise, start, CHI2_3DOF)


def fit_pixels(
    camera: PinholeCamera,
    start: FloatArray,
    landmarks_m: FloatArray,
    landmark_cov: FloatArray,
    pixels: FloatArray,
    std_px: FloatArray,
    *,
    exhaustive: bool = False,
) -> PoseFit:
    """Fit the state to landmarks (N, 3) seen at ideal pixels (N, 2). Eqs. 14 to 19, with the pixels' own noise."""

    def linearise(pose: FloatArray) -> Linearised:
        points = to_camera(camera, pose, landmarks_m)
        points[:, 0] = np.maximum(points[:, 0], 0.05)  # behind the camera: far off, but finite
        by_point = pixel_by_point(camera, points)
        by_world = by_point @ world_to_camera(camera, pose[2])
        covariance = by_world @ landmark_cov @ by_world.transpose(0, 2, 1)
        covariance += (std_px**2)[:, None, None] * np.eye(2)
        weight = _inverse(covariance)
        residual = pixels - project(camera, points)
        squared = np.einsum("ni,nij,nj->n", residual, weight, residual)
        return squared, residual, -by_point @ point_by_pose(camera, pose, landmarks_m), weight

    return (_search if exhaustive else _descend)(linearise, start, CHI2_2DOF)


def _inverse(matrices: FloatArray) -> FloatArray:
    return np.linalg.inv(matrices).astype(np.float64)


def _descend(linearise: Callable[[FloatArray], Linearised], start: FloatArray, bound: float) -> PoseFit:
    pose = np.array(start, dtype=np.float64)
    for width in _WIDTHS:
        squared, residual, jacobian, weight = linearise(pose)
        share = 1.0 / (1.0 + squared / width**2) ** 2
        weighted = jacobian.transpose(0, 2, 1) @ (weight * share[:, None, None])
        normal = (weighted @ jacobian).sum(axis=0)
        gradient = (weighted @ residual[:, :, None]).sum(axis=0)[:, 0]
        step = -np.linalg.solve(normal + 1e-9 * np.eye(3), gradient)
        pose = pose + step
        if width == _WIDTHS[-1] and np.abs(step).max() < 1e-7:
            break
    return _finish(linearise, pose, bound)


def _finish(linearise: Callable[[FloatArray], Linearised], pose: FloatArray, bound: float) -> PoseFit:
    squared, _, jacobian, weight = linearise(pose)
    inliers = squared <= bound
    normal = (jacobian.transpose(0, 2, 1) @ weight @ jacobian)[inliers].sum(axis=0)
    covariance = np.linalg.inv(normal + 1e-9 * np.eye(3))
    return PoseFit(pose, covariance, inliers, squared)


def _search(linearise: Callable[[FloatArray], Linearised], start: FloatArray, bound: float) -> PoseFit:
    """Try every state of the paper's grid around the start; keep the one with the least sum, outliers capped."""
    steps = np.arange(-SEARCH_HALF_STEPS, SEARCH_HALF_STEPS + 1)
    best, least = np.array(start, dtype=np.float64), math.inf
    for offset in np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3):
        pose = start + offset * SEARCH_STEP
        total = float(np.minimum(linearise(pose)[0], bound).sum())
        if total < least:
            best, least = pose, total
    fit = _finish(linearise, best, bound)
    # uniform within a step of the grid
    quantisation = np.diag(np.square(SEARCH_STEP)) / 12
    return PoseFit(fit.pose, fit.covariance + quantisation, fit.inliers, fit.squared)
