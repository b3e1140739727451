"""An estimate guards its own shape; failure to locate is falsy and says why."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from strategies import covariances, poses

from field_models import ArgumentError
from robocup_vision.estimates import EdgeState, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, half_turn_covariance
from robocup_vision.kernels.model_edges.tables import FOUND, HIDDEN, MISSING, UNSEEN

POSE = Pose2(1.0, 0.5, 0.2)


def test_not_located_is_falsy_and_an_estimate_is_not():
    assert not NotLocated("no floor in view")
    assert NotLocated("no floor in view").reason == "no floor in view"
    assert PoseEstimate(Pose2(0.0, 0.0, 0.0), np.zeros((3, 3)), 0.0, 0.0)


def test_pose_alone_is_its_only_candidate():
    assert PoseEstimate(POSE, np.eye(3), 0.9, 0.4).candidates == (POSE,)


def test_first_candidate_is_the_pose():
    both = (POSE, POSE.half_turn())
    assert PoseEstimate(POSE, np.eye(3), 0.9, 0.4, both).candidates == both
    with pytest.raises(ArgumentError, match="the first of the candidates must be the pose"):
        PoseEstimate(POSE, np.eye(3), 0.9, 0.4, both[::-1])


@pytest.mark.parametrize("shape", [(3,), (2, 2), (1, 3, 3)])
def test_covariance_of_another_shape_is_refused(shape: tuple[int, ...]):
    with pytest.raises(ArgumentError, match=r"covariance must be \(3, 3\), got "):
        PoseEstimate(POSE, np.zeros(shape), 0.9, 0.4)


def test_estimate_cannot_be_changed():
    covariance = np.diag([4.0, 9.0, 16.0])
    estimate = PoseEstimate(POSE, covariance, 0.9, 0.4)
    covariance[0, 0] = 0.0
    np.testing.assert_allclose(estimate.std, [2.0, 3.0, 4.0])
    with pytest.raises(ValueError, match="read-only"):
        estimate.covariance[0, 0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        estimate.inlier_ratio = 1.0  # type: ignore[misc]


def test_estimates_can_be_compared_and_kept_in_sets():
    estimate, twin = (PoseEstimate(POSE, np.eye(3), 0.9, 0.4) for _ in range(2))
    assert estimate == estimate
    assert estimate != twin
    assert len({estimate, twin}) == 2


@given(poses(), covariances())
def test_half_turn_turns_everything(pose: Pose2, covariance: np.ndarray):
    estimate = PoseEstimate(pose, covariance, 0.9, 0.4, (pose, pose.half_turn()))
    turned = estimate.half_turn()
    assert turned.pose == pose.half_turn()
    assert turned.candidates[0] == pose.half_turn()
    assert turned.candidates[1].error_to(pose) == pytest.approx((0.0, 0.0), abs=1e-9)
    np.testing.assert_allclose(turned.covariance, half_turn_covariance(covariance))
    np.testing.assert_allclose(turned.std, estimate.std)
    assert (turned.inlier_ratio, turned.residual_px) == (0.9, 0.4)


def test_an_estimate_has_the_attributes_of_its_pose():
    estimate = PoseEstimate(POSE, np.eye(3), 0.9, 0.4)
    assert (estimate.x_m, estimate.y_m, estimate.theta_rad) == (POSE.x_m, POSE.y_m, POSE.theta_rad)
    assert bool(estimate) is True


def test_edges_have_the_states_of_the_compiled_loops():
    states = (EdgeState.UNSEEN, EdgeState.FOUND, EdgeState.HIDDEN, EdgeState.MISSING)
    assert states == (UNSEEN, FOUND, HIDDEN, MISSING)
    assert len(EdgeState) == len(states)
