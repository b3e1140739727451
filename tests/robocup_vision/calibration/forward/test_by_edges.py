"""Pinhole cameras by lines, goals and walls, from starts that are some percent off."""

import math
from dataclasses import replace

import numpy as np
import pytest
from forward_pictures import PLACES, render

from field_models import load_field
from robocup_vision.calibration.forward.calibrate import calibrate_forward
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2

TRUE = PinholeCamera(
    (320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, pan_rad=0.0, tilt_rad=math.radians(-15.0), roll_rad=0.0
)


@pytest.fixture(scope="module")
def spl():
    return load_field("spl_2020")


@pytest.fixture(scope="module")
def frames(spl):
    return render(spl, TRUE, PLACES, 8, margin_m=0.4)


def off(ratio, height_m=0.0, tilt_deg=0.0):
    assert TRUE.tilt_rad is not None
    return replace(
        TRUE,
        focal_px=(ratio * TRUE.focal_px[0], ratio * TRUE.focal_px[1]),
        height_m=TRUE.height_m + height_m,
        tilt_rad=TRUE.tilt_rad + math.radians(tilt_deg),
    )


def assert_is_true(result, camera=TRUE):
    """Within what it states, and that is little."""
    assert result, result.reason
    std = result.std
    assert std["focal_px"] < 0.03 * camera.focal_px[0]
    assert abs(result.camera.focal_px[0] - camera.focal_px[0]) < 3 * std["focal_px"] + 0.003 * camera.focal_px[0]
    assert abs(result.camera.height_m - camera.height_m) < 3 * std["height_m"] + 0.002
    assert abs(result.camera.tilt_rad - camera.tilt_rad) < 3 * std["tilt_rad"]


@pytest.mark.parametrize(
    ("ratio", "height_m", "tilt_deg"),
    [
        (0.93, 0.0, 0.0),
        pytest.param(1.15, -0.03, -1.0, marks=pytest.mark.slow),
    ],
)
def test_lines_alone_correct_a_start(ratio, height_m, tilt_deg, spl, frames):
    """The farther start alone finds a fit that is led astray by one that is too long, too low and nods."""
    assert_is_true(calibrate_forward(spl, frames, off(ratio, height_m, tilt_deg)))


@pytest.mark.slow
def test_lines_do_without_any_start(spl, frames):
    """Only this finds a search over tilts, focal lengths and heights that misses the true ones."""
    assert_is_true(calibrate_forward(spl, frames))


@pytest.mark.slow
def test_walls_serve_where_goals_have_no_posts():
    """Only this finds boards that draw a lens's fit to another scale."""
    field = load_field("ssl_2001")
    camera = replace(TRUE, height_m=0.2, tilt_rad=math.radians(-12.0))
    places = (
        Pose2(0.3, 0.2, 1.1),
        Pose2(-0.5, -0.2, 2.3),
        Pose2(0.2, -0.3, -0.6),
        Pose2(-0.2, 0.1, -2.2),
        Pose2(0.6, 0.2, 2.9),
    )
    shown = render(field, camera, places, 9, margin_m=0.4)
    start = replace(camera, focal_px=(0.93 * camera.focal_px[0], 0.93 * camera.focal_px[1]))
    assert_is_true(calibrate_forward(field, shown, start), camera)


@pytest.mark.parametrize(
    ("start", "ways"),
    [
        (TRUE, "; without a goal rough poses of the images (--poses) may do"),
        pytest.param(
            None,
            "; without a goal a start with its tilt_rad (--start), or rough poses of the images (--poses) may do",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_would_do_is_said_where_nothing_is_in_view(start, ways, spl):
    """The case without a start alone finds wrong advice to who gave none."""
    result = calibrate_forward(spl, [np.full((240, 320, 3), (50, 130, 45), np.uint8)], start)
    assert isinstance(result, NotCalibrated)
    assert result.reason == f"no goal is found in any of the images, whatever the focal length may be{ways}"
