"""Sigma points have the mean and covariance they stand for."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import covariances, poses

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.planning.gaze.uncertainty import sigma_points


@given(poses(), covariances())
def test_mean_and_covariance(pose: Pose2, covariance: np.ndarray) -> None:
    points = sigma_points(pose, covariance)
    assert points.mean(axis=0) == pytest.approx(pose.array)
    off = points - pose.array
    assert off.T @ off / len(points) == pytest.approx(covariance, abs=1e-9)


def test_certain_pose_has_no_spread() -> None:
    assert sigma_points(Pose2(1.0, 2.0, 0.5), np.zeros((3, 3))) == pytest.approx(np.tile([1.0, 2.0, 0.5], (6, 1)))


@pytest.mark.parametrize("covariance", [np.eye(2), np.full((3, 3), math.nan)])
def test_refuses(covariance: np.ndarray) -> None:
    with pytest.raises(ArgumentError, match="covariance must be finite"):
        sigma_points(Pose2(0.0, 0.0, 0.0), covariance)
