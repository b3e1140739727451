"""The scores of the search over the whole field: each place and heading its own, in integers that hold them."""

import numpy as np

from robocup_vision.kernels.walls.search import MAX_DIFFERENCE, sum_differences
from robocup_vision.localization.outline_search import OutlineSearchSettings


def test_no_sum_of_differences_is_too_large_for_two_bytes():
    count = OutlineSearchSettings().bank_bearings
    out = np.empty((1, count), dtype=np.int16)
    sum_differences(np.zeros((1, 2 * count), dtype=np.int16), np.full(count, 2**15 - 1, dtype=np.int16), out)
    assert (out == count * int(MAX_DIFFERENCE)).all()
