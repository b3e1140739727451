"""Times of messages: the longest rising part, against all parts of short sequences."""

from __future__ import annotations

from itertools import combinations, pairwise

from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.recording.bags.topic_times import TopicTimes, rising


@given(st.lists(st.integers(0, 6).map(float), max_size=8))
def test_rising_is_the_longest_part_that_rises(times_s: list[float]) -> None:
    parts = (
        part
        for size in range(len(times_s), -1, -1)
        for part in combinations(range(len(times_s)), size)
        if all(times_s[before] < times_s[after] for before, after in pairwise(part))
    )
    # the first of the longest, in the order of their places, is the earliest
    assert rising(times_s) == list(next(parts))


@given(
    rate=st.floats(0.01, 100.0),
    begin_s=st.floats(-1e9, 1e9),
    logged_s=st.lists(st.floats(0.0, 1000.0), min_size=1, max_size=20).map(sorted),
)
def test_no_stamp_of_a_clock_of_its_own_rate_is_off(rate: float, begin_s: float, logged_s: list[float]) -> None:
    evenly_s = [index * 0.1 for index in range(len(logged_s))]
    for logged in (evenly_s, [0.0] * len(logged_s)):
        stamps = tuple(begin_s + rate * 0.1 * index for index in range(len(logged_s)))
        assert TopicTimes("/image", stamps, tuple(logged)).off == frozenset()
    # a recorder that rests for long, on one clock
    assert TopicTimes("/image", tuple(begin_s + t for t in logged_s), tuple(logged_s)).off == frozenset()


def test_a_message_that_cannot_be_read_stands_at_the_time_of_its_logging() -> None:
    times = TopicTimes("/image", (5.0, float("nan"), 5.2), (100.0, 100.1, 100.2))
    assert [round(t_s, 9) for t_s in times.times_s(by_stamps=True)] == [5.0, 5.1, 5.2]
    assert times.times_s(by_stamps=False) == [100.0, 100.1, 100.2]
