"""Represents an uncertain pose by a few poses: the mean over them is the expected value."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2


def sigma_points(pose: Pose2, covariance: npt.ArrayLike) -> FloatArray:
    """Return (6, 3): x_m, y_m, theta_rad of equally likely poses with the mean and the covariance of an uncertain one.

    Parameters
    ----------
    pose : Pose2
        The mean.
    covariance : (3, 3) float64
        Of (x_m, y_m, theta_rad); what rounding has made negative of it counts as 0.

    Raises
    ------
    ArgumentError
        Something is not finite, or the covariance not (3, 3).
    """
    spread = np.asarray(covariance, dtype=np.float64)
    if spread.shape != (3, 3) or not np.isfinite(spread).all() or not np.isfinite(pose.array).all():
        raise ArgumentError(f"a pose and its (3, 3) covariance must be finite, got {pose} and {spread.tolist()}")
    variance, axes = np.linalg.eigh((spread + spread.T) / 2)
    arms = (axes * np.sqrt(np.maximum(variance, 0.0))).T * math.sqrt(3.0)
    return np.asarray(pose.array + np.vstack([arms, -arms]))
