"""The scores of the search over the whole field: each place and heading its own, in integers that hold them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.walls.search import UNKNOWN, WIDEST, score_bank
from robocup_vision.localization.outline_search import OutlineSearchSettings

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_bank_scores_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    bank, levels = rng.integers(0, 1200, (4, 20), dtype=np.int16), rng.integers(0, 1200, 20, dtype=np.int16)
    bank[0] = levels + rng.integers(-150, 150, 20)
    known = rng.random(20) < rng.random()
    clockwise = np.roll(bank[:, ::-1], 1, axis=1)
    out = np.empty((4, 20), dtype=np.int16)
    score_bank(np.hstack([clockwise, clockwise]), np.where(known, levels, UNKNOWN).astype(np.int16), out)
    for shift in range(20):
        off = np.abs(levels.astype(int) - np.roll(bank, shift, axis=1))
        np.testing.assert_array_equal(out[:, shift], np.minimum(off, WIDEST)[:, known].sum(axis=1))


def test_no_sum_of_differences_is_too_large_for_two_bytes():
    count = OutlineSearchSettings().bank_bearings
    out = np.empty((1, count), dtype=np.int16)
    score_bank(np.zeros((1, 2 * count), dtype=np.int16), np.full(count, 2**15 - 1, dtype=np.int16), out)
    assert (out == count * int(WIDEST)).all()
