"""The compiled loops that find the foot of dark things, against plain NumPy twins and edges drawn to be known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.dark_feet import (
    FADE,
    SPREAD,
    block_dark_bodies,
    block_dark_feet,
    doubt_beyond,
    foot_px,
)
from robocup_vision.kernels.floor.free_floor import BLOCKED, FLOOR, LINE

seeds = st.integers(0, 2**32 - 1)


def half_way(brightness, valid, last):
    """Return the brightness half way between the floor up to a column and what lies behind, of one bearing."""
    behind = slice(last + 1, last + 3)
    if last + 2 >= len(brightness) or not valid[behind].all():
        return 0.0
    floor, dark = brightness[max(last - SPREAD, 0) : last + 1].max(), brightness[behind].min()
    return 0.5 * (floor + dark) if dark < floor else 0.0


def blocked_feet(brightness, valid, in_use, marks):
    """Return marks (K, M) with the floor that is less than half floor blocked before what was blocked."""
    out = marks.copy()
    for k, row in enumerate(marks):
        for m in range(1, in_use):
            if row[m] == BLOCKED and row[m - 1] == FLOOR:
                half = half_way(brightness[k], valid[k], m - 1)
                at = m - 1
                while at > max(m - 1 - SPREAD, 0) and row[at] == FLOOR and brightness[k, at] < half:
                    out[k, at] = BLOCKED
                    at -= 1
    return out


@settings(deadline=None, max_examples=60)
@given(seeds, st.integers(6, 20))
def test_feet_are_blocked_as_numpy_blocks_them(seed, in_use):
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, 256, (12, 20, 3), dtype=np.uint8)
    valid = (rng.random((12, 20)) < 0.95).astype(np.uint8)
    marks = rng.choice(np.array([0, 1, 1, 1, 2, 3], dtype=np.uint8), (12, 20))
    expected = blocked_feet(samples.sum(axis=2), valid, in_use, marks)
    block_dark_feet(samples, valid, in_use, marks)
    np.testing.assert_array_equal(marks, expected)


@pytest.mark.parametrize("foot", [9.6, 12.0, 14.3])
@pytest.mark.parametrize("spread", [0.6, 1.5])
def test_the_foot_lies_where_half_of_the_floor_is_left(foot, spread):
    at = np.arange(30)
    floor = 1.0 / (1.0 + np.exp((at - foot) / (0.4 * spread)))
    samples = np.repeat(np.rint(20 + 120 * floor)[None, :, None], 3, axis=2).astype(np.uint8)
    by_color = np.array([int(np.flatnonzero(floor > 0.08)[-1]), -1])
    ends = np.empty(2)
    samples, valid = np.repeat(samples, 2, axis=0), np.ones((2, 30), dtype=np.uint8)
    foot_px(samples, valid, by_color, 3.0 * at, 3.0, ends)
    # no more than the sampling leaves open
    assert ends[0] / 3.0 == pytest.approx(foot, abs=0.25 if spread > 1 else 0.5)
    assert np.isnan(ends[1])
    marks = (floor > 0.08).astype(np.uint8)[None].repeat(2, axis=0)
    block_dark_feet(samples, valid, 30, marks)
    np.testing.assert_array_equal(marks, np.repeat((floor >= 0.5)[None], 2, axis=0))


def test_what_is_bright_behind_the_floor_leaves_its_end_where_it_was():
    samples = np.full((1, 20, 3), 90, dtype=np.uint8)
    samples[0, 12:] = 200
    marks = (np.arange(20) < 12).astype(np.uint8)[None]
    ends = np.empty(1)
    valid = np.ones((1, 20), dtype=np.uint8)
    foot_px(samples, valid, np.array([11]), np.arange(20.0), 1.0, ends)
    block_dark_feet(samples, valid, 20, marks)
    assert ends[0] == 11.5
    assert marks.sum() == 12


@settings(deadline=None, max_examples=40)
@given(seeds, st.integers(1, 64))
def test_only_weak_evidence_beyond_the_outermost_floor_is_taken_back(seed, certain):
    rng = np.random.default_rng(seed)
    llr = rng.integers(-64, 65, (10, 20)).astype(np.int8)
    columns = rng.integers(-1, 20, 10)
    expected = llr.copy()
    beyond = (columns >= 0)[:, None] & (np.arange(20) > columns[:, None])
    expected[beyond & (llr > 0) & (llr < certain)] = 0
    doubt_beyond(columns, certain, llr)
    np.testing.assert_array_equal(llr, expected)


def dark_stretch(behind, level=0.3):
    """Return samples and marks of one bearing: floor, at column 12 a stretch as dark as `level`, at 22 what follows."""
    brightness = np.full(40, 120.0)
    brightness[12:22] *= level
    marks = np.full((1, 40), FLOOR, dtype=np.uint8)
    marks[0, 22:26] = behind
    return np.repeat(brightness.astype(np.uint8)[None, :, None], 3, axis=2), marks


def blocked_of(samples, marks):
    block_dark_bodies(samples, np.ones(marks.shape, dtype=np.uint8), 36, marks)
    return np.flatnonzero(marks[0] == BLOCKED).tolist()


def test_a_dark_stretch_of_floor_before_something_else_is_its_body_and_before_floor_a_shadow():
    assert blocked_of(*dark_stretch(BLOCKED)) == list(range(12, 26))
    assert blocked_of(*dark_stretch(FLOOR)) == []
    assert blocked_of(*dark_stretch(LINE)) == []
    # what is no darker than a shadow stays floor
    assert blocked_of(*dark_stretch(BLOCKED, level=0.6)) == list(range(22, 26))


def test_a_body_that_is_dark_up_to_the_horizon_is_blocked_where_half_of_the_light_is_left():
    at = np.arange(40)
    brightness = np.interp(at, [10, 10 + FADE - 2], [120, 20])
    samples = np.repeat(brightness.astype(np.uint8)[None, :, None], 3, axis=2)
    marks = np.full((1, 40), FLOOR, dtype=np.uint8)
    assert blocked_of(samples, marks) == list(range(int(np.flatnonzero(brightness < 60)[0]), 36))
