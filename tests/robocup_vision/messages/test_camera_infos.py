"""A camera_info against a camera file: the same lens in other words is the same, another one is told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.messages.camera_infos import camera_info, camera_info_problem

LENS = (-0.28, 0.09, 0.001, -0.0005, 0.0)
CAMERA = PinholeCamera((640, 480), (520.0, 521.0), (322.0, 238.0), 0.5, distortion=LENS)


def info(**changes: Any) -> Any:
    message = camera_info(CAMERA, 1.0, "camera")
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_a_cameras_own_info_is_its_own() -> None:
    assert camera_info_problem(info(), CAMERA) == ""
    # nobody has calibrated it
    assert camera_info_problem(info(k=np.zeros(9), d=np.empty(0), distortion_model=""), CAMERA) == ""


@pytest.mark.parametrize(
    ("projection", "distortion", "model"),
    [
        ("kannala_brandt", (-0.02, -0.003, 0.0, 0.0), "equidistant"),
        ("equidistant", (), "equidistant"),
        ("equisolid", (), ""),
    ],
)
def test_a_fisheyes_own_info_is_its_own(projection: Any, distortion: tuple[float, ...], model: str) -> None:
    camera = FisheyeCamera((640, 480), (200.0, 201.0), (322.0, 238.0), 0.5, distortion, projection=projection)
    message = camera_info(camera, 1.0, "camera")
    assert message.distortion_model == model
    assert camera_info_problem(message, camera) == ""
    if model:
        message.d = np.array([0.1, 0.0, 0.0, 0.0])
        assert "equidistant [0.1, 0, 0, 0]" in camera_info_problem(message, camera)


@pytest.mark.parametrize("binning", [(0, 0), (1, 1), (2, 2)])
@pytest.mark.parametrize("offset", [(0, 0), (100, 60)])
def test_binning_and_region_of_interest_are_taken_into_account(
    binning: tuple[int, int], offset: tuple[int, int]
) -> None:
    # camera_info describes the whole sensor, the image is a binned part of it
    bins = max(binning[0], 1)
    message = info(binning_x=binning[0], binning_y=binning[1])
    message.k = np.array(
        [520.0 * bins, 0, 322.0 * bins + offset[0], 0, 521.0 * bins, 238.0 * bins + offset[1], 0, 0, 1]
    )
    message.width, message.height = 640 * bins + 2 * offset[0], 480 * bins + 2 * offset[1]
    if offset != (0, 0):
        message.roi.x_offset, message.roi.y_offset = offset
        message.roi.width, message.roi.height = 640 * bins, 480 * bins
    assert camera_info_problem(message, CAMERA) == ""


def test_a_region_of_interest_of_another_size_is_told() -> None:
    message = info()
    message.roi.width, message.roi.height = 320, 240
    assert camera_info_problem(message, CAMERA) == (
        "camera_info says 320x240 (after binning and region of interest), the camera file 640x480"
    )


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"distortion_model": "equidistant", "d": np.array([-0.2, 0.05, 0.0, 0.0])}, "equidistant [-0.2, 0.05, 0, 0]"),
        ({"distortion_model": "equidistant", "d": np.zeros(4)}, "equidistant [0, 0, 0, 0]"),
        ({"d": np.array([-0.2, 0.09, 0.0, 0.0, 0.0])}, "plumb_bob [-0.2, 0.09, 0, 0, 0]"),
        ({"d": np.zeros(5)}, "up to 86 px from where the camera file does"),
        ({"k": np.array([560.0, 0, 322, 0, 561, 238, 0, 0, 1])}, "focal length 560.0, 561.0 and centre 322.0, 238.0"),
        ({"k": np.array([520.0, 0, 342, 0, 521, 238, 0, 0, 1])}, "focal length 520.0, 521.0 and centre 342.0, 238.0"),
        ({"k": np.full(9, np.nan)}, "camera_info holds numbers that are not finite"),
        ({"distortion_model": "division"}, "has the distortion model 'division', which cannot be compared"),
    ],
)
def test_another_lens_is_told(changes: dict[str, Any], problem: str) -> None:
    assert problem in camera_info_problem(info(**changes), CAMERA)
