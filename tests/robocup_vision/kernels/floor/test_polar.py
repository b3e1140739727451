"""Colours of polar samples looked up as NumPy does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.polar import classify, outer_boundary

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=30)
@given(seeds, st.integers(0, 9))
def test_classify_agrees_with_numpy(seed, ring):
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, 256, (12, 9, 3), dtype=np.uint8)
    bits = ((5, 11), (6, 5), (5, 0))
    packing = np.array([[(v * (1 << n) // 256) << shift for v in range(256)] for n, shift in bits], dtype=np.uint16)
    table = rng.integers(-64, 65, 65536, dtype=np.int8)
    valid = rng.integers(0, 2, (12, 9), dtype=np.uint8)
    index = sum(packing[c][samples[..., c]].astype(int) for c in range(3))
    expected = np.where(valid > 0, table[index], 0)
    out = np.full((12, 9), 99, dtype=np.int8)
    mean = classify(samples, packing, table, valid, ring, out)
    np.testing.assert_array_equal(out, expected)
    seen = expected[:, :ring][valid[:, :ring] > 0]
    assert mean == pytest.approx(seen.mean() if len(seen) else 0.0)


@pytest.mark.parametrize(("first", "strength", "end"), [(13, 50, 14), (13, 5, 10), (16, 50, 10)])
def test_floor_goes_on_behind_a_line_where_a_strip_of_it_is_near_and_sure(first, strength, end):
    llr = np.full((5, 30), -40, np.int8)
    llr[:, :11], llr[:, first : first + 2] = 50, strength
    out = np.empty(5, np.int64)
    outer_boundary(llr, np.ones((5, 30), np.uint8), 48, 3, 80, out)
    np.testing.assert_array_equal(out, end)
