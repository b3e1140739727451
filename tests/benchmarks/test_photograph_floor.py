"""Distances to walls that free floor in photographs is measured against."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scores.photograph_floor import walls_m, walls_near_m
from robocup_vision.geometry import Pose2

ROOM = np.array([[-2.0, -1.0, 2.0, -1.0], [2.0, -1.0, 2.0, 1.0], [2.0, 1.0, -2.0, 1.0], [-2.0, 1.0, -2.0, -1.0]])
PANEL = np.array([[1.5, -0.5, 1.5, 0.5]])


def test_the_first_wall_ahead_counts():
    pose = Pose2(0.5, 0.0, 0.0)
    bearing = np.array([0.0, math.pi / 2, math.pi, math.atan2(0.6, 1.0)])
    np.testing.assert_allclose(walls_m(np.vstack([ROOM, PANEL]), pose, bearing)[:3], [1.0, 1.0, 2.5])
    # past the end of the panel
    np.testing.assert_allclose(walls_m(np.vstack([ROOM, PANEL]), pose, bearing)[3], 1.5 / math.cos(bearing[3]))


@given(st.floats(-1.9, 1.9), st.floats(-0.9, 0.9), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_ray_ends_on_the_room_s_walls(x, y, theta, bearing):
    (away,) = walls_m(ROOM, Pose2(x, y, theta), np.array([bearing]))
    end = x + away * math.cos(theta + bearing), y + away * math.sin(theta + bearing)
    assert min(abs(abs(end[0]) - 2.0), abs(abs(end[1]) - 1.0)) < 1e-9
    assert abs(end[0]) < 2.0 + 1e-9
    assert abs(end[1]) < 1.0 + 1e-9


def test_a_reference_that_errs_puts_walls_between_two_distances():
    bearing = np.linspace(-1.0, 1.0, 21)
    nearest, farthest = walls_near_m(ROOM, Pose2(0.3, 0.1, 0.2), bearing)
    away = walls_m(ROOM, Pose2(0.3, 0.1, 0.2), bearing)
    assert np.all(nearest < away)
    assert np.all(away < farthest)
    # a thirtieth of a metre, and of a radian, at up to 2 m
    assert np.all(farthest - nearest < 0.5)
    np.testing.assert_allclose(
        walls_near_m(ROOM, Pose2(0.0, 0.0, 0.0), np.zeros(1)), [[2 - 1 / 30], [2.0344]], atol=1e-3
    )
