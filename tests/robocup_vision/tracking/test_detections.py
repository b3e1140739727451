"""Detections: what lies inside known free space, and where an object's middle then is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.perception.obstacles import Obstacle
from robocup_vision.tracking import Detection, KnownFreeSpace, ReturnDetector
from robocup_vision.tracking.detections import in_field, near_side_ratio

FIELD = load_field("ssl_2001")
FREE = KnownFreeSpace.of_field(FIELD)
BEARING = (np.arange(256) + 0.5) * math.tau / 256 - math.pi
RADIUS = 0.09


def profile(*discs, reach=3.0):
    """Ranges of discs (x, y) in the robot frame."""
    range_m = np.full(len(BEARING), reach)
    for x, y in discs:
        along, aside = x * np.cos(BEARING) + y * np.sin(BEARING), y * np.cos(BEARING) - x * np.sin(BEARING)
        hit = (np.abs(aside) < RADIUS) & (along > 0)
        range_m[hit] = np.minimum(range_m[hit], (along - np.sqrt(np.maximum(RADIUS**2 - aside**2, 0)))[hit])
    return range_m


def test_depth_is_the_distance_to_the_border_and_nothing_outside():
    points = np.array([[0.0, 0.0], [1.0, 0.5], [1.45, 0.0], [0.0, 0.8], [9.0, 9.0]])
    depth = FREE.depth_m(points)
    np.testing.assert_allclose(depth[:2], [FIELD.width_m / 2, FIELD.width_m / 2 - 0.5], atol=0.03)
    assert 0 < depth[2] < 0.12  # inside the goal
    np.testing.assert_array_equal(depth[3:], 0.0)


@pytest.mark.parametrize(
    ("free", "cell_m", "message"),
    [
        (np.ones(4), 0.1, "free must be"),
        (np.ones((0, 3)), 0.1, "free must be"),
        (np.ones((2, 2)), 0.0, "cell_m must be"),
    ],
)
def test_free_space_that_is_none_is_refused(free, cell_m, message):
    with pytest.raises(ArgumentError, match=message):
        KnownFreeSpace(free, (0.0, 0.0), cell_m)


@pytest.mark.parametrize(
    ("changes", "message"), [({"radius_m": 0.0}, "radius_m"), ({"range_std": (0.0, 0.0)}, "range_std")]
)
def test_bad_settings_are_refused(changes, message):
    with pytest.raises(ArgumentError, match=message):
        ReturnDetector(FREE, **changes)


def test_a_covariance_of_another_shape_is_refused():
    with pytest.raises(ArgumentError, match=r"covariance must be \(2, 2\), got \(3, 3\)"):
        Detection(0.0, 0.0, np.eye(3))


@given(st.floats(-1.0, 1.0), st.floats(-0.4, 0.4), st.floats(-3.1, 3.1), st.floats(-1.0, 1.0), st.floats(-0.4, 0.4))
def test_an_object_is_found_at_its_middle_whatever_the_pose(x, y, theta, other_x, other_y):
    robot = Pose2(x, y, theta)
    at = robot.inverse().transform((other_x, other_y))
    if np.hypot(*at) < 0.25:
        return
    found = ReturnDetector(FREE).in_profile(BEARING, profile(at), robot)
    assert len(found) == 1
    np.testing.assert_allclose((found[0].x_m, found[0].y_m), at, atol=0.025)


def test_walls_and_what_the_pose_leaves_in_doubt_are_no_candidates():
    detector = ReturnDetector(FREE)
    robot = Pose2(0.0, 0.5, 0.0)
    wall = np.where(BEARING > 0, (FIELD.width_m / 2 - 0.5) / np.maximum(np.sin(BEARING), 1e-3), np.inf)
    assert detector.in_profile(BEARING, wall, robot) == ()
    # a little nearer than the wall should be
    nearer = wall - 0.06
    assert detector.in_profile(BEARING, nearer, robot) != ()
    assert detector.in_profile(BEARING, nearer, robot, np.diag([0.03, 0.03, 0.03]) ** 2) == ()


def test_what_is_seen_in_part_is_known_less_well_across():
    detector = ReturnDetector(FREE)
    whole = detector.in_profile(BEARING, profile((0.6, 0.0)), Pose2(0, 0, 0))[0].covariance
    cut = np.where(BEARING > 0.06, 3.0, profile((0.6, 0.0)))
    part = detector.in_profile(BEARING, np.where(BEARING < 0.0, 3.0, cut), Pose2(0, 0, 0))[0].covariance
    assert part[1, 1] > 2 * whole[1, 1]
    assert part[0, 0] == pytest.approx(whole[0, 0], rel=0.1)


def test_two_side_by_side_are_two():
    found = ReturnDetector(FREE).in_profile(BEARING, profile((0.5, 0.09), (0.5, -0.09)), Pose2(0, 0, 0))
    assert len(found) == 2
    np.testing.assert_allclose(sorted(d.y_m for d in found), [-0.09, 0.09], atol=0.02)


def test_far_returns_are_left_out():
    assert ReturnDetector(FREE, longest_m=0.5).in_profile(BEARING, profile((0.7, 0.0)), Pose2(0, 0, 0)) == ()


def test_the_obstacles_of_a_view_serve_as_well():
    detector = ReturnDetector(FREE, longest_m=2.0)
    robot = Pose2(-1.0, 0.0, 0.0)

    def obstacle(x, y):
        return Obstacle(x, y, 2 * RADIUS, math.atan2(y, x), math.hypot(x, y))

    found = detector.in_obstacles([obstacle(0.6, 0.0), obstacle(0.0, 0.75), obstacle(2.2, 0.0)], robot)
    assert len(found) == 1
    assert found[0].x_m == pytest.approx(0.6 + RADIUS * math.pi / 4)
    assert detector.in_obstacles([], robot) == ()


@pytest.mark.parametrize("part", [0.05, 0.5, 0.8, 1.0, 1.3])
def test_the_near_side_lies_before_the_middle_by_what_is_seen_of_it(part):
    half = min(part, 1.0)
    across = (np.arange(20_000) + 0.5) / 20_000 * half
    assert near_side_ratio(part) == pytest.approx(np.sqrt(1.0 - across**2).mean(), abs=1e-5)


def test_in_an_image_a_sliver_is_no_body():
    detector, robot = ReturnDetector(FREE), Pose2(-1.0, 0.0, 0.0)

    def at(bearing, range_m, width_m):
        return Obstacle(range_m * math.cos(bearing), range_m * math.sin(bearing), width_m, bearing, range_m)

    body, sliver = at(0.0, 0.8, 0.17), at(0.13, 0.9, 0.04)
    assert len(detector.in_obstacles([body, sliver], robot)) == 1
    assert detector.in_obstacles([sliver], robot) == ()
    # half a body is one
    assert len(detector.in_obstacles([body, at(0.4, 0.9, 1.01 * RADIUS)], robot)) == 2


def test_in_the_field_frame_the_robots_own_covariance_adds():
    seen = [Detection(1.0, 0.0, np.diag([0.01, 0.04]))]
    places, spreads = in_field(seen, Pose2(0.5, 0.5, math.pi / 2), np.diag([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(places, [[0.5, 1.5]])
    # turned by a quarter; the heading moves it along x
    np.testing.assert_allclose(spreads[0], np.diag([0.04 + 0.1 + 0.3, 0.01 + 0.2]), atol=1e-12)
    places, spreads = in_field([], Pose2(0, 0, 0))
    assert places.shape == (0, 2)
    assert spreads.shape == (0, 2, 2)
