"""Free floor over three frames: specks and openings of one frame do not count, and motion carries the ones before."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.avoidance.recent_free_space import SteadyFreeSpace, carry_free_space
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

BEARING = (np.arange(64) + 0.5) * math.tau / 64
STILL = Pose2(0.0, 0.0, 0.0)


def in_room(pose, half_x=1.2, half_y=0.7):
    """Ranges to the walls of a rectangular room."""
    c, s = np.cos(BEARING + pose.theta_rad), np.sin(BEARING + pose.theta_rad)
    to_x = (np.copysign(half_x, c) - pose.x_m) / c
    to_y = (np.copysign(half_y, s) - pose.y_m) / s
    return FreeSpace(BEARING, np.minimum(to_x, to_y))


motions = st.builds(Pose2, st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.3, 0.3))


@given(motions)
def test_what_was_seen_is_carried_to_where_the_robot_is_now(motion):
    start = Pose2(0.2, -0.1, 0.4)
    carried = carry_free_space(in_room(start), motion)
    truth = in_room(start.compose(motion))
    np.testing.assert_array_equal(carried.bearing_rad, BEARING)
    # within what a sector's width is worth along a slanting wall
    assert np.median(np.abs(carried.range_m / truth.range_m - 1.0)) < 0.03
    assert np.max(carried.range_m / truth.range_m) < 1.15


def test_nothing_moved_or_nothing_seen_is_handed_back():
    seen = in_room(STILL)
    assert carry_free_space(seen, STILL) is seen
    nothing = FreeSpace(BEARING, np.full(64, np.inf))
    assert carry_free_space(nothing, Pose2(0.1, 0.0, 0.0)) is nothing


@given(st.integers(0, 63), st.floats(0.1, 5.0))
def test_a_speck_or_an_opening_in_one_frame_does_not_count(index, wrong):
    steady, seen = SteadyFreeSpace(), in_room(STILL)
    steady.update(seen, STILL)
    usual = steady.update(seen, STILL).range_m
    assert np.all(usual <= seen.range_m)
    assert np.all(usual >= 0.9 * seen.range_m)
    ranges = seen.range_m.copy()
    ranges[index] = wrong
    np.testing.assert_allclose(steady.update(FreeSpace(BEARING, ranges), STILL).range_m, usual)
    # the second time it counts
    again = steady.update(FreeSpace(BEARING, ranges), STILL).range_m[index]
    assert math.isclose(again / usual[index], wrong / seen.range_m[index])
