"""Bright bands between carpets: where they lie and how wide they are, whatever a line's width should be."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import FisheyeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.bands import MAX_WIDTHS, LineLook, line_bands, line_points
from robocup_vision.kernels.model_edges.carpet import carpet_look
from robocup_vision.localization.line_map import LineMap
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene

CARPET = np.array([45.0, 125.0, 42.0, 1.0, 0.8])
GLARE = np.array([135.0, 187.0, 142.0])
LIT = np.array([*CARPET, *GLARE])
STEP, WIDEST, STRIDE = 60.0, 30, 8


def found(image, carpet=CARPET, widest=WIDEST):
    bands = np.zeros((400, 4))
    return bands[: line_bands(image, carpet, STEP, widest, STRIDE, bands)]


def lawn(height=96, width=128):
    return np.tile(CARPET[:3], (height, width, 1))


@pytest.mark.parametrize("width", [4.0, 5.5, 17.0])
def test_a_blurred_stripe_is_as_wide_as_it_was_painted(width):
    across = np.clip((width / 2 + 1.5 - np.abs(np.arange(128) - 60.3)) / 3.0, 0.0, 1.0)[None, :, None]
    image = (lawn() + across * (235.0 - lawn())).astype(np.uint8)
    bands = found(image)
    assert len(bands) == 96 // STRIDE
    np.testing.assert_allclose(bands[:, 0], 60.3, atol=0.3)
    np.testing.assert_allclose(bands[:, 3], width, atol=0.6)


def test_what_has_no_carpet_on_one_side_and_what_is_too_wide_are_no_bands():
    beside_a_wall = lawn()
    beside_a_wall[:, 60:66], beside_a_wall[:, 66:] = 235.0, 90.0
    assert not len(found(beside_a_wall.astype(np.uint8)))
    stripe = lawn()
    stripe[:, 50:70] = 235.0
    assert len(found(stripe.astype(np.uint8)))
    assert not len(found(stripe.astype(np.uint8), widest=15))


def test_a_sunny_patch_of_carpet_is_no_band():
    image = lawn()
    image[:, 50:60] = GLARE
    assert not len(found(image.astype(np.uint8), LIT))
    image[:, 50:60] = 235.0
    assert len(found(image.astype(np.uint8), LIT))


@pytest.mark.parametrize("pose", [Pose2(4.0, 2.0, 0.6), Pose2(0.5, 0.4, 2.4), Pose2(-6.5, -3.5, -2.0)])
def test_a_fisheye_s_line_points_lie_on_lines_near_and_far(pose):
    field, height_m, tilt_rad = load_field("msl_18x12"), 0.8, -0.2
    camera = FisheyeCamera((304, 400), (165.0, 165.0), (151.5, 199.5), height_m, tilt_rad=tilt_rad)
    frame = np.clip(render_pinhole(camera, Scene(field), pose, supersample=2), 0, 255).astype(np.uint8)
    held, carpet, points = np.zeros(7), np.zeros(5), np.zeros((600, 3))
    held[3], held[5] = tilt_rad, height_m
    carpet_look(frame, 160, carpet)
    look = LineLook(STEP, field.line_width_m, MAX_WIDTHS, STRIDE)
    count = line_points(frame, lens_table(camera), held, carpet, look, points)
    floor = camera.pixel_to_floor(points[:count, :2])
    range_m = np.hypot(*floor.T)
    # a pixel of a far line is longer than the line is wide
    slack_m = field.line_width_m / 2 + range_m**2 / height_m / 165.0
    off_m = LineMap(field).nearest(pose.transform(floor)).distance_m
    assert np.mean(off_m < slack_m) > 0.95
    assert count > 25
    assert np.percentile(range_m, 10) < 3.0
