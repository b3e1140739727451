"""A camera that nods is found out by the feet of the boards, and left alone where they say nothing new."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.walls import MIN_BEARINGS, tilt_by_walls, wall_range_m
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.vision import Vision
from sim2d.rendering.goal.scenes import CLEAR_SHOT
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene

WALLS = load_field("ssl_division_b").walls
HELD = PinholeCamera((640, 480), (640.0, 640.0), (319.5, 239.5), 0.17, pan_rad=0.0, tilt_rad=-0.29, roll_rad=0.0)
VIEW = FloorView(HELD, 120)
POSE = Pose2(2.6, 0.8, 0.3)
ROBOT = PoseEstimate(POSE, np.diag([0.01, 0.01, 0.01]) ** 2, 1.0, 0.0)


def seen_ends(tilt_rad, rng, hidden=0.0):
    """Return where the floor ends in the view that is believed, by a camera that is held otherwise."""
    held = HELD.with_orientation(0.0, tilt_rad, 0.0)
    bearing = VIEW.bearing_rad
    feet = wall_range_m(WALLS, POSE, bearing)[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    pixels = held.floor_to_pixel(feet)
    ends = np.array([VIEW.from_pixel(pixel)[1] if np.isfinite(pixel).all() else np.nan for pixel in pixels])
    ends = ends + rng.normal(0, 0.7, VIEW.bearings)
    return np.where(rng.random(VIEW.bearings) < hidden, ends - rng.uniform(10, 120, VIEW.bearings), ends)


@given(st.floats(-0.02, 0.02), st.floats(0.0, 0.5), st.integers(0, 2**32 - 1))
def test_the_nod_is_found_though_half_of_the_boards_are_hidden(nod_rad, hidden, seed):
    ends = seen_ends(HELD.tilt_rad + nod_rad, np.random.default_rng(seed), hidden)
    tilt = tilt_by_walls(VIEW, ends, WALLS, ROBOT, HELD)
    found = HELD.tilt_rad if tilt is None else tilt
    assert found - HELD.tilt_rad == pytest.approx(nod_rad, abs=0.25 * abs(nod_rad) + 0.0025)


def test_it_is_left_where_the_ends_are_few_or_agree_on_nothing_or_say_nothing_new():
    rng = np.random.default_rng(2)
    ends = seen_ends(HELD.tilt_rad + 0.01, rng)
    assert tilt_by_walls(VIEW, ends, WALLS, ROBOT, HELD) is not None
    few = np.where(np.arange(VIEW.bearings) < MIN_BEARINGS - 1, ends, np.nan)
    assert tilt_by_walls(VIEW, few, WALLS, ROBOT, HELD) is None
    assert tilt_by_walls(VIEW, ends - rng.uniform(0, 300, VIEW.bearings), WALLS, ROBOT, HELD) is None
    assert tilt_by_walls(VIEW, seen_ends(HELD.tilt_rad, rng), WALLS, ROBOT, HELD) is None


def test_an_unsure_pose_and_a_stiff_mounting_say_less():
    ends = seen_ends(HELD.tilt_rad + 0.015, np.random.default_rng(4))
    camera = replace(HELD, roll_std_rad=0.01)
    sure = tilt_by_walls(VIEW, ends, WALLS, ROBOT, camera)
    unsure = PoseEstimate(POSE, np.diag([0.3, 0.3, 0.1]) ** 2, 1.0, 0.0)
    less = tilt_by_walls(VIEW, ends, WALLS, unsure, camera)
    assert sure is not None
    assert sure - HELD.tilt_rad > 1.5 * ((HELD.tilt_rad if less is None else less) - HELD.tilt_rad)
    stiff = PinholeCamera(
        HELD.size_px, HELD.focal_px, HELD.center_px, 0.17, pan_rad=0.0, tilt_rad=-0.29, roll_rad=0.0, roll_std_rad=0.0
    )
    assert tilt_by_walls(VIEW, ends, WALLS, ROBOT, stiff) is None


@pytest.mark.slow
def test_free_space_ends_at_the_boards_though_the_camera_nods():
    """Only this finds a nod that the pose knows and the free space does not."""
    field, robot = load_field("ssl_division_b"), Pose2(2.9, -0.4, 0.2)
    nodding = HELD.with_orientation(0.0, HELD.tilt_rad + 0.012, 0.0)
    light = render_pinhole(nodding, Scene(field=field), robot, supersample=2)
    frame = CLEAR_SHOT.expose(light, np.random.default_rng(1))
    vision = Vision(field, HELD, method="field")
    view = vision.look(frame, prior=PoseEstimate(robot, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0))
    assert view.pose
    board = wall_range_m(field.walls, robot, view.free_space.bearing_rad)
    ratio = view.free_space.range_m / board
    assert np.median(ratio) == pytest.approx(1.0, abs=0.06)
    # by the tilt of the camera file alone the boards seem far too near or far
    as_filed = vision.look(frame)
    assert not as_filed.pose
    assert abs(np.median(as_filed.free_space.range_m / board) - 1.0) > 0.1
