"""Edges, ridges, marks, shine and colours of a goal measured in pictures whose edges are known."""

import math

import cv2
import numpy as np
import pytest
from goal_samples import VIEW, floor_px
from hypothesis import given
from hypothesis import strategies as st
from strategies import PAPER_MIRROR

from robocup_vision.arrays import read_only
from robocup_vision.camera import OmniCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.goal.colors import MirrorProjection, vote_goal_colors
from robocup_vision.kernels.goal.edges import EdgeOffsets, EdgeStarts, measure_edges
from robocup_vision.kernels.goal.marks import MarkLimits, MarkPlaces, line_marks, measure_ridges
from robocup_vision.kernels.goal.paint.shine import fill_shine

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
    measure_ridges(image, start, normal, 8.0, np.array([width]), 0.0, offset, contrast)
    assert offset[0] == pytest.approx(shift, abs=0.25)
    assert contrast[0] > 20


def test_ridge_needs_green_on_both_sides():
    image = np.full((60, 60, 3), (50, 130, 45), np.uint8)
    image[28:32] = 220
    image[32:] = 60
    offset, contrast = np.empty(1), np.empty(1)
    start, normal = np.array([[30.0, 30.0]]), np.array([[0.0, 1.0]])
    measure_ridges(image, start, normal, 8.0, np.array([4.0]), 0.0, offset, contrast)
    assert np.isnan(offset[0])


VIEW_ARRAY = np.array([384.0, 380.0, 207.5, 159.5])
ALONG = np.arange(-1.5, 1.5, 0.02)
POINTS = np.column_stack([np.full(len(ALONG), 2.0), ALONG])


def places(p, spacing=6.0, least=0.2):
    points = POINTS
    room = len(points)
    marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    along = np.tile([0.0, 1.0], (room, 1))
    size = (416, 320)
    limits = MarkLimits(0.05, spacing, least)
    n = line_marks(points, along, VIEW_ARRAY, p, size, limits, MarkPlaces(marks, pixels, normals, widths))
    return marks[:n], pixels[:n], normals[:n], widths[:n]


def test_places_lie_where_paint_is_projected_across_it_and_as_wide():
    p = np.array([0.1, -0.2, 0.15, -0.1, 0.05, 0.3, 0.04, 0.0])
    marks, pixels, normals, widths = places(p)
    assert len(marks) > 20
    np.testing.assert_allclose(pixels, floor_px(VIEW, p, marks), atol=1e-6)
    far, near = (floor_px(VIEW, p, marks + np.array([side * 0.025, 0.0])) for side in (1, -1))
    np.testing.assert_allclose(widths, np.abs(((far - near) * normals).sum(axis=1)), rtol=1e-3)
    along = floor_px(VIEW, p, marks + np.array([0.0, 1e-5])) - pixels
    np.testing.assert_allclose((along * normals).sum(axis=1), 0.0, atol=1e-8)


def test_thin_and_hidden_lines_are_left_out():
    p = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0])
    assert len(places(p)[0]) > 20
    assert len(places(p, least=3.0)[0]) == 0
    turned = p.copy()
    turned[2] = np.pi  # looks away
    assert len(places(turned)[0]) == 0


def test_a_line_too_faint_for_one_place_is_seen_over_a_stretch():
    rng = np.random.default_rng(3)
    picture = np.full((60, 400, 3), (50.0, 130.0, 45.0))
    picture[30] += 9.0
    frame = np.clip(np.rint(picture + rng.normal(0, 3, picture.shape)), 0, 255).astype(np.uint8)
    start = np.column_stack([np.arange(20.0, 380.0, 8.0), np.full(45, 30.0)])
    normal, width = np.tile([0.0, 1.0], (45, 1)), np.full(45, 0.2)
    off = {}
    for along_px in (0.0, 6.0):
        offset, contrast = np.empty(45), np.empty(45)
        measure_ridges(frame, start, normal, 2.0, width, along_px, offset, contrast)
        off[along_px] = offset[np.isfinite(offset)]
    assert len(off[6.0]) > 30
    assert len(off[6.0]) > len(off[0.0])
    assert off[6.0].std() < off[0.0].std()


