"""Drawn field lines against the plain NumPy picture of floor points and the paint there is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.lines.drawing import draw_lines
from robocup_vision.localization.goal.geometry import IdealView, project

VIEW = IdealView((384.0, 384.0), (103.5, 79.5))
VIEW_ARRAY = np.array([384.0, 384.0, 103.5, 79.5])
ACROSS = np.column_stack([np.full(201, 2.0), np.linspace(-0.2, 0.2, 201)])


def drawn(p, points=ACROSS, width_m=0.02, first_row=0, blur_px=0.75):
    picture = np.empty((160 - first_row, 208), np.float32)
    draw_lines(points, 0.01, VIEW_ARRAY, p, width_m, blur_px, first_row, picture)
    return picture


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
    twice = drawn(far, np.vstack([ACROSS, ACROSS[::-1] + np.array([0.02, 0.0])]))
    assert twice.sum() == pytest.approx(2 * drawn(far).sum(), rel=0.05)


def test_rows_above_the_first_are_left_out_and_nothing_is_seen_behind():
    p = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.3, 0.0, 0.0])
    np.testing.assert_allclose(drawn(p, first_row=60), drawn(p)[60:], atol=1e-6)
    p[2] = np.pi
    assert not drawn(p).any()
    gap = np.vstack([ACROSS[:50], ACROSS[150:]])
    p[2] = 0.0
    assert drawn(p, gap).sum() == pytest.approx(0.5 * drawn(p).sum(), rel=0.03)
