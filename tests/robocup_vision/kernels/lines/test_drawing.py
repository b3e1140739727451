"""Drawn field lines against the plain NumPy picture of floor points and the paint there is."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, draw_lines, move_drawings, stroke_table
from robocup_vision.kernels.lines.drawn_light import AROUND, LitCarpet, compare_drawing, compare_each_line, light_carpet
from robocup_vision.localization.goal.geometry import IdealView, project

VIEW = IdealView((384.0, 384.0), (103.5, 79.5))
VIEW_ARRAY = np.array([384.0, 384.0, 103.5, 79.5])
ACROSS = np.column_stack([np.full(201, 2.0), np.linspace(-0.2, 0.2, 201)])


STROKES = stroke_table(0.75)


def pen(*lines, width_m=0.02):
    starts = np.cumsum([0, *(len(line) for line in lines)])
    return LinePen(np.ascontiguousarray(np.vstack(lines)), starts, width_m, STROKES)


def whole_drawing(p, pen, first_row=0, lines=None):
    drawing = np.zeros((160 - first_row + 2 * MARGIN, 208 + 2 * MARGIN), np.float32)
    first, last = lines or (0, len(pen.starts) - 1)
    top, left, bottom, right = draw_lines(pen, first, last, VIEW_ARRAY, p, first_row, drawing)
    drawing.setflags(write=False)
    painted = drawing.copy()
    painted[top:bottom, left:right] = 0.0
    assert not painted.any()
    return drawing


def drawn(p, *lines, width_m=0.02, first_row=0):
    picture = whole_drawing(p, pen(*(lines or (ACROSS,)), width_m=width_m), first_row)
    return picture[MARGIN:-MARGIN, MARGIN:-MARGIN]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_paint_lies_where_numpy_projects_it_and_none_is_lost(seed):
    rng = np.random.default_rng(seed)
    p = np.array([*rng.uniform(-0.3, 0.3, 2), *rng.uniform(-0.05, 0.05, 2), rng.uniform(-0.05, 0.05), 0.3, 0.0, 0.0])
    p[3] -= 0.15
    picture = drawn(p)
    border = np.array([[x, y, 0.0] for x in (1.99, 2.01) for y in (-0.2, 0.2)])
    corners = project(VIEW, p, border)
    a, b, d, c = corners  # around the strip of paint: near left, near right, far left, far right
    around = np.array([a, b, c, d])
    area = 0.5 * abs(np.sum(around[:, 0] * np.roll(around[:, 1], -1) - around[:, 1] * np.roll(around[:, 0], -1)))
    # the tails of the blur are cut at two pixels and a half
    assert picture.sum() == pytest.approx(area, rel=0.03)
    v, u = np.indices(picture.shape)
    middle = np.array([(u * picture).sum(), (v * picture).sum()]) / picture.sum()
    np.testing.assert_allclose(middle, around.mean(axis=0), atol=0.15)


def test_wide_paint_is_paint_all_over_and_two_lines_add_up():
    p = np.array([1.6, 0.0, 0.0, -0.6, 0.0, 0.3, 0.0, 0.0])
    assert drawn(p, width_m=0.1).max() == pytest.approx(1.0, abs=0.1)
    far = np.array([-1.0, 0.0, 0.0, -0.1, 0.0, 0.3, 0.0, 0.0])
    twice = drawn(far, ACROSS, ACROSS[::-1] + np.array([0.02, 0.0]))
    assert twice.sum() == pytest.approx(2 * drawn(far).sum(), rel=0.05)


def test_rows_above_the_first_are_left_out_and_nothing_is_seen_behind():
    p = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.3, 0.0, 0.0])
    np.testing.assert_allclose(drawn(p, first_row=60), drawn(p)[60:], atol=1e-6)
    p[2] = np.pi
    assert not drawn(p).any()
    p[2] = 0.0
    assert drawn(p, ACROSS[:50], ACROSS[150:]).sum() == pytest.approx(0.5 * drawn(p).sum(), rel=0.03)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(MARGIN + 1, 40))
def test_light_over_the_carpet_nearby_is_that_of_opencv(seed, height):
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 256, (height, 50, 3)).astype(np.uint8)
    carpet = np.asarray(cv2.dilate(rng.random((height, 50)), np.ones((5, 5))) > 0.95, np.uint8)
    lit = LitCarpet(*(np.empty(carpet.shape, np.float32) for _ in range(3)))
    pixels, square = light_carpet(frame, carpet, 40.0, lit)
    on = carpet.astype(np.float32)
    nearby = np.maximum(cv2.blur(on, (AROUND, AROUND)), 1e-3)
    light = np.minimum(frame[..., 0], frame[..., 2]).astype(np.float32)
    over = np.clip((light - cv2.blur(light * on, (AROUND, AROUND)) / nearby) * on, -40.0, 40.0)
    np.testing.assert_array_equal(lit.on, on)
    np.testing.assert_allclose(lit.share, 1.0 / (AROUND**2 * nearby), rtol=1e-5)
    np.testing.assert_allclose(lit.light, over, atol=1e-3)
    assert (pixels, square) == (np.count_nonzero(carpet), pytest.approx(np.sum(over.astype(np.float64) ** 2), rel=1e-4))


def lit_carpet(rng, height, width=208):
    on = np.asarray(cv2.dilate(rng.random((height, width)), np.ones((15, 15))) > 0.99, np.float32)
    nearby = np.maximum(cv2.blur(on, (AROUND, AROUND)), np.float32(1e-3))
    light = np.asarray(rng.normal(0, 10, on.shape) * on, np.float32)
    return LitCarpet(on, np.float32(AROUND**-2) / nearby, light)


def plain_levels(carpet, picture):
    mean = cv2.blur(picture * carpet.on, (AROUND, AROUND)) * AROUND**2 * carpet.share
    return np.asarray((picture - mean) * carpet.on, np.float64)


def camera(rng):
    p = np.array([*rng.uniform(-0.5, 1.0, 2), *rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.1, 0.1), 0.3, 0.0, 0.0])
    p[3] -= 0.2
    return p


ALONG = np.column_stack([np.linspace(0.8, 3.0, 101), np.full(101, 0.1)])
LINES = (ACROSS, ALONG, ACROSS + np.array([0.7, 0.1]))


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 60, 150]))
def test_drawings_are_compared_with_the_light_as_numpy_and_opencv_do(seed, first_row):
    rng = np.random.default_rng(seed)
    carpet, p, lines = lit_carpet(rng, 160 - first_row), camera(rng), pen(*LINES)
    whole = whole_drawing(p, lines, first_row)[MARGIN:-MARGIN, MARGIN:-MARGIN]
    levels = plain_levels(carpet, whole)
    drawing = np.zeros((160 - first_row + 2 * MARGIN, 208 + 2 * MARGIN), np.float32)
    own, both = compare_drawing(carpet, lines, VIEW_ARRAY, p, first_row, drawing)
    assert not drawing.any()
    scale = max(np.sum(levels**2), 1e-3)
    assert own == pytest.approx(np.sum(levels**2), abs=1e-4 * scale)
    assert both == pytest.approx(np.sum(levels * carpet.light), abs=1e-3 * scale * 10)

    sums = np.empty((2, len(LINES)))
    compare_each_line(carpet, lines, VIEW_ARRAY, p, first_row, drawing, sums)
    assert not drawing.any()
    for line in range(len(LINES)):
        single = whole_drawing(p, lines, first_row, (line, line + 1))[MARGIN:-MARGIN, MARGIN:-MARGIN]
        mine = single > 0.5 * whole
        assert sums[0, line] == pytest.approx(np.sum(levels[mine] ** 2), abs=1e-4 * scale)
        assert sums[1, line] == pytest.approx(np.sum((levels * carpet.light)[mine]), abs=1e-3 * scale * 10)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 60]))
def test_what_moves_between_two_drawings_is_summed_as_numpy_does(seed, first_row):
    rng = np.random.default_rng(seed)
    lines, first = pen(*LINES), camera(rng)
    cameras = first + rng.normal(0, 0.01, (4, 8)) * (np.arange(8) < 5)
    drawings = np.zeros((4, 160 - first_row + 2 * MARGIN, 208 + 2 * MARGIN), np.float32)
    products = np.empty((2, 2))
    steepness = move_drawings(lines, VIEW_ARRAY, cameras, first_row, drawings, products)
    plain = np.array([whole_drawing(p, lines, first_row)[MARGIN:-MARGIN, MARGIN:-MARGIN] for p in cameras], np.float64)
    down, right = np.diff(plain[0], axis=0), np.diff(plain[0], axis=1)
    assert steepness == pytest.approx(np.sum(down**2) + np.sum(right**2), rel=1e-4, abs=1e-9)
    moved = (plain[1::2] - plain[::2]).reshape(2, -1)
    np.testing.assert_allclose(products, moved @ moved.T, rtol=1e-3, atol=1e-4 * max(steepness, 1e-6))
