"""Systems of three equations against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.algebra.three import adjugate_3x3, solve_3x3


@given(st.integers(0, 2**32 - 1))
def test_both_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    rows = rng.normal(0, 3, (5, 3))
    matrix, right = rows.T @ rows + 0.1 * np.eye(3), rng.normal(0, 3, 3)
    adjugate, work, out = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    determinant = adjugate_3x3(matrix, adjugate)
    assert determinant == pytest.approx(np.linalg.det(matrix), rel=1e-9)
    np.testing.assert_allclose(adjugate / determinant, np.linalg.inv(matrix), rtol=1e-7, atol=1e-9)
    assert solve_3x3(matrix, right, work, out)
    np.testing.assert_allclose(out, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-9)


def test_a_singular_system_is_refused():
    out = np.full(3, 7.0)
    assert not solve_3x3(np.diag([1.0, 0.0, 1.0]), np.ones(3), np.empty((3, 3)), out)
    assert not solve_3x3(np.full((3, 3), np.nan), np.ones(3), np.empty((3, 3)), out)
    assert (out == 7.0).all()
