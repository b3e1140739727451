"""Compiled edge, ridge and run measurement against pictures whose edges are known, and against plain Python."""

import math

import cv2
import numpy as np
import pytest
from goal_twins import silhouette_lines
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.goal.edges import (
    EdgeOffsets,
    EdgePlaces,
    EdgeStarts,
    goal_points,
    link_runs,
    measure_edges,
    sample,
    spread_samples,
)
from robocup_vision.kernels.goal.marks import measure_ridges
from robocup_vision.localization.goal.edges import edge_segments, goal_scene
from robocup_vision.localization.goal.geometry import IdealView, foot_points, goal_shape, project

SHAPE = goal_shape(load_field("four_legged_2007"))

CYAN, GREY = np.array([215.0, 185.0, 35.0]), np.array([90.0, 90.0, 90.0])
TOWARDS = (CYAN - CYAN.mean()) / np.linalg.norm(CYAN - CYAN.mean())


def half_plane(angle_rad, at, inside, outside, size=48):
    """Anti-aliased picture: `inside` where u cos + v sin < at."""
    v, u = np.mgrid[: size * 4, : size * 4]
    u, v = (u - 1.5) / 4, (v - 1.5) / 4
    share = (u * math.cos(angle_rad) + v * math.sin(angle_rad) < at).astype(np.float64)
    share = cv2.resize(share, (size, size), interpolation=cv2.INTER_AREA)
    share = cv2.GaussianBlur(share, (0, 0), 0.6)[..., None]
    return np.rint(inside * share + outside * (1 - share)).astype(np.uint8)


def edges(image, starts, normal, grey=0.0, glare=300.0, reach=4.0):
    n = len(starts)
    found = EdgeOffsets(np.empty(n), np.empty(n), np.empty(n))
    where = EdgeStarts(
        np.array(starts, float), np.tile(np.array(normal, float), (n, 1)), np.full(n, reach), np.full(n, 3.0),
        np.tile(TOWARDS, (n, 1)), np.full(n, grey),
    )  # fmt: skip
    measure_edges(image, where, glare, found)
    return found


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_a_sample_is_the_weighted_mean_of_four_pixels(seed):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (7, 9, 3), dtype=np.uint8)
    u, v, channel = rng.uniform(0, 8), rng.uniform(0, 6), int(rng.integers(3))
    rows, columns = np.arange(7), np.arange(9)
    weight = np.outer(np.maximum(0, 1 - np.abs(rows - v)), np.maximum(0, 1 - np.abs(columns - u)))
    assert sample(image, u, v, channel) == pytest.approx((weight * image[..., channel]).sum())


@settings(deadline=None, max_examples=40)
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


@settings(deadline=None, max_examples=30)
@given(st.floats(-4.0, 4.0), st.floats(1.5, 9.0))
def test_ridge_lies_where_it_was_drawn(shift, width):
    v = np.mgrid[:240, :240][0] / 4.0 - 0.375
    share = (np.abs(v - 30 - shift) < width / 2).astype(np.float64)
    share = cv2.GaussianBlur(cv2.resize(share, (60, 60), interpolation=cv2.INTER_AREA), (0, 0), 0.5)[..., None]
    image = np.rint(np.array([220.0, 225, 220]) * share + np.array([50.0, 130, 45]) * (1 - share)).astype(np.uint8)
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


def plain_chains(row, left, right, lean, max_gap):
    """Do what link_runs does, with every earlier chain looked at each time."""
    ends, chain = [], []
    for n in range(len(row)):
        scores = []
        for k, m in enumerate(ends):
            gap = row[n] - row[m]
            off = max(abs(left[n] - left[m]), abs(right[n] - right[m]))
            if 0 < gap <= max_gap and off <= 1.0 + lean * gap:
                scores.append((off + 0.5 * gap, k))
        k = min(scores)[1] if scores else len(ends)
        if k == len(ends):
            ends.append(n)
        ends[k] = n
        chain.append(k)
    return chain


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_chains_agree_with_plain_python(seed):
    rng = np.random.default_rng(seed)
    row = np.sort(rng.integers(0, 12, 60)).astype(np.float64) * 4
    left = rng.integers(0, 15, 60) * 3.0 + rng.uniform(-1, 1, 60)
    right = left + 6 + rng.uniform(-1, 1, 60)
    chain = np.empty(60, np.int64)
    count = link_runs(row, left, right, 0.27, 16.0, chain)
    expected = plain_chains(row, left, right, 0.27, 16.0)
    assert chain.tolist() == expected
    assert count == max(expected) + 1


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_places_to_measure_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-2.0, 1.8), rng.uniform(-1.2, 1.2)
    p = np.array([x, y, math.atan2(-y, SHAPE.line_x_m - x), *rng.uniform(-0.1, 0.1, 2), 0.185, 0.0, 0.0])
    view = IdealView((384.0, 380.0), (207.5, 159.5))
    offsets = np.array([-0.6, 0.0, 0.6])
    points = np.empty((24, 2))
    assert goal_points(goal_scene(SHAPE, view)._replace(offsets=offsets), p, points)
    feet = foot_points(SHAPE, p, offsets).reshape(-1, 3)
    above = feet + np.array([0, 0, 0.5 * SHAPE.radius_m])
    expected = project(view, p, np.concatenate([edge_segments(SHAPE, p).reshape(-1, 3), feet, above]))
    np.testing.assert_allclose(points, expected, atol=1e-6)

    room = 6 * 10 + 6
    starts, normals, inside = np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    edge, expected_count = np.empty(room, np.int64), np.empty(6, np.int64)
    places = EdgePlaces(starts, normals, edge, inside, expected_count)
    count = spread_samples(points, 6, (416, 320), 2.0, 10, places)
    assert count == expected_count.sum() + 6
    np.testing.assert_allclose(np.linalg.norm(normals[:count], axis=1), 1)
    assert (np.bincount(edge[:count], minlength=7)[:6] == expected_count).all()
    lines = silhouette_lines(SHAPE, view, p)
    for n in range(count - 6):
        e = edge[n]
        assert lines[e] @ np.append(starts[n], 1.0) == pytest.approx(0.0, abs=1e-6)
        # the normal points out, and the places inside the object
        assert lines[e] @ np.append(starts[n] + normals[n], 1.0) > 0.5
    np.testing.assert_allclose(starts[count - 6 : count], points[12:18])


def test_nothing_is_measured_behind_the_camera():
    p = np.array([0.0, 0.0, math.pi, 0.0, 0.0, 0.185, 0.0, 0.0])
    scene = goal_scene(SHAPE, IdealView((384.0, 380.0), (207.5, 159.5)))
    assert not goal_points(scene._replace(offsets=np.zeros(1)), p, np.empty((16, 2)))
