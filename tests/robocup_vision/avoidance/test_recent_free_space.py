"""Free floor all around from views of a part of it: each direction as it was seen last, for a while."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.avoidance.recent_free_space import RecentFreeSpace
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

STILL = Pose2(0.0, 0.0, 0.0)
RADIUS_M, UNSEEN_M = 0.13, 0.39


def view(robot, pan_rad=0.0, half_x=3.0, half_y=2.0):
    """Return what a camera with a view of 60 degrees sees of a rectangular room."""
    bearing = np.linspace(-math.pi / 6, math.pi / 6, 80) + pan_rad
    c, s = np.cos(bearing + robot.theta_rad), np.sin(bearing + robot.theta_rad)
    to_x, to_y = (np.copysign(half_x, c) - robot.x_m) / c, (np.copysign(half_y, s) - robot.y_m) / s
    return FreeSpace(bearing, np.minimum(to_x, to_y))


def range_at(free_space, bearing_rad):
    return free_space.range_m[np.argmin(np.abs(free_space.bearing_rad - bearing_rad))]


def test_the_newest_view_counts_where_it_shows_something_and_an_older_one_elsewhere():
    recent = RecentFreeSpace(RADIUS_M)
    recent.update(view(STILL, 1.0), STILL, 0.0)
    joined = recent.update(view(STILL, -1.0, half_x=1.0), STILL, 0.2)
    assert range_at(joined, 1.4) == pytest.approx(2.0 / math.sin(1.4), rel=0.05)
    assert range_at(joined, -0.9) == pytest.approx(1.0 / math.cos(0.9), rel=0.1)
    assert range_at(joined, math.pi) == range_at(joined, 0.0) == pytest.approx(UNSEEN_M)
    assert np.isfinite(joined.range_m).all()


def test_what_was_seen_too_long_ago_does_not_count():
    recent = RecentFreeSpace(RADIUS_M)
    recent.update(view(STILL, 1.0), STILL, 0.0)
    assert range_at(recent.update(view(STILL, -1.0), STILL, 1.9), 1.0) > 2.0
    assert range_at(recent.update(view(STILL, -1.0), STILL, 2.1), 1.0) == pytest.approx(UNSEEN_M)
    recent.forget()
    assert range_at(recent.update(view(STILL, 1.0), STILL, 2.2), -1.0) == pytest.approx(UNSEEN_M)


@given(st.lists(st.builds(Pose2, st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.2, 0.2)), max_size=10))
def test_older_views_move_with_the_robot(motions):
    robot, recent = Pose2(0.3, -0.2, 0.4), RecentFreeSpace(RADIUS_M)
    recent.update(view(robot, 1.2), STILL, 0.0)
    for k, motion in enumerate(motions):
        robot = robot.compose(motion)
        joined = recent.update(view(robot, -2.5), motion, 0.15 * (k + 1))
    if motions:
        away = robot.theta_rad - 0.4
        truth = view(robot, 1.2 - away).range_m
        # the middle of what the first view shows
        got = [range_at(joined, bearing) for bearing in view(robot, 1.2 - away).bearing_rad[30:50]]
        assert np.max(np.abs(np.array(got) / truth[30:50] - 1.0)) < 0.2


def test_the_robot_does_not_stand_in_its_own_way():
    wall = FreeSpace(view(STILL).bearing_rad, np.full(80, 0.2))
    recent = RecentFreeSpace(RADIUS_M)
    recent.update(wall, STILL, 0.0)
    # it has gone to where that was: somebody went away
    joined = recent.update(view(STILL, 2.0), Pose2(0.2, 0.0, 0.0), 0.2)
    assert joined.range_m.min() >= RADIUS_M


def test_a_robot_without_size_is_refused():
    with pytest.raises(ArgumentError, match="robot_radius_m must be positive"):
        RecentFreeSpace(0.0)
