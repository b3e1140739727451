"""Expectations over uncertain poses: sigma points of a pose, and the probability that a robot hides a point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.normal import normal_below


def sigma_points(pose: Pose2, covariance: npt.ArrayLike) -> FloatArray:
    """Return (6, 3) equally likely poses x_m, y_m, theta_rad with the mean and the covariance of an uncertain one.

    Parameters
    ----------
    covariance : (3, 3) float64
        Covariance of (x_m, y_m, theta_rad); eigenvalues that are negative due to rounding count as 0.

    Raises
    ------
    ArgumentError
        If a value is not finite, or the covariance is not (3, 3).
    """
    spread = np.asarray(covariance, dtype=np.float64)
    if spread.shape != (3, 3) or not np.isfinite(spread).all() or not np.isfinite(pose.array).all():
        raise ArgumentError(f"a pose and its (3, 3) covariance must be finite, got {pose} and {spread.tolist()}")
    variance, axes = np.linalg.eigh((spread + spread.T) / 2)
    arms = (axes * np.sqrt(np.maximum(variance, 0.0))).T * math.sqrt(3.0)
    return np.asarray(pose.array + np.vstack([arms, -arms]))


def clear_probability(eye_m: npt.ArrayLike, points_m: npt.ArrayLike, blockers: Sequence[Disc]) -> FloatArray:
    """Return the probability (N,) that nothing hides a point from the camera.

    Parameters
    ----------
    eye_m : (3,) float64
        Place of the camera, field frame, metres.
    points_m : (N, 3) float64
        The points, field frame, metres.
    blockers : sequence of Disc
        Robots that may be in between; their errors are independent.
    """
    eye, points = np.asarray(eye_m, dtype=np.float64), np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
    clear = np.ones(len(points))
    way = points[:, :2] - eye[:2]
    away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    along, across = way / away[:, None], np.column_stack([-way[:, 1], way[:, 0]]) / away[:, None]
    for blocker in blockers:
        offset = np.array([blocker.x_m, blocker.y_m]) - eye[:2]
        at, aside = along @ offset, across @ offset
        sight_height = eye[2] + (points[:, 2] - eye[2]) * np.clip(at / away, 0.0, 1.0)
        between = (at > 0) & (at < away) & (sight_height < blocker.height_m)
        std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", across, blocker.covariance, across), 1e-12))
        hidden = normal_below((blocker.radius_m - aside) / std) - normal_below((-blocker.radius_m - aside) / std)
        clear *= np.where(between, 1.0 - hidden, 1.0)
    return clear
