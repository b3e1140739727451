"""A fit's covariance and what the measurements alone tell of the pose, against plain NumPy."""

import numpy as np
import pytest

from robocup_vision.kernels.model_edges.conclude import covariance_with_prior, gained_nats, pose_alone, position_std
from robocup_vision.kernels.model_edges.tables import UNKNOWNS

POSE, REST = slice(0, 3), slice(3, UNKNOWNS)


def measured(seed, count=30):
    """Plant a prior's root, a fit, and information and gradient of z by linear measurements."""
    rng = np.random.default_rng(seed)
    root = np.tril(rng.normal(0.0, 0.2, (UNKNOWNS, UNKNOWNS)), -1) + np.diag(rng.uniform(0.3, 1.5, UNKNOWNS))
    # the camera's orientation does not hang on the pose
    root[REST, POSE] = 0.0
    rows, z = rng.normal(size=(count, UNKNOWNS)), rng.normal(size=UNKNOWNS)
    return root, z, rows.T @ rows, rows.T @ rng.normal(size=count)


@pytest.mark.parametrize("seed", range(4))
def test_the_covariance_is_that_of_the_measurements_with_the_prior(seed):
    root, _, information, _ = measured(seed)
    covariance = np.empty((UNKNOWNS, UNKNOWNS))
    assert covariance_with_prior(root, information, covariance)
    np.testing.assert_allclose(covariance, root @ np.linalg.inv(np.eye(UNKNOWNS) + information) @ root.T, atol=1e-12)
    # nothing measured: the prior; above the root's diagonal nothing is read
    assert covariance_with_prior(root + np.triu(np.ones_like(root), 1), np.zeros_like(root), covariance)
    np.testing.assert_allclose(covariance, root @ root.T, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_pose_alone_is_the_schur_complement_in_its_own_units(seed):
    root, z, information, gradient = measured(seed)
    pose_information, pose_gradient = np.empty((3, 3)), np.empty(3)
    assert pose_alone(root, z, information, gradient, pose_information, pose_gradient)
    part = information[POSE, REST] @ np.linalg.inv(np.eye(UNKNOWNS - 3) + information[REST, REST])
    marginal = information[POSE, POSE] - part @ information[REST, POSE]
    slope = gradient[POSE] - part @ (gradient[REST] - z[REST])
    back = np.linalg.inv(root[POSE, POSE])
    np.testing.assert_allclose(pose_information, back.T @ marginal @ back, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(pose_gradient, back.T @ slope, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_pose_alone_and_its_prior_give_the_covariance_with_the_prior(seed):
    root, z, information, gradient = measured(seed)
    covariance, pose_information = np.empty((UNKNOWNS, UNKNOWNS)), np.empty((3, 3))
    assert covariance_with_prior(root, information, covariance)
    assert pose_alone(root, z, information, gradient, pose_information, np.empty(3))
    prior = root[POSE, POSE] @ root[POSE, POSE].T
    joined = np.linalg.inv(pose_information + np.linalg.inv(prior))
    np.testing.assert_allclose(covariance[POSE, POSE], joined, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_gained_is_half_the_logarithm_of_how_much_smaller_the_covariance_of_the_pose_is(seed):
    root, _, information, _ = measured(seed)
    covariance = np.empty((UNKNOWNS, UNKNOWNS))
    covariance_with_prior(root, information, covariance)
    before = np.linalg.slogdet(root[POSE, POSE] @ root[POSE, POSE].T)[1]
    after = np.linalg.slogdet(covariance[POSE, POSE])[1]
    assert gained_nats(root, covariance) == pytest.approx((before - after) / 2)
    assert gained_nats(root, root @ root.T) == pytest.approx(0.0, abs=1e-9)


def test_an_indefinite_system_is_told():
    root, z, information, gradient = measured(0)
    assert not covariance_with_prior(root, -information, np.empty_like(root))
    assert not pose_alone(root, z, -information, gradient, np.empty((3, 3)), np.empty(3))


@pytest.mark.parametrize("seed", range(4))
def test_the_position_is_as_uncertain_as_its_worst_direction(seed):
    rows = np.random.default_rng(seed).normal(size=(10, 3))
    information = rows.T @ rows
    worst = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(information)[:2, :2]).max())
    assert position_std(information) == pytest.approx(worst)
    assert position_std(np.zeros((3, 3))) == pytest.approx(9.0)
