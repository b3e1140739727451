"""Tables of the floor for a head that pans and nods, and balls that stay on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import Mounting, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.methods import choose_method
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.free_space import FreeSpaceGrid
from robocup_vision.pipeline import floor_tables
from robocup_vision.pipeline.floor_tables import FloorTableCache
from robocup_vision.pipeline.frames import FrameOptions
from robocup_vision.pipeline.pinhole import PinholePipeline

FIELD = load_field("four_legged_2007")
CAMERA = PinholeCamera(
    (208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, offset_m=(0.05, 0.01), pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0
)
# the tilt is left open
OPEN = replace(CAMERA, offset_m=(0.0, 0.0), tilt_rad=None, roll_rad=None)
DIRECTIONS, RINGS = 40, 60


def floors_of(camera):
    return FloorTableCache(FIELD, camera, None, DIRECTIONS, RINGS)


def range_m(view, grid, post_m):
    """Return free ranges where nothing stands but a post."""
    away_m = np.hypot(*np.moveaxis(view.floor_m - post_m, -1, 0))
    return grid.measure((~(away_m < 0.12)).astype(np.uint8)).range_m


@settings(max_examples=15)
@given(st.floats(-1.5, 1.5), st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), st.floats(0.5, 1.2))
def test_a_panned_camera_measures_as_by_tables_of_its_own(pan_rad, ahead_m, aside_m, post_m):
    camera = replace(CAMERA, offset_m=(ahead_m, aside_m))
    held = camera.with_orientation(pan_rad, camera.tilt_rad, camera.roll_rad)
    floor = floors_of(camera).for_camera(held).held(held)
    view = FloorView(held)
    grid = FreeSpaceGrid(view, DIRECTIONS, RINGS)
    place = post_m * np.array([math.cos(pan_rad), math.sin(pan_rad)])
    np.testing.assert_allclose(floor.grid.bearing_rad, grid.bearing_rad, atol=0.02)
    measured, expected = range_m(floor.view, floor.grid, place), range_m(view, grid, place)
    # beside the post's edges a direction may be blocked in one and free in the other
    assert np.mean(np.abs(measured / expected - 1.0) < 0.02) >= 0.9
    assert np.min(measured) == pytest.approx(np.min(expected), rel=0.03)


def test_tables_are_made_once_a_step():
    floors = floors_of(CAMERA)
    one, same, other = (
        floors.for_camera(CAMERA.with_orientation(pan_rad, -0.18, 0.01)) for pan_rad in (0.0, 1e-3, 0.3)
    )
    assert one is same
    assert one is not other
    # neither a body's nod nor another pan is a reason to forget where a ball was
    assert (one.balls.sizes, one.marking) == (other.balls.sizes, other.marking)
    at_the_centre = floors_of(replace(CAMERA, offset_m=(0.0, 0.0)))
    assert at_the_centre.for_camera(CAMERA) is at_the_centre.for_camera(CAMERA.with_orientation(1.0, -0.16, 0.0))


@settings(max_examples=15)
@given(st.booleans(), st.floats(-0.6, 0.1), st.floats(-0.1, 0.1), st.floats(-0.03, 0.03))
def test_a_tilt_left_open_or_told_gets_tables_of_about_that_tilt_and_height(is_open, tilt_rad, roll_rad, height):
    camera = OPEN if is_open else replace(OPEN, tilt_rad=-0.17, roll_rad=0.01)
    told = Mounting(tilt_rad=tilt_rad, roll_rad=roll_rad, height_m=camera.height_m * math.exp(height))
    held = camera.held(told)
    made = floors_of(camera).for_camera(held)
    assert made.camera.tilt_rad == pytest.approx(tilt_rad, abs=math.radians(1.0) + 1e-9)
    assert made.camera.roll_rad == pytest.approx(roll_rad, abs=math.radians(1.0) + 1e-9)
    assert made.camera.height_m == pytest.approx(held.height_m, rel=0.0101)
    floor = made.held(held)
    assert (floor.camera.tilt_rad, floor.camera.roll_rad) == (tilt_rad, roll_rad)
    assert floor.camera.height_m == held.height_m
    # samples of a place on the floor lie where that place is in this picture, but for the height's step
    shown = np.hypot(*np.moveaxis(floor.view.floor_m, -1, 0)) < 50.0
    expected = floor.view.camera.floor_to_pixel(floor.view.floor_m[shown])
    inside = ((expected >= 0) & (expected <= (207, 159))).all(axis=-1)
    np.testing.assert_allclose(floor.view.pixels[shown][inside], expected[inside], atol=1e-6)


def test_a_head_that_nods_finds_its_tables_again():
    floors = floors_of(CAMERA)
    nod = [CAMERA.held(Mounting(tilt_rad=-0.17 + math.radians(20.0) * math.sin(0.2 * step))) for step in range(64)]
    made = [floors.for_camera(camera) for camera in nod]
    assert 15 < len({id(floor) for floor in made}) < 25
    assert all(floors.for_camera(camera) is floor for camera, floor in zip(nod, made, strict=True))


def test_no_more_are_kept_than_said(monkeypatch):
    monkeypatch.setattr(floor_tables, "_MAX_TABLES", 3)
    floors = floors_of(CAMERA)
    made = [floors.for_camera(CAMERA.with_orientation(0.2 * turn, -0.17, 0.0)) for turn in (0, 1, 2, 0, 3)]
    # the one that was used longest ago went first
    assert floors.for_camera(made[0].camera) is made[0]
    assert floors.for_camera(made[1].camera) is not made[1]


def test_a_camera_that_looks_up_sees_no_floor():
    floors = floors_of(OPEN)
    assert floors.for_camera(replace(OPEN, tilt_rad=1.0, roll_rad=0.0)) is None
    assert floors.for_camera(replace(OPEN, tilt_rad=-0.3, roll_rad=0.0)) is not None


@pytest.fixture(scope="module")
def pipeline():
    camera = PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.2, tilt_rad=-0.3)
    options = FrameOptions(choose_method(camera, "floor"), None, None, 80, 20, "bgr")
    return PinholePipeline(load_field("ssl_2001"), camera, options)


@pytest.mark.parametrize(
    ("beyond_m", "along_std_m", "is_kept"),
    [(-0.2, 0.01, True), (0.2, 0.1, False), (0.2, 0.3, True), (1.0, 0.9, False), (1.0, 1.1, True)],
)
def test_a_ball_stays_where_it_would_be_on_the_floor_one_standard_deviation_nearer(
    pipeline, beyond_m, along_std_m, is_kept
):
    # towards the wall at the left
    wall_m = pipeline.field.width_m / 2
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    covariance = along_std_m**2 * np.outer(along, along) + 1e-4 * np.outer(across, across)
    robot = Pose2(0.0, 0.0, np.pi / 2 - np.arctan2(0.6, 0.8))
    x, y = (wall_m + beyond_m) * along
    ball = Ball(x, y, covariance, 100.0, 50.0)
    assert bool(pipeline.on_floor((ball,), robot)) == is_kept
