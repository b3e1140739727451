"""What stands where: footprints, free ranges, and the walls that a field's file means."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import COLOR_NAMES, field_names, load_field
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Box, Robot, Room, Scene

SSL = load_field("ssl_2001")
DISTANCES = st.floats(-0.6, 0.6)
ANGLES = st.floats(-3.1, 3.1)


def test_free_range_to_box_and_robot():
    scene = Scene(load_field("msl_6x4"), boxes=(Box(1.0, 0.0),), robots=(Robot(0.0, 1.0, 0.25),))
    ranges = scene.free_range_m(Pose2(0.0, 0.0, 0.0), [0.0, math.pi / 2, math.pi])
    np.testing.assert_allclose(ranges, [1 - 0.065, 0.75, math.inf])


@given(x=DISTANCES, y=DISTANCES, yaw=ANGLES, theta=ANGLES, bearing=ANGLES)
def test_free_range_ends_on_the_first_footprint(x: float, y: float, yaw: float, theta: float, bearing: float):
    """March along the bearing in small steps instead."""
    pose = Pose2(-0.9, 0.0, theta)
    box, robot = Box(x, y, yaw), Robot(-0.4, -0.45, 0.09)
    if box.distance_m(pose.x_m, pose.y_m) < 0.02:
        return
    found = Scene(SSL, boxes=(box,), robots=(robot,)).free_range_m(pose, [bearing])[0]
    steps = np.arange(0.0, 3.2, 0.002)
    points = pose.transform(np.stack([steps * math.cos(bearing), steps * math.sin(bearing)], axis=1))
    free = SSL.contains(points) & (np.hypot(points[:, 0] + 0.4, points[:, 1] + 0.45) > 0.09)
    free &= np.array([box.distance_m(px, py) > 0 for px, py in points])
    first = steps[np.argmin(free)]
    if first > found + 0.004:  # a graze shorter than a step: it must be one
        middle = pose.transform([found * math.cos(bearing), found * math.sin(bearing)])
        assert box.distance_m(*middle) < 1e-6 or abs(math.hypot(middle[0] + 0.4, middle[1] + 0.45) - 0.09) < 1e-6
    else:
        assert first == pytest.approx(found, abs=0.004)


def test_recess_walls_are_the_goals():
    walls = list(Scene(SSL).walls())
    assert len(walls) == len(SSL.floor_polygon)
    for side, name in ((1, "yellow"), (-1, "blue")):
        colored = [w for w in walls if w.left_bgr == COLOR_NAMES[name]]
        assert len(colored) == 3
        assert all(w.height_m == 0.18 and min(side * w.x0_m, side * w.x1_m) >= 1.37 - 1e-9 for w in colored)
    assert sum(w.height_m == 0.10 for w in walls) == len(walls) - 6


@pytest.mark.parametrize("name", field_names())
def test_everything_upright_of_a_field_is_there(name: str):
    field = load_field(name)
    scene = Scene(field)
    panels = sum(3 for goal in field.goals if goal.kind == "panels")
    posts = sum(2 for goal in field.goals if goal.kind == "posts")
    edges = len(field.floor_polygon) if field.is_bounded else 0
    assert len(list(scene.walls())) == edges + panels
    assert len(list(scene.posts())) == posts + len(field.beacons)


def test_carpet_grows_only_where_nothing_bounds_it():
    msl = load_field("msl_6x4")
    grown = Scene(msl, carpet_margin_m=0.5).carpet_polygon
    np.testing.assert_allclose(np.abs(grown), np.abs(msl.floor_polygon) + 0.5)
    np.testing.assert_array_equal(Scene(SSL, carpet_margin_m=0.5).carpet_polygon, SSL.floor_polygon)


def test_bystanders_stand_off_the_carpet_and_come_from_the_seed():
    scene = Scene(SSL, room=Room(seed=3, bystanders=40))
    first, again = list(scene.bystanders()), list(scene.bystanders())
    assert first == again
    assert len(first) == 40
    for thing in first:
        corners = thing.corners if isinstance(thing, Box) else np.array([[thing.x_m, thing.y_m]])
        assert not SSL.contains(corners).any()


def test_clearance():
    scene = Scene(SSL, boxes=(Box(0.0, 0.0),), robots=(Robot(0.5, 0.0, 0.09),))
    assert scene.clearance_m(0.2, 0.0) == pytest.approx(0.135)
    assert scene.clearance_m(0.38, 0.0) == pytest.approx(0.03)
    assert scene.clearance_m(0.0, 0.7) == pytest.approx(0.0625)
