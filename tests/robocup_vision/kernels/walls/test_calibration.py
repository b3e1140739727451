"""The compiled map from pixels to homogeneous floor points, against the camera's own NumPy."""

import dataclasses

import numpy as np
import pytest

from robocup_vision.calibration.omni.fit import homogeneous
from robocup_vision.camera import Hyperboloid, OmniCamera, Tangent


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("curve", [Hyperboloid(10120.0, 20.54, 2.298e5), Tangent(0.7, 0.0115)])
def test_floor_points_are_those_of_the_camera(curve, mirrored):
    camera = OmniCamera(
        (256, 220),
        (127.2, 108.9),
        (26.0, 112.0),
        curve,
        mirrored=mirrored,
        heading_rad=0.7,
        offset_m=(0.03, -0.02),
        tilt_rad=(0.02, -0.03),
        viewpoint_height_m=0.21,
    )
    pixels = np.random.default_rng(1).uniform((10, 10), (246, 210), (400, 2))
    point = homogeneous(camera, pixels)
    floor = camera.pixel_to_floor(pixels)
    seen = np.isfinite(floor).all(axis=1)
    # the camera itself calls the last hair before the horizon sky
    assert np.all(point[~seen, 2] < 1e-8)
    np.testing.assert_allclose(point[seen, :2] / point[seen, 2:], floor[seen], rtol=1e-9)


def test_points_without_a_range_are_marked():
    camera = OmniCamera((64, 64), (31.0, 31.0), (5.0, 30.0), Tangent(0.7, 0.1))
    point = homogeneous(camera, np.array([[31.0, 31.0], [31.0, 31.0 + 40.0]]))
    np.testing.assert_array_equal(point, -np.ones((2, 3)))
    assert homogeneous(dataclasses.replace(camera, floor_range=Tangent(0.7, 0.01)), np.array([[36.0, 31.0]]))[0, 2] > 0
