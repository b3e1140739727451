"""The compiled loops over polar samples against plain NumPy twins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.polar import classify, outer_boundary

seeds = st.integers(0, 2**32 - 1)
NO_MASK = np.empty((0, 0), dtype=np.uint8)
# channels that one colour of the floor and one of a wall may have
FLOOR, WALL = (50, 130, 45), (228, 232, 225)


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


def boundary_twin(llr, valid, certain, gap, min_strip):
    """Follow the docstring word for word."""
    rows, columns = llr.shape
    score = llr.astype(int)
    out = np.full(rows, -1)
    for k in range(rows):
        around = score[[k - 1, k, (k + 1) % rows]]
        for m in reversed(range(columns - 2)):
            three = score[k, m : m + 3].sum()
            long_run = m >= 2 and score[k, m - 2 : m + 3].sum() >= 5 * certain
            wide_run = around[:, m : m + 3].sum() >= 9 * certain
            if three >= 2 * certain and (long_run or wide_run):
                break
        else:
            continue
        positive = [j for j in range(m, m + 3) if score[k, j] > 0]
        edge = max(positive, default=m)
        while True:
            strips = [
                j
                for j in range(edge + 1, min(edge + gap + 2, columns - 1))
                if score[k, j] > 0 and score[k, j : j + 2].sum() >= min_strip
            ]
            if not strips:
                break
            edge = strips[0] + 1 if score[k, strips[0] + 1] > 0 else strips[0]
        if edge + 2 < columns and valid[k, edge + 1] and valid[k, edge + 2]:
            out[k] = edge
    return out


@settings(deadline=None, max_examples=60)
@given(seeds)
def test_outer_boundary_agrees_with_its_twin(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(3, 12), rng.integers(6, 30)
    llr = rng.integers(-64, 30, (rows, columns))
    for k in range(rows):  # floor up to somewhere, a line, a strip of floor behind it
        end = rng.integers(0, columns)
        llr[k, :end] += 60
        strip = end + rng.integers(1, 5)
        llr[k, strip : strip + rng.integers(0, 4)] += 70
    llr = np.clip(llr, -64, 64).astype(np.int8)
    valid = (rng.random((rows, columns)) < 0.95).astype(np.uint8)
    llr[valid == 0] = 0
    certain, gap, strip = int(rng.integers(10, 60)), int(rng.integers(0, 5)), int(rng.integers(20, 100))
    out = np.empty(rows, dtype=np.int64)
    outer_boundary(llr, valid, certain, gap, strip, out)
    np.testing.assert_array_equal(out, boundary_twin(llr, valid, certain, gap, strip))
