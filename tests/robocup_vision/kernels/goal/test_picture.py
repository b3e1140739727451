"""The picture of a goal and of the floor by a plain projection, and its derivatives by differences."""

import numpy as np
from goal_samples import OFFSETS, SCENE, SHAPE, VIEW, feet_px, floor_px, silhouette_lines
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.goal.picture import floor_derivatives, floor_residuals, goal_derivatives, predict_goal

seeds = st.integers(0, 2**32 - 1)


def derivative(function, unknowns, step=1e-6):
    """Central differences (8, ...) of a function of the unknowns."""
    return np.array([(function(unknowns + step * e) - function(unknowns - step * e)) / (2 * step) for e in np.eye(8)])


def some_camera(rng):
    x, y = rng.uniform(-2.5, 1.8), rng.uniform(-1.2, 1.2)
    heading = np.arctan2(-y, SHAPE.line_x_m - x) + rng.uniform(-0.1, 0.1)
    # below and above the bar
    return np.array([x, y, heading, *rng.uniform(-0.2, 0.2, 2), rng.uniform(0.1, 1.2), *rng.uniform(-0.05, 0.05, 2)])


@given(seeds)
def test_prediction_agrees_with_numpy(seed):
    p = some_camera(np.random.default_rng(seed))
    lines, feet = np.empty((6, 3)), np.empty((2, 3, 2))
    predict_goal(SCENE, p, lines, feet)
    np.testing.assert_allclose(lines, silhouette_lines(SHAPE, VIEW, p), rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(feet, feet_px(SHAPE, VIEW, p, OFFSETS), rtol=1e-9, atol=1e-7)


@given(seeds)
def test_the_goal_s_derivatives_are_those_of_the_plain_picture(seed):
    p = some_camera(np.random.default_rng(seed))
    by_lines, by_feet = np.empty((8, 6, 3)), np.empty((8, 2, 3, 2))
    goal_derivatives(SCENE, p, by_lines, by_feet)
    expected = derivative(lambda q: silhouette_lines(SHAPE, VIEW, q), p)
    np.testing.assert_allclose(by_lines, expected, rtol=1e-5, atol=1e-4)
    expected = derivative(lambda q: feet_px(SHAPE, VIEW, q, OFFSETS), p)
    np.testing.assert_allclose(by_feet, expected, rtol=1e-5, atol=1e-4)


@given(seeds)
def test_the_goal_behind_the_camera_has_the_same_derivatives_of_its_lines(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    p[0] = SHAPE.line_x_m + rng.uniform(0.3, 2.0)
    by_lines, by_feet = np.empty((8, 6, 3)), np.empty((8, 2, 3, 2))
    goal_derivatives(SCENE, p, by_lines, by_feet)
    expected = derivative(lambda q: silhouette_lines(SHAPE, VIEW, q), p)
    np.testing.assert_allclose(by_lines, expected, rtol=1e-4, atol=1e-3)


def floor_samples(rng, p):
    ahead = rng.uniform(0.5, 3.0, (5, 1)) * [np.cos(p[2]), np.sin(p[2])]
    turn = rng.uniform(0, 2 * np.pi, 5)
    return p[:2] + ahead + rng.uniform(-0.3, 0.3, (5, 2)), np.column_stack([np.cos(turn), np.sin(turn)])


@given(seeds)
def test_floor_marks_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    marks, direction = floor_samples(rng, p)
    uv = rng.uniform(0, 400, (5, 2))
    residual, jacobian = np.empty(5), np.empty((5, 7))
    floor_residuals(SCENE.camera, p, marks, uv, direction, residual)

    def plain(q):
        return ((uv - floor_px(VIEW, q, marks)) * direction).sum(axis=1)

    np.testing.assert_allclose(residual, plain(p), rtol=1e-9, atol=1e-7)
    floor_derivatives(SCENE.camera, p, marks, direction, jacobian)
    np.testing.assert_allclose(jacobian.T, derivative(plain, p)[:7], rtol=1e-5, atol=1e-3)


def test_what_is_behind_the_camera_is_no_number():
    p = np.array([0.0, 0, np.pi, 0, 0, 0.2, 0, 0])
    residual, jacobian = np.zeros(1), np.zeros((1, 7))
    behind, along = np.array([[1.0, 0.0]]), np.array([[1.0, 0.0]])
    floor_residuals(SCENE.camera, p, behind, np.zeros((1, 2)), along, residual)
    floor_derivatives(SCENE.camera, p, behind, along, jacobian)
    lines, feet = np.empty((6, 3)), np.zeros((2, 3, 2))
    predict_goal(SCENE, p, lines, feet)
    by_lines, by_feet = np.empty((8, 6, 3)), np.zeros((8, 2, 3, 2))
    goal_derivatives(SCENE, p, by_lines, by_feet)
    for array in (residual, jacobian, feet, by_feet):
        assert np.isnan(array).all()
