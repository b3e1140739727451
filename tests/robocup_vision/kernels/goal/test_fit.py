"""The compiled goal fit against the plain NumPy picture of a goal, and against a known answer."""

import math

import numpy as np
import pytest
from goal_twins import SCENE, SHAPE, VIEW, derivative, perfect_samples, silhouette_lines, some_camera
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.fit import (
    FitLoss,
    FitPriors,
    NormalSystem,
    fit_goal,
    goal_residuals,
    normal_equations,
    robust_cost,
)

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_residuals_of_perfect_samples_vanish_and_grow_by_the_offset(seed):
    p = some_camera(np.random.default_rng(seed))
    samples = perfect_samples(p)
    residual = np.empty(74)
    goal_residuals(SCENE, samples, p, residual)
    np.testing.assert_allclose(residual, 0, atol=1e-6)
    lines = silhouette_lines(SHAPE, VIEW, p)
    moved = samples._replace(uv=samples.uv + 2.0 * lines[samples.edge, :2])
    goal_residuals(SCENE, moved, p, residual)
    np.testing.assert_allclose(residual[:60], 2.0, atol=1e-6)


def plain_loss(square, redescends):
    """Loss and its weight at squared residuals over the squared scale."""
    if redescends:
        return square / (1 + square), (1 + square) ** -2
    return np.log1p(square), 1 / (1 + square)


@pytest.mark.parametrize("redescends", [False, True])
def test_robust_cost_agrees_with_numpy(redescends):
    rng = np.random.default_rng(1)
    samples = perfect_samples(some_camera(rng), sigma=rng.uniform(0.1, 1, 74))
    residual, p = rng.normal(size=74), rng.normal(size=8)
    priors = FitPriors(rng.normal(size=8), rng.uniform(0, 3, 8))
    priors.weight[2] = np.inf  # fixed: adds nothing
    loss = FitLoss(np.array([9.0, 0.7]), np.array([9.0, 1.1]), redescends)
    free = np.isfinite(priors.weight)
    expected = (0.7**2 * plain_loss((residual / 0.7) ** 2, False)[0] / samples.sigma**2)[:66].sum()
    expected += (1.1**2 * plain_loss((residual / 1.1) ** 2, redescends)[0] / samples.sigma**2)[66:].sum()
    expected += (priors.weight[free] * (p - priors.expected)[free] ** 2).sum()
    assert robust_cost(samples, residual, loss, 1, p, priors) == pytest.approx(expected)
    residual[3] = np.nan
    assert robust_cost(samples, residual, loss, 1, p, priors) == np.inf


@settings(deadline=None, max_examples=20)
@given(seeds, st.booleans())
def test_normal_equations_agree_with_numpy(seed, redescends):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    samples = perfect_samples(p, sigma=rng.uniform(0.1, 1, 74))
    samples.uv[:] += rng.normal(0, 1, samples.uv.shape)
    samples.mark_uv[:] += rng.normal(0, 1, samples.mark_uv.shape)
    priors = FitPriors(rng.normal(size=8), rng.uniform(0, 3, 8))
    priors.weight[rng.integers(8)] = np.inf
    loss = FitLoss(np.array([0.7]), np.array([1.1]), redescends)

    def of(q):
        residual = np.empty(74)
        goal_residuals(SCENE, samples, q, residual)
        return residual

    residual, jacobian = of(p), derivative(of, p).T
    weight = np.empty(74)
    weight[:66] = plain_loss((residual[:66] / 0.7) ** 2, False)[1]
    weight[66:] = plain_loss((residual[66:] / 1.1) ** 2, redescends)[1]
    weight /= samples.sigma**2
    free = np.isfinite(priors.weight)
    expected = (jacobian.T * weight) @ jacobian + np.diag(np.where(free, priors.weight, 0.0) + 1e-9)
    pull = -jacobian.T @ (weight * residual) - np.where(free, priors.weight, 0.0) * (p - priors.expected)
    expected[~free], expected[:, ~free], pull[~free] = 0.0, 0.0, 0.0
    expected[~free, ~free] = 1.0
    normal, right = np.empty((8, 8)), np.empty(8)
    normal_equations(SCENE, samples, priors, loss, 0, p, residual, NormalSystem(normal, right))
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(normal / np.outer(size, size), expected / np.outer(size, size), atol=1e-5)
    np.testing.assert_allclose(right / size, pull / size, atol=1e-4 * (1 + np.abs(pull / size).max()))


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_fit_comes_back_to_the_camera(seed):
    rng = np.random.default_rng(seed)
    truth = some_camera(rng)
    truth[6] = 0.0
    samples = perfect_samples(truth)
    # a tenth of the samples are elsewhere: the loss must not care
    uv = samples.uv.copy()
    wrong = rng.choice(60, 6, replace=False)
    uv[wrong] += rng.uniform(-6, 6, (6, 2))
    start = truth + rng.normal(size=8) * [0.05, 0.05, 0.01, 0.01, 0.01, 0, 0, 0.1]
    fixed = start[5]
    prior = np.array([0, 0, 0, 0, 0, 0.185, 0, 0.0])
    weight = np.array([0, 0, 0, 0, 0, np.inf, np.inf, 1e-3])
    information = np.zeros((8, 8))
    p = start.copy()
    scales = np.array([4.0] * 8 + [1.0] * 8 + [0.2] * 12)
    loss = FitLoss(scales, scales, False)
    cost = fit_goal(SCENE, samples._replace(uv=uv), FitPriors(prior, weight), loss, p, information)
    assert np.isfinite(cost)
    # wrong samples beside right ones pull a far camera farther: a centimetre a metre
    distance_m = math.hypot(truth[0] - SHAPE.line_x_m, truth[1])
    np.testing.assert_allclose(p[:2], truth[:2], atol=0.02 + 0.01 * distance_m)
    np.testing.assert_allclose(p[2:5], truth[2:5], atol=0.02)
    assert p[5] == fixed
    assert np.linalg.eigvalsh(information).min() > 0