MIN = 170


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("longest", [1, 4, 9])
def test_fills_what_a_closing_fills_where_it_is_bright(upright, longest):
    rng = np.random.default_rng(5)
    mask = np.where(rng.random((40, 50)) < 0.1, 255, 0).astype(np.uint8)
    image = rng.integers(120, 256, (40, 50, 3)).astype(np.uint8)
    framed = cv2.copyMakeBorder(mask, 10, 10, 10, 10, cv2.BORDER_CONSTANT, value=0)
    size = np.ones((longest + 1, 1) if upright else (1, longest + 1), np.uint8)
    spread = cv2.dilate(framed, size, anchor=(0, 0))
    closed = cv2.erode(spread, size, anchor=(size.shape[1] - 1, size.shape[0] - 1))[10:-10, 10:-10]
    expected = mask | np.where((image >= MIN).all(axis=-1), closed, 0).astype(np.uint8)
    changed = fill_shine(mask, image, MIN, longest, upright)
    assert changed
    assert np.array_equal(mask, expected)


def test_fills_nothing_between_paint_and_the_end_of_the_picture():
    mask = np.zeros((10, 12), np.uint8)
    mask[5, 6] = 255
    image = np.full((10, 12, 3), 255, np.uint8)
    assert not any(fill_shine(mask, image, MIN, 9, upright) for upright in (False, True))
    assert np.count_nonzero(mask) == 1


NO_MASK = np.empty((0, 0), dtype=np.uint8)
HUES = read_only([-0.4, 0.5, 0.0])  # yellow, blue, white
# log R/G and B/G of yellow, blue, both with red and blue swapped, and white
LOG_RATIOS = read_only([[0.1, -1.8], [-0.8, 0.9], [-1.8, 0.1], [0.9, -0.8], [0.0, 0.0]])
Q_STEP = 0.002
TABLE = np.nan_to_num(PAPER_MIRROR.radius_px(np.arange(5000) * Q_STEP))


def vote(frame, pose, points, sides, camera, hidden=NO_MASK):
    to_camera = np.ascontiguousarray(camera.camera_to_robot.T)
    projection = MirrorProjection(
        np.array(camera.viewpoint_m), to_camera, camera.center_px, camera.heading_rad, camera.mirrored,
        camera.usable_radius_px, Q_STEP, TABLE,
    )  # fmt: skip
    return vote_goal_colors(frame, tuple(pose.array), points, sides, plain(projection), (HUES, LOG_RATIOS), hidden)


@pytest.mark.parametrize(
    ("color", "expected", "order"),
    [
        ((35, 205, 225), (1, 0), (1, 0)),
        ((190, 80, 35), (0, 1), (1, 0)),
        ((230,) * 3, (0, 0), (0, 0)),
        ((225, 205, 35), (0, 1), (0, 1)),
        ((35, 80, 190), (1, 0), (0, 1)),
    ],
)
def test_a_painted_frame_votes_for_its_colour(color, expected, order):
    frame = np.full((220, 256, 3), color, dtype=np.uint8)
    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
    points, sides = np.array([[1.5, 0.1, 0.1]]), np.array([1.0])
    assert vote(frame, Pose2(0.4, 0.0, 0.3), points, sides, camera) == expected + order
    # the half turn sees the other goal there
    assert vote(frame, Pose2(0.4, 0.0, 0.3), points, -sides, camera) == expected[::-1] + order


def test_a_point_straight_above_the_mirror_is_not_looked_at():
    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
    frame = np.zeros((220, 256, 3), dtype=np.uint8)
    assert vote(frame, Pose2(0.0, 0.0, 0.0), np.zeros((1, 3)), np.ones(1), camera) == (0, 0, 0, 0)
