"""The compiled pinhole camera against the camera model's NumPy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation, project_ideal
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera, point_in_camera, slopes_to_floor
from robocup_vision.landmarks.landmark_map import pinhole_view
from robocup_vision.landmarks.pose_fit import to_camera

CAMERA = PinholeCamera(
    (320, 240), (277.0, 270.0), (159.5, 119.5), 0.6, offset_m=(0.05, -0.03), pan_rad=0.2, tilt_rad=0.1, roll_rad=0.02
)
POINTS = st.tuples(numbers(-3, 3), numbers(-3, 3), numbers(-3, 3)).map(np.array)


@given(numbers(-3.2, 3.2), numbers(-1.5, 1.5), numbers(-1.5, 1.5))
def test_axes_are_those_of_the_camera_model(pan, tilt, roll):
    np.testing.assert_allclose(camera_axes(pan, tilt, roll), camera_rotation(pan, tilt, roll), atol=1e-15)


@given(numbers(-3.2, 3.2), numbers(-1.5, 1.5), numbers(-1.5, 1.5), POINTS)
def test_a_vector_in_the_camera_is_the_rotation_turned_back(pan, tilt, roll, vector):
    rotation = camera_rotation(pan, tilt, roll)
    np.testing.assert_allclose(in_camera(camera_axes(pan, tilt, roll), *vector), vector @ rotation, atol=1e-14)


@given(POINTS, POINTS)
def test_a_point_of_the_field_in_the_camera_of_a_robot(pose, point):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    found = point_in_camera(pinhole_view(CAMERA), c, s, point[0] - pose[0], point[1] - pose[1], point[2])
    np.testing.assert_allclose(found, to_camera(CAMERA, pose, point[None])[0], atol=1e-13)


@given(numbers(0.1, 9.0), numbers(-3, 3), numbers(-3, 3))
def test_ideal_pixels_are_those_of_the_camera_model(ahead, left, up):
    expected = project_ideal((277.0, 270.0), (159.5, 119.5), np.array([ahead, left, up]))
    np.testing.assert_allclose(ideal_pixel(277.0, 270.0, 159.5, 119.5, ahead, left, up), expected, rtol=1e-14)


def test_rays_meet_the_floor_where_the_camera_model_says():
    pixels = np.random.default_rng(4).uniform((0, 0), CAMERA.size_px, (300, 2))
    ray = CAMERA.pixel_to_camera_ray(pixels)
    floor_m = np.empty((300, 2))
    slopes = np.ascontiguousarray(-ray[:, 1:] / ray[:, :1])
    slopes_to_floor(slopes, CAMERA.camera_to_robot, CAMERA.height_m, CAMERA.offset_m, floor_m)
    expected = CAMERA.pixel_to_floor(pixels)
    assert np.isnan(expected).any()
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(floor_m, expected, rtol=1e-6)
