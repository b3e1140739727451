"""What one frame tells of a camera: the same as least squares with dense covariances."""

import numpy as np
import pytest

from robocup_vision.calibration.online.evidence import (
    NoiseSettings,
    Residuals,
    enough_agree,
    gauss_newton_step,
    known,
    marginal,
    normal_equations,
    spread_px,
    tukey_weights,
)

NOISE = NoiseSettings(0.3, 0.2)


@pytest.fixture
def points():
    rng = np.random.default_rng(5)
    return Residuals(
        rng.standard_normal(30), rng.standard_normal((30, 2)), rng.standard_normal((30, 3)), rng.integers(0, 6, 30)
    )


def test_groups_share_an_offset(points):
    weight = np.linspace(0.2, 1.0, 30)
    information, gradient = normal_equations(points, weight, NOISE)
    same = points.group[:, None] == points.group
    dense = np.linalg.inv(np.diag(NOISE.point_std_px**2 / weight) + NOISE.group_std_px**2 * same)
    rows = np.hstack([points.by_camera, points.by_frame])
    np.testing.assert_allclose(information, rows.T @ dense @ rows, rtol=1e-9)
    np.testing.assert_allclose(gradient, -rows.T @ dense @ points.residual_px, rtol=1e-9)


def test_a_frame_s_own_unknowns_are_left_out(points):
    information, gradient = normal_equations(points, np.ones(30), NOISE)
    own, slope = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])
    reduced, reduced_gradient = marginal(information, gradient, 2, own, slope)
    whole = information.copy()
    whole[2:, 2:] += np.diag(own)
    np.testing.assert_allclose(np.linalg.inv(reduced), np.linalg.inv(whole)[:2, :2], rtol=1e-9)
    right = gradient.copy()
    right[2:] += slope
    np.testing.assert_allclose(np.linalg.solve(reduced, reduced_gradient), np.linalg.solve(whole, right)[:2], rtol=1e-9)


def test_a_step_joins_points_with_what_is_believed_before(points):
    information, gradient = normal_equations(points, np.ones(30), NOISE)
    own, slope = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3])
    before, pull = np.diag([4.0, 5.0]), np.array([-0.3, 0.4])
    step = gauss_newton_step(information, gradient, (before, pull), (own, slope))
    # the marginal of the frame's own unknowns steps the camera as far
    reduced, reduced_gradient = marginal(information, gradient, 2, own, slope)
    np.testing.assert_allclose(step[:2], np.linalg.solve(reduced + before, reduced_gradient + pull), rtol=1e-9)
    left = gradient + np.concatenate([pull, slope]) - information @ step
    np.testing.assert_allclose(left, np.concatenate([np.diag(before), own]) * step, atol=1e-9)


@pytest.mark.parametrize(("agreeing", "total", "is_enough"), [(9, 10, False), (10, 20, True), (12, 25, False)])
def test_a_frame_counts_by_number_and_by_ratio(agreeing, total, is_enough):
    assert enough_agree(agreeing, total, min_points=10, min_ratio=0.5) is is_enough


def test_what_a_frame_s_own_unknowns_explain_tells_nothing(points):
    alike = Residuals(points.residual_px, points.by_frame[:, :1], points.by_frame, points.group)
    information, gradient = normal_equations(alike, np.ones(30), NOISE)
    reduced, _ = marginal(information, gradient, 1, np.full(3, 1e-9), np.zeros(3))
    assert abs(reduced[0, 0]) < 1e-6 * information[0, 0]


def test_weights_and_spread():
    np.testing.assert_allclose(tukey_weights(np.array([0.0, 1.0, -2.0, 3.0]), 2.0), [1.0, 0.5625, 0.0, 0.0])
    drawn = np.random.default_rng(6).normal(0.0, 0.5, 4000)
    assert spread_px(drawn, 0.1) == pytest.approx(0.5, rel=0.05)
    assert spread_px(drawn, 0.9) == 0.9
    assert spread_px(np.empty(0), 0.2) == 0.2


def test_points_are_chosen_together(points):
    some = known(points.group == 3, points)
    assert len(some.residual_px) == len(some.by_camera) == len(some.by_frame) == (points.group == 3).sum()
    assert (some.group == 3).all()
