"""Colours of polar samples looked up as NumPy does."""

import numpy as np
import pytest

from robocup_vision.kernels.floor.polar import outer_boundary


@pytest.mark.parametrize(("first", "strength", "end"), [(13, 50, 14), (13, 5, 10), (16, 50, 10)])
def test_floor_goes_on_behind_a_line_where_a_strip_of_it_is_near_and_sure(first, strength, end):
    llr = np.full((5, 30), -40, np.int8)
    llr[:, :11], llr[:, first : first + 2] = 50, strength
    out = np.empty(5, np.int64)
    outer_boundary(llr, np.ones((5, 30), np.uint8), 48, 3, 80, out)
    np.testing.assert_array_equal(out, end)
