"""The rotation of a pinhole camera and its ideal projection, against elementary rotations and the camera model."""

import dataclasses
import math

import numpy as np
from hypothesis import given
from strategies import numbers

from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation, project_ideal

CAMERA = PinholeCamera((320, 240), (277.0, 270.0), (159.5, 119.5), 0.6)


@given(numbers(-3.2, 3.2), numbers(-1.5, 1.5), numbers(-1.5, 1.5))
def test_the_rotation_is_the_product_of_three(pan, tilt, roll):
    cp, sp, ct, st, cr, sr = (f(a) for a in (pan, tilt, roll) for f in (math.cos, math.sin))
    about_z = np.array([[cp, -sp, 0.0], [sp, cp, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[ct, 0.0, -st], [0.0, 1.0, 0.0], [st, 0.0, ct]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    np.testing.assert_allclose(camera_rotation(pan, tilt, roll), about_z @ about_y @ about_x, atol=1e-15)


def test_many_rotations_at_once_are_those_of_one_each():
    angles = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 4, 5))
    many = camera_rotation(*angles)
    assert many.shape == (4, 5, 3, 3)
    for index in np.ndindex(4, 5):
        np.testing.assert_allclose(many[index], camera_rotation(*(float(a[index]) for a in angles)), atol=1e-15)


def test_ideal_pixels_are_those_of_a_camera_without_distortion():
    points = np.random.default_rng(4).uniform((-1, -2, -2), (5, 2, 2), (200, 3))
    pixels = project_ideal(CAMERA.focal_px, CAMERA.center_px, points)
    np.testing.assert_allclose(pixels, CAMERA.camera_ray_to_pixel(points), rtol=1e-12)
    assert np.isnan(pixels[points[:, 0] <= 0]).all()


def test_each_point_may_have_its_own_focal_length():
    points = np.random.default_rng(5).uniform((1, -2, -2), (5, 2, 2), (20, 3))
    scale = np.linspace(0.9, 1.1, 20)
    pixels = project_ideal((277.0 * scale, 270.0 * scale), CAMERA.center_px, points)
    for k, factor in enumerate(scale):
        one = dataclasses.replace(CAMERA, focal_px=(277.0 * factor, 270.0 * factor))
        np.testing.assert_allclose(pixels[k], one.camera_ray_to_pixel(points[k]), rtol=1e-12)
