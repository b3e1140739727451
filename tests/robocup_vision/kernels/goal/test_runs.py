"""Runs linked to strips, against plain Python."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.runs import link_runs


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
