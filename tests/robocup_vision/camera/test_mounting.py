"""How a head holds its camera in one frame: what is told, and what is left to the camera file."""

import dataclasses
import math

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera import Mounting, PinholeCamera
from robocup_vision.camera.pinhole import MOUNTING_NAMES

CAMERA = PinholeCamera(
    (320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, offset_m=(0.05, 0.0), pan_rad=0.1, tilt_rad=-0.26, roll_rad=0.02,
    roll_std_rad=0.02,
)  # fmt: skip


def test_a_camera_is_held_as_a_file_with_those_values_says():
    # looked at once, so that what is worked out of the old orientation would be found again
    CAMERA.camera_to_robot, CAMERA.viewpoint_m  # noqa: B018
    told = Mounting(pan_rad=-0.4, tilt_rad=-0.6, height_m=0.41, tilt_std_rad=0.01, height_std_m=0.004)
    held, file = CAMERA.held(told), dataclasses.replace(CAMERA, **told.known)
    for name in MOUNTING_NAMES:
        assert getattr(held, name) == getattr(file, name)
    pixels = [(10.0, 200.0), (300.0, 230.0)]
    np.testing.assert_array_equal(held.pixel_to_floor(pixels), file.pixel_to_floor(pixels))
    np.testing.assert_array_equal(held.viewpoint_m, file.viewpoint_m)
    assert held.roll_rad == CAMERA.roll_rad
    assert held.sway_std_rad == (0.01, 0.02)
    assert CAMERA.sway_std_rad == (0.02, 0.02)
    assert CAMERA.held(Mounting()).is_held_as(CAMERA)
    assert not held.is_held_as(CAMERA)
    assert CAMERA.held_as(held).is_held_as(held)
    assert CAMERA.held(Mounting(pan_rad=0.9)).is_held_as(CAMERA)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"tilt_rad": -15.0}, "tilt_rad must lie between -pi/2 and pi/2, got -15.0; -15 degrees are -0.2618 rad"),
        ({"pan_rad": 90.0}, "pan_rad must be in radians, within one turn, got 90.0; 90 degrees are 1.5708 rad"),
        ({"tilt_std_rad": 2.0}, "tilt_std_rad must be in radians, at most 0.5, got 2.0; 2 degrees are 0.0349 rad"),
        ({"roll_std_rad": -0.1}, "roll_std_rad must not be negative, got -0.1"),
        ({"height_std_m": -1.0}, "height_std_m must not be negative, got -1.0"),
        ({"height_m": 0.0}, "height_m must be positive, got 0.0"),
        ({"roll_rad": math.nan}, "roll_rad must be a finite number, got nan"),
        ({"height_m": "high"}, "height_m must be a finite number, got 'high'"),
    ],
)
def test_wrong_values_are_named(told, message):
    with pytest.raises(ArgumentError, match=rf"^a mounting's {message}$"):
        Mounting(**told)
