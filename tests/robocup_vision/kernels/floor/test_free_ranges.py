"""The compiled loops of free cells and ranges against plain NumPy twins."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.free_ranges import first_blocked, free_rings, sum_near, to_first_blocked

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=40)
@given(seeds)
def test_free_rings_are_counted_as_numpy_counts_them(seed):
    rng = np.random.default_rng(seed)
    mask = rng.integers(0, 4, (30, 20), dtype=np.uint8)
    cell = rng.integers(-1, 12, (30, 20), dtype=np.int32)
    needed = rng.integers(0, 50, (4, 3), dtype=np.int32)
    seen = rng.integers(0, 5, 3)
    bounds_m, free, range_m = np.cumsum(rng.random(5)), np.full(3, 99, dtype=np.int32), np.empty(3)
    free_rings(mask, cell, needed, seen, bounds_m, free, range_m)
    count = np.bincount(cell[(mask > 0) & (cell >= 0)], minlength=12).reshape(4, 3)
    ring = np.arange(4)[:, None]
    expected = np.cumprod((count >= needed) & (ring < seen), axis=0).sum(axis=0)
    np.testing.assert_array_equal(free, expected)
    np.testing.assert_array_equal(range_m, bounds_m[expected])


def test_the_nearest_columns_are_summed():
    llr = np.random.default_rng(0).integers(-128, 128, (30, 20)).astype(np.int8)
    assert sum_near(llr, 7) == llr[:, :7].sum(dtype=int)


@settings(deadline=None, max_examples=40)
@given(seeds)
def test_ranges_reach_to_the_nearest_blocked_sample_of_the_first_blocked_cell(seed):
    rng = np.random.default_rng(seed)
    mask = rng.integers(0, 3, (30, 20), dtype=np.uint8)
    cell = rng.integers(-1, 12, (30, 20), dtype=np.int32)
    near_m = rng.random((30, 20)).astype(np.float32)
    rings = rng.integers(0, 5, 3).astype(np.int32)
    range_m = rng.random(3)
    expected = range_m.copy()
    for j, ring in enumerate(rings):
        blocked = near_m[(mask == 0) & (cell == ring * 3 + j)]
        if ring < 4 and len(blocked):
            expected[j] = max(range_m[j], blocked.min())
    to_first_blocked(mask, cell, near_m, rings, range_m)
    np.testing.assert_array_equal(range_m, expected)


@settings(deadline=None, max_examples=60)
@given(seeds, st.integers(0, 3), st.integers(1, 4))
def test_first_blocked_agrees_with_its_twin(seed, first, run):
    rng = np.random.default_rng(seed)
    mask = (rng.random((15, 20)) < 0.6).astype(np.uint8)
    valid = (rng.random((15, 20)) < 0.9).astype(np.uint8)
    in_use = int(rng.integers(first, 21))
    out = np.empty(15, dtype=np.int64)
    first_blocked(mask, valid, first, in_use, run, out)
    for k in range(15):
        looked_at = [m for m in range(first, in_use) if valid[k, m]]
        ends = [i for i in range(run - 1, len(looked_at)) if not mask[k, looked_at[i - run + 1 : i + 1]].any()]
        expected = in_use
        if ends:
            expected = looked_at[ends[0]]
            while expected > first and valid[k, expected - 1] and not mask[k, expected - 1]:
                expected -= 1
        assert out[k] == expected
