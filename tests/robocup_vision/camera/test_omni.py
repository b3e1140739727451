"""The laws of the mirror camera over every floor range, tilt, offset, handedness and heading, and its conventions."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from strategies import PAPER_HORIZON_PX, PAPER_MIRROR, cameras, numbers

from field_models import ArgumentError
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.geometry import wrap_angle

PAPER = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
bearings = numbers(-3.1, 3.1)


@given(cameras(level=True), bearings)
def test_level_camera_sees_each_floor_point_in_its_bearing_and_range(camera: OmniCamera, bearing: float):
    radii = np.linspace(*camera.usable_radius_px, 9)[1:-1]
    from_axis = camera.pixel_to_floor(camera.polar_to_pixel(bearing, radii)) - camera.offset_m
    expected = 1 / camera.floor_range.inverse_range_per_m(radii)
    np.testing.assert_allclose(from_axis / expected[:, None], [[math.cos(bearing), math.sin(bearing)]] * 7, atol=1e-9)
    assert np.all(np.diff(np.hypot(*from_axis.T)) > 0)


@given(cameras(), bearings, numbers(30, 100))
def test_image_bearing_is_that_of_polar_to_pixel(camera: OmniCamera, bearing: float, radius: float):
    back = camera.image_bearing_rad(camera.polar_to_pixel(bearing, radius))
    assert wrap_angle(float(back) - bearing) == pytest.approx(0.0, abs=1e-9)


@given(cameras(level=True), bearings)
def test_mirrored_camera_is_the_reflection(camera: OmniCamera, bearing: float):
    camera = dataclasses.replace(camera, heading_rad=0.0)
    other = dataclasses.replace(camera, mirrored=not camera.mirrored)
    here, there = camera.polar_to_pixel(bearing, 50.0), other.polar_to_pixel(bearing, 50.0)
    assert here[0] == pytest.approx(there[0])
    assert here[1] - camera.center_px[1] == pytest.approx(-(there[1] - camera.center_px[1]))


@given(cameras(), numbers(-3.0, 3.0))
def test_turning_the_heading_turns_the_image(camera: OmniCamera, by_rad: float):
    turned = dataclasses.replace(camera, heading_rad=camera.heading_rad + by_rad)
    pixel = camera.polar_to_pixel(0.7, 60.0)
    assert float(turned.image_bearing_rad(pixel) - camera.image_bearing_rad(pixel)) == pytest.approx(by_rad)


@given(cameras(level=True), bearings, numbers(0.05, 0.9))
def test_point_above_the_floor_appears_farther_out_than_its_foot(camera: OmniCamera, bearing: float, ratio: float):
    inner, outer = camera.usable_radius_px
    foot = camera.pixel_to_floor(camera.polar_to_pixel(bearing, inner + ratio * (outer - inner)))
    heights = np.array([0.0, 0.2, 0.4]) * camera.height_m
    pixels = camera.point_to_pixel(np.column_stack([np.tile(foot, (3, 1)), heights]))
    radii = np.hypot(*(pixels - camera.center_px).T)
    radii = radii[np.isfinite(radii)]  # a table may end before the point's head
    assert len(radii) >= 1
    assert np.all(np.diff(radii) > 0)


def test_bearing_grows_counter_clockwise_in_the_image_as_shown():
    right, up, left, down = PAPER.polar_to_pixel([0, math.pi / 2, math.pi, -math.pi / 2], 50.0)
    np.testing.assert_allclose(right, [177.5, 109.5])  # ahead of the robot: +u
    np.testing.assert_allclose(up, [127.5, 59.5], atol=1e-9)  # left of the robot: up, v being down
    np.testing.assert_allclose(left, [77.5, 109.5], atol=1e-9)
    np.testing.assert_allclose(down, [127.5, 159.5], atol=1e-9)


def test_tilt_turns_the_rays_about_x_first_and_then_about_y():
    tilted = dataclasses.replace(PAPER, tilt_rad=(0.2, 0.1))
    about_x = np.array([[1, 0, 0], [0, math.cos(0.2), -math.sin(0.2)], [0, math.sin(0.2), math.cos(0.2)]])
    about_y = np.array([[math.cos(0.1), 0, math.sin(0.1)], [0, 1, 0], [-math.sin(0.1), 0, math.cos(0.1)]])
    pixels = [(217.5, 109.5), (127.5, 29.5), (100.0, 150.0)]
    np.testing.assert_allclose(tilted.pixel_to_ray(pixels), PAPER.pixel_to_ray(pixels) @ (about_y @ about_x).T)


def test_no_floor_from_the_horizon_on_but_rays():
    beyond = PAPER.polar_to_pixel(1.0, PAPER_HORIZON_PX + np.array([0.01, 3.0]))
    assert np.isnan(PAPER.pixel_to_floor(beyond)).all()
    assert np.all(PAPER.pixel_to_ray(beyond)[:, 2] > 0)
    np.testing.assert_allclose(PAPER.ray_to_pixel([1.0, 0.0, 0.0]), [127.5 + PAPER_HORIZON_PX, 109.5])


def test_straight_down_is_the_centre_and_straight_up_is_nowhere():
    np.testing.assert_allclose(PAPER.ray_to_pixel([0.0, 0.0, -1.0]), [127.5, 109.5])
    np.testing.assert_allclose(PAPER.pixel_to_ray([127.5, 109.5]), [0.0, 0.0, -1.0])
    np.testing.assert_allclose(PAPER.pixel_to_floor([[127.5, 109.5]]), [[0.0, 0.0]], atol=1e-12)
    assert np.isnan(PAPER.ray_to_pixel([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])).all()


def test_level_camera_needs_no_height_for_the_floor_but_for_what_stands_on_it():
    camera = OmniCamera((640, 480), (320.0, 240.0), (40.0, 190.0), Tangent(2.1, 0.0057))
    assert camera.height_m is None
    tall = dataclasses.replace(camera, viewpoint_height_m=0.7)
    np.testing.assert_allclose(camera.pixel_to_floor([400.0, 200.0]), tall.pixel_to_floor([400.0, 200.0]))
    with pytest.raises(ArgumentError, match="viewpoint_height_m is needed"):
        camera.point_to_pixel([1.0, 0.0, 0.1])


def test_tilted_camera_without_a_height_is_refused():
    with pytest.raises(ArgumentError, match="viewpoint_height_m is needed when the camera is tilted"):
        OmniCamera((640, 480), (320.0, 240.0), (40.0, 190.0), Tangent(2.1, 0.0057), tilt_rad=(0.01, 0.0))


def test_given_height_wins_over_the_implied_one():
    assert PAPER.height_m == pytest.approx(PAPER_MIRROR.implied_height_m)
    assert dataclasses.replace(PAPER, viewpoint_height_m=0.3).height_m == 0.3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"tilt_rad": (0.0, -2.0)},
            r"tilt_rad must lie between -pi/2 and pi/2, got \(0.0, -2.0\); -2 degrees are -0.0349",
        ),
        ({"heading_rad": 90.0}, "heading_rad must be in radians, within one turn, got 90.0; 90 degrees are 1.5708 rad"),
        (
            {"viewpoint_height_m": 205.0},
            "viewpoint_height_m must be in metres, at most 100, got 205.0; in millimetres it is 0.205 m",
        ),
        (
            {"offset_m": (30.0, 0.0)},
            r"offset_m must be in metres, at most 3, got \(30.0, 0.0\); in millimetres it is 0.03 m",
        ),
    ],
)
def test_numbers_in_degrees_or_millimetres_are_refused(paper_camera, changes, message):
    with pytest.raises(ArgumentError, match=message):
        dataclasses.replace(paper_camera, **changes)
