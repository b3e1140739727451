"""The pictures that are kept are the worst of all, however many processes each keep their own."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.evaluation.overlays import SPREAD_COUNT, WORST_COUNT, WorstSoFar, spread_indices


@given(count=st.integers(1, 500))
def test_spread_reaches_from_first_to_last(count: int) -> None:
    indices = sorted(spread_indices(count))
    assert indices[0] == 0
    assert indices[-1] == count - 1
    assert len(indices) == min(count, SPREAD_COUNT)
    gaps = [b - a for a, b in pairwise(indices)]
    assert not gaps or max(gaps) - min(gaps) <= 1


@given(values=st.lists(st.integers(0, 6), max_size=60), workers=st.integers(1, 4))
def test_the_worst_of_all_are_kept(values: list[int], workers: int) -> None:
    expected = sorted(range(len(values)), key=lambda i: (-values[i], i))[:WORST_COUNT]
    everything, each = WorstSoFar(), [WorstSoFar() for _ in range(workers)]
    for index, value in enumerate(values):
        severity = (1.0, float(value))
        mine = each[index * 7 % workers]
        if not mine.admits(index, severity):
            continue
        mine.add(index, severity, b"")
        if everything.admits(index, severity):
            everything.add(index, severity, bytes([index]))
    assert everything.pictures == [(index, bytes([index])) for index in expected]
