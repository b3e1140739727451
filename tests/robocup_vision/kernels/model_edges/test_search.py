"""Search along normals on painted pictures: where edges are found."""

import math

import cv2
import numpy as np
import pytest

from robocup_vision.arrays import read_only
from robocup_vision.kernels.model_edges.carpet import carpet_look
from robocup_vision.kernels.model_edges.search import search
from robocup_vision.kernels.model_edges.tables import EDGE, RIDGE, empty_buffers
from robocup_vision.localization.model_edges.settings import EdgeSettings

CARPET, WHITE = np.array([45.0, 125.0, 42.0]), np.array([230.0, 230.0, 230.0])
CHANNELS = read_only([[1.0, 0.0, 1.0, 365.0, 0.0, 0.0, 0.0, 230.0]])
NUMBERS = EdgeSettings().for_width(208, 0.025)


def stripe(angle_rad, offset_px, width_px, noise=2.0):
    """Paint a stripe whose middle line passes the picture's middle at an offset along its normal."""
    v, u = np.mgrid[: 160 * 4, : 208 * 4] / 4.0 - 0.375
    normal = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    away = (u - 100.0) * normal[0] + (v - 80.0) * normal[1] - offset_px
    picture = np.where(np.abs(away)[..., None] <= width_px / 2, WHITE, CARPET)
    small = cv2.GaussianBlur(picture.reshape(160, 4, 208, 4, 3).mean(axis=(1, 3)), (0, 0), 0.6)
    small += np.random.default_rng(1).normal(0.0, noise, small.shape)
    return np.clip(small, 0, 255).astype(np.uint8), normal


def look_at(frame, normal, kind, width_px, reach_px=8.0, at=(100.0, 80.0)):
    buffers = empty_buffers(4, 4)
    buffers.samples.uv[0], buffers.samples.normal[0] = at, normal
    buffers.samples.width_px[0], buffers.samples.expected[0] = width_px, 365.0
    buffers.samples.kind[0], buffers.reach_px[0] = kind, reach_px
    carpet = np.zeros(5)
    carpet_look(frame, 0, carpet)
    search(frame, CHANNELS, carpet, 1.0, NUMBERS, buffers, 1)
    return buffers.found


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 44.0, 90.0, 130.0, -60.0])
@pytest.mark.parametrize("offset_px", [-4.3, 0.0, 2.7])
def test_a_thin_line_is_found_where_it_is(angle_deg, offset_px):
    frame, normal = stripe(math.radians(angle_deg), offset_px, 2.0)
    found = look_at(frame, normal, RIDGE, 2.0)
    assert found.candidates[0] >= 1
    assert found.offset_px[0, 0] == pytest.approx(offset_px, abs=0.3)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 160.0])
def test_an_edge_is_found_with_its_paint_inside_only(angle_deg):
    frame, normal = stripe(math.radians(angle_deg), 0.0, 10.0)
    found = look_at(frame, normal, EDGE, 10.0)
    assert found.candidates[0] == 1
    assert found.offset_px[0, 0] == pytest.approx(-5.0, abs=0.3)
    found = look_at(frame, -normal, EDGE, 10.0)
    assert found.offset_px[0, 0] == pytest.approx(-5.0, abs=0.3)


@pytest.mark.parametrize("width_px", [2.2, 2.6, 3.1, 3.5, 4.2])
def test_the_foot_of_a_band_of_few_pixels_is_not_found_too_far_outside(width_px):
    offsets_px = np.arange(8) / 8.0
    errors_px = []
    for offset_px in offsets_px:
        frame, normal = stripe(math.pi / 2, offset_px, width_px)
        found = look_at(frame, normal, EDGE, width_px)
        errors_px.append(found.offset_px[0, 0] - (offset_px - width_px / 2))
    # the blur at the band's other end drew it off by up to 0.3
    assert abs(np.mean(errors_px)) < 0.12


@pytest.mark.parametrize("angle_deg", [0.0, 35.0, 90.0])
@pytest.mark.parametrize(("kind", "width_px"), [(RIDGE, 2.0), (EDGE, 10.0)])
def test_colours_that_chroma_subsampling_smears_beside_a_line_are_carpet(angle_deg, kind, width_px):
    frame, normal = stripe(math.radians(angle_deg), 0.0, width_px)
    light, *chroma = cv2.split(cv2.cvtColor(frame, cv2.COLOR_BGR2YCrCb))
    quarters = [cv2.resize(one, (104, 80), interpolation=cv2.INTER_AREA) for one in chroma]
    smeared = [cv2.resize(one, (208, 160), interpolation=cv2.INTER_LINEAR) for one in quarters]
    found = look_at(cv2.cvtColor(cv2.merge([light, *smeared]), cv2.COLOR_YCrCb2BGR), normal, kind, width_px)
    assert found.candidates[0] >= 1
    assert found.offset_px[0, 0] == pytest.approx(0.0 if kind == RIDGE else -width_px / 2, abs=0.4)


def test_a_stripe_that_has_no_carpet_on_one_side_is_no_line():
    frame, normal = stripe(0.0, 0.0, 2.0)
    assert look_at(frame, normal, RIDGE, 2.0).candidates[0] >= 1
    frame[:, 102:] = (110, 112, 115)
    assert look_at(frame, normal, RIDGE, 2.0).candidates[0] == 0


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 44.0, 90.0, 130.0, -60.0])
@pytest.mark.parametrize("shown_px", [6.0, 7.0])
def test_a_line_of_another_width_is_found_by_its_middle(angle_deg, shown_px):
    frame, normal = stripe(math.radians(angle_deg), 1.7, shown_px)
    found = look_at(frame, normal, RIDGE, 2.0)
    assert found.candidates[0] == 1
    assert found.offset_px[0, 0] == pytest.approx(1.7, abs=0.3)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 160.0])
def test_both_edges_of_a_blurred_line_are_found_half_its_known_width_from_its_middle(angle_deg):
    frame, normal = stripe(math.radians(angle_deg), 0.0, 10.0)
    frame = cv2.GaussianBlur(frame, (0, 0), 5.0)
    for side in (-1.0, 1.0):
        found = look_at(frame, side * normal, EDGE, 10.0)
        assert found.offset_px[0, 0] == pytest.approx(-5.0, abs=0.4)


def test_a_band_is_no_line_where_it_is_too_wide_or_has_carpet_on_one_side_only():
    frame, normal = stripe(0.0, 0.0, 16.0)
    assert look_at(frame, normal, RIDGE, 2.0).candidates[0] == 0
    frame, normal = stripe(0.0, 0.0, 6.0)
    frame[:, 105:] = (110, 112, 115)
    assert look_at(frame, normal, RIDGE, 2.0).candidates[0] == 0


def test_plain_carpet_shows_nothing_and_faint_steps_are_not_looked_for():
    frame, normal = stripe(0.3, 60.0, 2.0)
    assert look_at(frame, normal, RIDGE, 2.0).candidates[0] == 0
    assert look_at(frame, normal, RIDGE, 0.02).candidates[0] == -1
