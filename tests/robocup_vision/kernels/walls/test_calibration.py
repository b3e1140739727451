"""The compiled map from pixels to homogeneous floor points, against the camera's own NumPy."""

import dataclasses

import cv2
import numpy as np
import pytest

from robocup_vision.calibration.omni.shape import homogeneous
from robocup_vision.camera import Hyperboloid, OmniCamera, Tangent
from robocup_vision.kernels.walls.calibration import MirrorView, floor_points


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


def plain_floor_points(pixels, inverse_range, view):
    """Rays through the viewpoint, cut with the floor in homogeneous coordinates."""
    off = (pixels - view.center_px) * [1.0, view.sign]
    bearing = np.arctan2(off[:, 1], off[:, 0]) + view.heading_rad
    height = view.viewpoint_m[2]
    down = np.arctan(inverse_range * height)
    ray = np.column_stack([np.cos(bearing) * np.cos(down), np.sin(bearing) * np.cos(down), -np.sin(down)])
    in_robot = ray @ view.camera_to_robot.T
    w = -in_robot[:, 2] / height
    return np.column_stack([in_robot[:, :2] + w[:, None] * view.viewpoint_m[:2], w])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_floor_points_agree_with_numpy(sign):
    rng = np.random.default_rng(5)
    rotation, _ = cv2.Rodrigues(np.array([0.03, -0.05, 0.1]))
    view = MirrorView((31.2, 30.1), sign, 0.7, np.ascontiguousarray(rotation), (0.03, -0.02, 0.21))
    pixels, inverse_range = rng.uniform(0, 62, (50, 2)), rng.uniform(0.1, 5.0, 50)
    inverse_range[:2] = np.nan, np.inf
    pixels[2] = view.center_px
    out = np.empty((50, 3))
    floor_points(pixels, inverse_range, view, out)
    np.testing.assert_array_equal(out[:3], -np.ones((3, 3)))
    np.testing.assert_allclose(out[3:], plain_floor_points(pixels[3:], inverse_range[3:], view), atol=1e-12)
