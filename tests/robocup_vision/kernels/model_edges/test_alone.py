"""The frame alone, against NumPy's eigenvectors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.model_edges.alone import eigen_3x3, frame_alone


def some_matrix(seed, rank):
    """Return a symmetric matrix of this rank whose axes differ by orders of magnitude, as of frames."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, rank)) * 10.0 ** rng.uniform(-2.0, 4.0, rank)
    return root @ root.T


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_axes_and_values_are_numpy_s(seed, rank):
    matrix = some_matrix(seed, rank)
    left, axes = matrix.copy(), np.empty((3, 3))
    eigen_3x3(left, axes)
    largest = max(float(np.abs(matrix).max()), 1e-300)
    np.testing.assert_allclose(np.sort(np.diag(left)), np.linalg.eigvalsh(matrix), atol=1e-12 * largest)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes @ np.diag(np.diag(left)) @ axes.T, matrix, atol=1e-12 * largest)


@pytest.mark.parametrize("seed", range(5))
def test_what_is_not_open_takes_newton_s_step_and_the_rest_none(seed):
    information, gradient = some_matrix(seed, 3) + 4.0 * np.eye(3), np.array([0.3, -2.0, 5.0])
    covariance = np.empty((3, 3))
    step = frame_alone(information, gradient, 1.0, covariance)
    np.testing.assert_allclose(step, np.linalg.solve(information, gradient), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(information), rtol=1e-6, atol=1e-9)
    # one direction tells nothing
    axis = np.array([0.6, 0.0, 0.8])
    blind = np.eye(3) - np.outer(axis, axis)
    step = np.array(frame_alone(blind @ information @ blind, gradient, 1.0, covariance))
    assert abs(step @ axis) < 1e-6
    assert axis @ covariance @ axis == pytest.approx(1.0, rel=1e-3)
