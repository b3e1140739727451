"""Runs linked to strips, against plain Python."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.paint.runs import find_mask_runs, link_runs


def plain_chains(row, left, right, lean, max_gap):
    """Do what link_runs does, with every earlier chain looked at each time."""
    ends, chain = [], []
    for n in range(len(row)):
        scores = []
        for k, m in enumerate(ends):
            gap = row[n] - row[m]
            off = max(abs(left[n] - left[m]), abs(right[n] - right[m]))
            if 0 < gap <= max_gap and off <= 1.0 + lean * gap:
                scores.append((off + 0.5 * gap, k))
        k = min(scores)[1] if scores else len(ends)
        if k == len(ends):
            ends.append(n)
        ends[k] = n
        chain.append(k)
    return chain


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_chains_agree_with_plain_python(seed):
    rng = np.random.default_rng(seed)
    row = np.sort(rng.integers(0, 12, 60)).astype(np.float64) * 4
    left = rng.integers(0, 15, 60) * 3.0 + rng.uniform(-1, 1, 60)
    right = left + 6 + rng.uniform(-1, 1, 60)
    chain = np.empty(60, np.int64)
    count = link_runs(row, left, right, 0.27, 16.0, chain)
    expected = plain_chains(row, left, right, 0.27, 16.0)
    assert chain.tolist() == expected
    assert count == max(expected) + 1


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 5]))
def test_stretches_of_a_mask_are_those_of_numpy(seed, row_step):
    mask = (np.random.default_rng(seed).random((23, 40)) < 0.7).astype(np.uint8)
    found = np.empty((3, 23 * 21))
    count = find_mask_runs(mask, row_step, 8, *found)
    expected = []
    for v in range(row_step // 2, 23, row_step):
        change = np.diff(np.pad(mask[v].astype(int), 1))
        for start, end in zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True):
            if end - start <= 8 and start > 0 and end < 40:
                expected.append((v, start - 0.5, end - 0.5))
    assert found[:, :count].T.tolist() == [list(map(float, run)) for run in expected]
