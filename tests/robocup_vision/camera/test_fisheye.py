"""The fisheye camera: the projections' own equations, OpenCV's fisheye model, its table."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import FISHEYES, KANNALA_BRANDT, fisheye

from field_models.errors import ArgumentError
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.algebra.lens import MAX_SLOPE2, distorted, slopes_at


def ray(angle_rad, around_rad):
    aside = math.sin(angle_rad)
    return np.array([math.cos(angle_rad), -aside * math.cos(around_rad), -aside * math.sin(around_rad)])


angles = st.floats(0.0, 1.55)
turns = st.floats(-math.pi, math.pi)


@given(angles, turns)
def test_a_ray_is_shown_as_far_from_the_centre_as_its_projection_says(angle, around):
    for name, radius in (("equidistant", angle), ("equisolid", 2.0 * math.sin(0.5 * angle))):
        held = fisheye(name)
        expected = np.array([math.cos(around), math.sin(around)]) * radius * held.focal_px + held.center_px
        np.testing.assert_allclose(held.camera_ray_to_pixel(ray(angle, around)), expected, atol=1e-9)


@given(angles, turns)
def test_kannala_and_brandts_projection_is_opencvs(angle, around):
    held, direction = fisheye(), ray(angle, around)
    matrix = np.array([[held.focal_px[0], 0, held.center_px[0]], [0, held.focal_px[1], held.center_px[1]], [0, 0, 1.0]])
    point = np.array([[[-direction[1], -direction[2], direction[0]]]])
    expected, _ = cv2.fisheye.projectPoints(point, np.zeros(3), np.zeros(3), matrix, np.array(KANNALA_BRANDT))
    np.testing.assert_allclose(held.camera_ray_to_pixel(direction), expected.ravel(), atol=1e-6)


@given(st.floats(0.05, 8.0), turns)
def test_floor_comes_back_through_its_pixels_behind_the_camera_too(range_m, bearing):
    held = fisheye("beyond 180 degrees", tilt_rad=-1.4)
    place = held.viewpoint_m[:2] + range_m * np.array([math.cos(bearing), math.sin(bearing)])
    pixel = held.floor_to_pixel(place)
    if np.isfinite(pixel).all():
        np.testing.assert_allclose(held.pixel_to_floor(pixel), place, atol=1e-6)
    else:
        outside = held.camera_to_robot.T @ (np.array([*place, 0.0]) - held.viewpoint_m)
        assert math.atan2(math.hypot(*outside[1:]), outside[0]) > held.widest_rad - 1e-9


def test_a_lens_of_more_than_180_degrees_shows_what_lies_behind_it():
    held = fisheye("beyond 180 degrees")
    behind = ray(math.radians(95.0), 0.7)
    pixel = held.camera_ray_to_pixel(behind)
    np.testing.assert_allclose(held.pixel_to_camera_ray(pixel), behind, atol=1e-9)
    assert np.isnan(held.ideal_slopes(pixel)).all()


@pytest.mark.parametrize("name", FISHEYES)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_the_table_of_compiled_loops_is_the_camera(name, right, down):
    held, lens = fisheye(name), lens_table(fisheye(name))
    assert right * right + down * down < lens[MAX_SLOPE2]
    pixel = held.camera_ray_to_pixel(np.array([1.0, -right, -down]))
    x, y, xa, xb, ya, yb = distorted(lens, right, down)
    np.testing.assert_allclose(np.array([x, y]) * held.focal_px + held.center_px, pixel, atol=1e-4)
    if name != "kannala_brandt" or math.hypot(right, down) > 1e-3:
        np.testing.assert_allclose(np.arctan(slopes_at(lens, *pixel)), np.arctan([right, down]), atol=1e-6)
    step = 1e-5
    by_a = np.array(distorted(lens, right + step, down)[:2]) - np.array(distorted(lens, right - step, down)[:2])
    by_b = np.array(distorted(lens, right, down + step)[:2]) - np.array(distorted(lens, right, down - step)[:2])
    np.testing.assert_allclose([xa, ya, xb, yb], np.concatenate([by_a, by_b]) / (2 * step), atol=1e-6)


def test_without_its_lens_it_is_a_pinhole_camera_mounted_alike():
    held = fisheye()
    ideal = held.without_lens
    assert type(ideal) is PinholeCamera
    assert not ideal.is_bent
    assert (ideal.focal_px, ideal.tilt_rad, ideal.offset_m) == (held.focal_px, held.tilt_rad, held.offset_m)
    np.testing.assert_allclose(
        ideal.pixel_to_ray(held.ideal_pixels((400.0, 350.0))), held.pixel_to_ray((400.0, 350.0)), atol=1e-12
    )


def test_a_radius_that_falls_from_the_axis_on_is_refused():
    with pytest.raises(ArgumentError, match="makes the radius fall"):
        FisheyeCamera((640, 480), (200.0, 200.0), (320.0, 240.0), 0.5, (-1e9, 0.0, 0.0, 0.0)).widest_rad  # noqa: B018
