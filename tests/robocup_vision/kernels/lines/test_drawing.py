"""Drawn field lines lie where a plain projection puts the paint, and lose none of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, draw_lines, stroke_table
from robocup_vision.localization.goal.geometry import IdealView, project

VIEW = IdealView((384.0, 384.0), (103.5, 79.5))
VIEW_ARRAY = np.array([384.0, 384.0, 103.5, 79.5])
ACROSS = np.column_stack([np.full(201, 2.0), np.linspace(-0.2, 0.2, 201)])


STROKES = stroke_table(0.75)


def pen(*lines, width_m=0.02):
    starts = np.cumsum([0, *(len(line) for line in lines)])
    return LinePen(np.ascontiguousarray(np.vstack(lines)), starts, width_m, STROKES)


def whole_drawing(p, pen, first_row=0):
    drawing = np.zeros((160 - first_row + 2 * MARGIN, 208 + 2 * MARGIN), np.float32)
    top, bottom = draw_lines(pen, VIEW_ARRAY, p, first_row, drawing)
    drawing.setflags(write=False)
    painted = drawing.copy()
    painted[top:bottom] = 0.0
    assert not painted.any()
    return drawing


def drawn(p, *lines, width_m=0.02, first_row=0):
    picture = whole_drawing(p, pen(*(lines or (ACROSS,)), width_m=width_m), first_row)
    return picture[MARGIN:-MARGIN, MARGIN:-MARGIN]


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
