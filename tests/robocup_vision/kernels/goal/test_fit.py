"""The compiled goal fit against the plain NumPy picture of a goal, and against a known answer."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.goal.fit import fit_goal, floor_residuals, goal_prediction, goal_residuals, robust_cost
from robocup_vision.localization.goal.geometry import IdealView, foot_points, goal_shape, project, silhouette_lines

SHAPE = goal_shape(load_field("four_legged_2007"))
SHAPE_ARRAY = np.array([SHAPE.line_x_m, SHAPE.width_m, SHAPE.height_m, SHAPE.radius_m])
VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
VIEW_ARRAY = np.array([384.0, 380.0, 207.5, 159.5])
OFFSETS = np.array([-0.7, 0.0, 0.7])
seeds = st.integers(0, 2**32 - 1)


def some_camera(rng):
    x, y = rng.uniform(-2.5, 1.8), rng.uniform(-1.2, 1.2)
    heading = np.arctan2(-y, SHAPE.line_x_m - x) + rng.uniform(-0.1, 0.1)
    return np.array(
        [x, y, heading, *rng.uniform(-0.1, 0.1, 2), 0.185, rng.uniform(-0.02, 0.02), rng.uniform(-0.5, 0.5)]
    )


def perfect_samples(p, per_edge=10):
    """Points on each predicted line, and the predicted feet."""
    lines = silhouette_lines(SHAPE, VIEW, p)
    corners = project(VIEW, p, SHAPE.corners)
    ends = [(0, 1), (0, 1), (3, 2), (3, 2), (1, 2), (1, 2)]
    edge, uv = [], []
    for e, (a, b) in enumerate(ends):
        for t in np.linspace(0.1, 0.9, per_edge):
            point = corners[a] + t * (corners[b] - corners[a])
            point = point - lines[e, :2] * (lines[e, :2] @ point + lines[e, 2])
            edge.append(e)
            uv.append(point)
    feet = project(VIEW, p, foot_points(SHAPE, p, OFFSETS).reshape(-1, 3))
    direction = np.tile([0.0, 1.0], (6, 1))
    # eight places on the goal line beside the posts
    marks = np.column_stack([np.full(8, SHAPE.line_x_m), np.linspace(-0.8, 0.8, 8)])
    return (
        np.array(edge),
        np.array(uv),
        np.repeat([0, 1], 3),
        np.tile([0, 1, 2], 2),
        feet + p[7] * direction,
        direction,
        marks,
        project(VIEW, p, np.column_stack([marks, np.zeros(8)])),
        np.tile([0.6, 0.8], (8, 1)),
    )


@settings(deadline=None, max_examples=50)
@given(seeds)
def test_prediction_agrees_with_numpy(seed):
    p = some_camera(np.random.default_rng(seed))
    lines, feet = np.empty((6, 3)), np.empty((2, 3, 2))
    goal_prediction(SHAPE_ARRAY, VIEW_ARRAY, p, OFFSETS, lines, feet)
    np.testing.assert_allclose(lines, silhouette_lines(SHAPE, VIEW, p), rtol=1e-9, atol=1e-7)
    expected = project(VIEW, p, foot_points(SHAPE, p, OFFSETS).reshape(-1, 3)).reshape(2, 3, 2)
    np.testing.assert_allclose(feet, expected, rtol=1e-9, atol=1e-7)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_residuals_of_perfect_samples_vanish_and_grow_by_the_offset(seed):
    p = some_camera(np.random.default_rng(seed))
    samples = perfect_samples(p)
    residual = np.empty(74)
    goal_residuals(SHAPE_ARRAY, VIEW_ARRAY, p, OFFSETS, *samples, residual)
    np.testing.assert_allclose(residual, 0, atol=1e-6)
    lines = silhouette_lines(SHAPE, VIEW, p)
    moved = (samples[0], samples[1] + 2.0 * lines[samples[0], :2], *samples[2:])
    goal_residuals(SHAPE_ARRAY, VIEW_ARRAY, p, OFFSETS, *moved, residual)
    np.testing.assert_allclose(residual[:60], 2.0, atol=1e-6)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_floor_marks_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    marks = p[:2] + rng.uniform(0.5, 3.0, (5, 1)) * [np.cos(p[2]), np.sin(p[2])] + rng.uniform(-0.3, 0.3, (5, 2))
    turn = rng.uniform(0, 2 * np.pi, 5)
    direction, uv = np.column_stack([np.cos(turn), np.sin(turn)]), rng.uniform(0, 400, (5, 2))
    residual = np.empty(5)
    floor_residuals(VIEW_ARRAY, p, marks, uv, direction, residual)
    expected = ((uv - project(VIEW, p, np.column_stack([marks, np.zeros(5)]))) * direction).sum(axis=1)
    np.testing.assert_allclose(residual, expected, rtol=1e-9, atol=1e-7)


def test_a_mark_behind_the_camera_is_no_number():
    p = np.array([0.0, 0, 0, 0, 0, 0.2, 0, 0])
    residual = np.zeros(1)
    floor_residuals(VIEW_ARRAY, p, np.array([[-1.0, 0.0]]), np.zeros((1, 2)), np.array([[1.0, 0.0]]), residual)
    assert np.isnan(residual[0])


def test_robust_cost_agrees_with_numpy():
    rng = np.random.default_rng(1)
    residual, sigma = rng.normal(size=20), rng.uniform(0.1, 1, 20)
    p, prior, weight = rng.normal(size=8), rng.normal(size=8), rng.uniform(0, 3, 8)
    weight[2] = np.inf  # held: says nothing
    free = np.isfinite(weight)
    expected = ((0.7 / sigma) ** 2 * np.log1p((residual / 0.7) ** 2)).sum()
    expected += (weight[free] * (p - prior)[free] ** 2).sum()
    assert robust_cost(residual, sigma, 0.7, p, prior, weight) == pytest.approx(expected)
    residual[3] = np.nan
    assert robust_cost(residual, sigma, 0.7, p, prior, weight) == np.inf


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_fit_comes_back_to_the_camera(seed):
    rng = np.random.default_rng(seed)
    truth = some_camera(rng)
    truth[6] = 0.0
    samples = perfect_samples(truth)
    # a tenth of the samples are elsewhere: the loss must not care
    uv = samples[1].copy()
    wrong = rng.choice(60, 6, replace=False)
    uv[wrong] += rng.uniform(-6, 6, (6, 2))
    start = truth + rng.normal(size=8) * [0.05, 0.05, 0.01, 0.01, 0.01, 0, 0, 0.1]
    held = start[5]
    prior = np.array([0, 0, 0, 0, 0, 0.185, 0, 0.0])
    weight = np.array([0, 0, 0, 0, 0, np.inf, np.inf, 1e-3])
    information = np.zeros((8, 8))
    p = start.copy()
    cost = fit_goal(
        SHAPE_ARRAY, VIEW_ARRAY, p, prior, weight, OFFSETS, samples[0], uv, *samples[2:], np.full(74, 0.1),
        np.array([4.0] * 8 + [1.0] * 8 + [0.2] * 12), information,
    )  # fmt: skip
    assert np.isfinite(cost)
    # wrong samples beside right ones pull a far camera farther: a centimetre a metre
    distance_m = math.hypot(truth[0] - SHAPE_ARRAY[0], truth[1])
    np.testing.assert_allclose(p[:2], truth[:2], atol=0.02 + 0.01 * distance_m)
    np.testing.assert_allclose(p[2:5], truth[2:5], atol=0.02)
    assert p[5] == held
    assert np.linalg.eigvalsh(information).min() > 0
