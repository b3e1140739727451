"""Edges and ridges measured in pictures whose edges are known."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.goal.edges import EdgeOffsets, EdgeStarts, measure_edges
from robocup_vision.kernels.goal.marks import measure_ridges

CYAN, GREY = np.array([215.0, 185.0, 35.0]), np.array([90.0, 90.0, 90.0])
TOWARDS = (CYAN - CYAN.mean()) / np.linalg.norm(CYAN - CYAN.mean())


def half_plane(angle_rad, at, inside, outside, size=48):
    """Anti-aliased picture: `inside` where u cos + v sin < at."""
    v, u = np.mgrid[: size * 4, : size * 4]
    u, v = (u - 1.5) / 4, (v - 1.5) / 4
    fraction = (u * math.cos(angle_rad) + v * math.sin(angle_rad) < at).astype(np.float64)
    fraction = cv2.resize(fraction, (size, size), interpolation=cv2.INTER_AREA)
    fraction = cv2.GaussianBlur(fraction, (0, 0), 0.6)[..., None]
    return np.rint(inside * fraction + outside * (1 - fraction)).astype(np.uint8)


def edges(image, starts, normal, grey=0.0, glare=300.0, reach=4.0):
    n = len(starts)
    found = EdgeOffsets(np.empty(n), np.empty(n), np.empty(n))
    where = EdgeStarts(
        np.array(starts, float), np.tile(np.array(normal, float), (n, 1)), np.full(n, reach), np.full(n, 3.0),
        np.tile(TOWARDS, (n, 1)), np.full(n, grey),
    )  # fmt: skip
    measure_edges(image, where, glare, found)
    return found


@given(st.floats(-math.pi, math.pi), st.floats(-2.0, 2.0), st.sampled_from([0.0, 1.0]))
def test_edge_lies_where_it_was_drawn(angle, shift, grey):
    middle = 23.5
    normal = np.array([math.cos(angle), math.sin(angle)])
    at = middle * normal.sum() + shift
    offset, _, sigma = edges(half_plane(angle, at, CYAN, GREY), [(middle, middle)], normal, grey)
    assert offset[0] == pytest.approx(shift, abs=0.25)  # drawn to a quarter of a pixel
    assert 0 < sigma[0] < 0.5


def test_no_edge_without_a_step_or_with_the_wrong_sign():
    flat = np.full((48, 48, 3), 90, np.uint8)
    turned = half_plane(0.0, 23.5, GREY, CYAN)
    for image in (flat, turned):
        offset, _, _ = edges(image, [(23.5, 23.5)], (1.0, 0.0))
        assert np.isnan(offset).all()


def test_no_edge_outside_the_image():
    offset, _, _ = edges(half_plane(0.0, 2.0, CYAN, GREY), [(2.0, 20.0)], (1.0, 0.0))
    assert np.isnan(offset).all()


def test_glare_is_named():
    image = half_plane(0.0, 23.5, np.array([255.0, 252.0, 245.0]), np.array([40.0, 130.0, 200.0]))
    offset, contrast, _ = edges(image, [(23.5, 23.5)], (1.0, 0.0), glare=235.0)
    assert np.isnan(offset).all()
    assert contrast[0] == -1.0


def test_grey_clutter_beside_paint_does_not_pull():
    image = half_plane(0.0, 23.5, CYAN, GREY)
    image[:, 26:] = np.minimum(image[:, 26:].astype(int) + 120, 255).astype(np.uint8)
    offset, _, _ = edges(image, [(23.5, 20.0)], (1.0, 0.0))
    assert offset[0] == pytest.approx(0.0, abs=0.25)


@given(st.floats(-4.0, 4.0), st.floats(1.5, 9.0))
def test_ridge_lies_where_it_was_drawn(shift, width):
    v = np.mgrid[:240, :240][0] / 4.0 - 0.375
    fraction = (np.abs(v - 30 - shift) < width / 2).astype(np.float64)
    fraction = cv2.GaussianBlur(cv2.resize(fraction, (60, 60), interpolation=cv2.INTER_AREA), (0, 0), 0.5)[..., None]
    paint, carpet = np.array([220.0, 225, 220]), np.array([50.0, 130, 45])
    image = np.rint(paint * fraction + carpet * (1 - fraction)).astype(np.uint8)
    offset, contrast = np.empty(1), np.empty(1)
    start, normal = np.array([[30.0, 30.0]]), np.array([[0.0, 1.0]])
    measure_ridges(image, start, normal, np.array([8.0]), np.array([width]), 0.0, offset, contrast)
    assert offset[0] == pytest.approx(shift, abs=0.25)
    assert contrast[0] > 20


def test_ridge_needs_green_on_both_sides():
    image = np.full((60, 60, 3), (50, 130, 45), np.uint8)
    image[28:32] = 220
    image[32:] = 60
    offset, contrast = np.empty(1), np.empty(1)
    start, normal = np.array([[30.0, 30.0]]), np.array([[0.0, 1.0]])
    measure_ridges(image, start, normal, np.array([8.0]), np.array([4.0]), 0.0, offset, contrast)
    assert np.isnan(offset[0])
