"""Cholesky factors, sorting and quantiles against NumPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robocup_vision.kernels.algebra.cholesky import factor, invert, solve_symmetric, substitute
from robocup_vision.kernels.algebra.order import quantiles, sort, sorted_median

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(1, 8))
def test_cholesky_factors_solutions_and_inverses_agree_with_numpy(seed, n):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(8, 8))
    matrix, right = half @ half.T + 0.1 * np.eye(8), rng.normal(size=8)
    lower, solved = matrix.copy(), right.copy()
    assert factor(lower, n)
    substitute(lower, n, solved)
    np.testing.assert_allclose(np.tril(lower[:n, :n]), np.linalg.cholesky(matrix[:n, :n]), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(solved[:n], np.linalg.solve(matrix[:n, :n], right[:n]), rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(solved[n:], right[n:])
    whole, inverse = right.copy(), np.empty((8, 8))
    assert solve_symmetric(matrix.copy(), whole)
    np.testing.assert_allclose(whole, np.linalg.solve(matrix, right), rtol=1e-6, atol=1e-9)
    expected = np.linalg.inv(matrix)
    assert invert(matrix, inverse)
    np.testing.assert_allclose(inverse, expected, rtol=1e-6, atol=1e-9)


def test_cholesky_refuses_an_indefinite_matrix():
    assert not solve_symmetric(-np.eye(3), np.ones(3))
    assert not invert(-np.eye(3), np.empty((3, 3)))


numbers = st.floats(-1e6, 1e6)


@given(hnp.arrays(np.float64, st.integers(0, 130), elements=numbers))
def test_sorting_agrees_with_numpy(values):
    mine = values.copy()
    sort(mine)
    np.testing.assert_array_equal(mine, np.sort(values))


@given(hnp.arrays(np.float64, st.integers(1, 60), elements=numbers))
def test_the_median_agrees_with_numpy(values):
    assert sorted_median(values.copy()) == np.median(values)


@given(
    hnp.arrays(np.float64, st.integers(1, 300), elements=st.one_of(numbers, st.sampled_from([0.0, 1.0, 1e-3]))),
    hnp.arrays(np.float64, st.integers(1, 4), elements=st.floats(0, 1)),
)
def test_quantiles_agree_with_numpy(values, parts):
    found = np.empty(len(parts))
    quantiles(values, parts, np.empty(len(values) + 1), found)
    np.testing.assert_allclose(found, np.quantile(values, parts), rtol=1e-9, atol=1e-9)
