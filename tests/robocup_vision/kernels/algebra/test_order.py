"""Numbers are ordered, and arrays copied, as NumPy does it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robocup_vision.kernels.algebra.copies import copy_matrix, copy_vector
from robocup_vision.kernels.algebra.order import quantiles, sort, sorted_median

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


@given(hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2, max_side=6), elements=numbers))
def test_copies_are_equal(matrix):
    target, row = np.zeros_like(matrix), np.zeros(matrix.shape[1])
    copy_matrix(matrix, target)
    copy_vector(matrix[0], row)
    np.testing.assert_array_equal(target, matrix)
    np.testing.assert_array_equal(row, matrix[0])
