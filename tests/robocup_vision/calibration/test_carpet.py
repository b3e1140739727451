"""The ground before a robot is a carpet where most of it is green, wherever else the picture is."""

import dataclasses

import numpy as np
import pytest

from robocup_vision.calibration.check import shows_carpet
from robocup_vision.vision import Vision

GREEN, BROWN, GREY, DARK = (50, 130, 45), (60, 90, 120), (90, 90, 90), (3, 9, 4)


@pytest.fixture(scope="module")
def vision(ssl_field, true_camera):
    return Vision(ssl_field, true_camera)


@pytest.mark.parametrize(
    ("near", "far", "is_carpet"),
    [(GREEN, BROWN, True), (BROWN, GREEN, False), (GREY, GREEN, False), (DARK, GREEN, None)],
)
def test_what_counts_is_the_ground_nearest_to_the_robot(vision, near, far, is_carpet):
    camera = vision.camera
    width, height = camera.size_px
    v, u = np.mgrid[:height, :width]
    inner, outer = camera.usable_radius_px
    is_near = np.hypot(u - camera.center_px[0], v - camera.center_px[1]) < inner + (outer - inner) / 2.5
    frame = np.where(is_near[..., None], np.array(near), np.array(far)).astype(np.uint8)
    assert shows_carpet(vision.look(frame), frame) is is_carpet


@pytest.mark.parametrize(("below", "is_carpet"), [(GREEN, True), (BROWN, False)])
def test_without_floor_samples_it_is_the_lower_third_of_the_picture(vision, below, is_carpet):
    width, height = vision.camera.size_px
    frame = np.full((height, width, 3), BROWN if is_carpet else GREEN, dtype=np.uint8)
    view = dataclasses.replace(vision.look(frame), polar=None)
    frame[2 * height // 3 :] = below
    assert shows_carpet(view, frame) is is_carpet
