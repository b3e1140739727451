"""The compiled loops of free cells and ranges against plain NumPy twins."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_ranges import FreeCells, measure_ranges, sum_near

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=80)
@given(seeds, st.booleans(), st.integers(1, 31))
def test_ranges_are_those_of_numpy(seed, is_ring, columns):
    rng = np.random.default_rng(seed)
    mask = rng.integers(0, 4, (30, columns), dtype=np.uint8)
    valid = (rng.random((30, columns)) < 0.9).astype(np.uint8)
    cell = rng.integers(-1, 12, (30, columns), dtype=np.int32)
    allowed = rng.integers(0, 50, (4, 3), dtype=np.int32)
    seen, first_m = rng.integers(0, 5, 3), 0.1 * rng.random(3)
    bounds_m, near_m = np.cumsum(rng.random(5)), rng.random((30, columns)).astype(np.float32)
    range_m = np.empty(3)
    measure_ranges(mask, valid, FreeCells(cell, allowed, seen, bounds_m, near_m, first_m, is_ring), range_m)
    is_blocked = (mask == 0) & (cell >= 0) & (valid > 0)
    count = np.bincount(cell[is_blocked], minlength=12).reshape(4, 3)
    ring = np.arange(4)[:, None]
    free = np.cumprod((count <= allowed) & (ring < seen), axis=0).sum(axis=0)
    expected = bounds_m[free]
    for j, rings in enumerate(free):
        nearest = near_m[is_blocked & (cell == rings * 3 + j)]
        if rings < 4 and len(nearest) and not is_ring:
            expected[j] = 0.0 if nearest.min() <= first_m[j] else max(expected[j], nearest.min())
    np.testing.assert_array_equal(range_m, expected)


def test_the_nearest_columns_are_summed():
    llr = np.random.default_rng(0).integers(-128, 128, (30, 20)).astype(np.int8)
    assert sum_near(llr, 7) == llr[:, :7].sum(dtype=int)
