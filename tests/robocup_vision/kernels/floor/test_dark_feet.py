"""The foot of dark things, drawn to be known."""

import numpy as np
import pytest
from hypothesis import strategies as st

from robocup_vision.kernels.floor.dark_feet import (
    FADE,
    block_dark_bodies,
    block_dark_feet,
    foot_px,
)
from robocup_vision.kernels.floor.free_floor import BLOCKED, FLOOR, LINE

seeds = st.integers(0, 2**32 - 1)


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
