"""Weights that follow residuals, and the fit that they are of, against the same in plain NumPy."""

import numpy as np
import pytest
from goal_twins import SCENE, perfect_samples
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.fit import FitLoss, FitPriors, fit_goal, goal_residuals
from robocup_vision.kernels.goal.lines.doubt import Doubt, doubt_edges, fit_doubting, goal_misfit, scatter_marks

SIGMA = 0.3
TRUTH = np.array([-0.5, 0.4, -0.1, -0.05, 0.0, 0.185, 0.0, 0.0])
PRIORS = FitPriors(TRUTH, np.array([0, 0, 0, 0, 100.0, 1e4, np.inf, 44.0]))
SCALES = np.full(4, 1.0)
LOSS = FitLoss(SCALES, SCALES, False)


def plain_doubt(edge, residual, sigma, typical_px):
    count = np.bincount(edge, minlength=6)
    off = np.bincount(edge, residual[: len(edge)], minlength=6) / np.maximum(count, 1)
    typical = np.mean(np.minimum(off[count > 0] ** 2, typical_px**2)) if len(edge) else 0.0
    doubted = sigma.copy()
    doubted[: len(edge)] = np.sqrt(sigma[: len(edge)] ** 2 + ((off**2 + typical) * count)[edge])
    return doubted


def plain_scatter(residual, prior_weight, sigma):
    square = np.minimum((residual / sigma) ** 2, 9.0)
    return sigma * np.sqrt((square.sum() + prior_weight) / (len(square) + prior_weight))


def doubted(edge, residual, sigma, typical_px):
    found = np.empty(len(sigma))
    doubt_edges(edge, residual, sigma, typical_px, found)
    return found


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.integers(0, 20))
def test_weights_are_those_of_numpy(seed, edges, marks):
    rng = np.random.default_rng(seed)
    edge, count = rng.integers(0, 6, edges), edges + marks
    residual, sigma = rng.normal(0, 2, count), rng.uniform(0.05, 1, count)
    np.testing.assert_allclose(doubted(edge, residual, sigma, 0.5), plain_doubt(edge, residual, sigma, 0.5))
    scattered = sigma[edges:].copy()
    scatter_marks(residual[edges:], 4.0, scattered)
    np.testing.assert_allclose(scattered, plain_scatter(residual[edges:], 4.0, sigma[edges:]))


def test_an_edge_that_is_off_as_a_whole_counts_less_and_marks_as_before():
    residual = np.concatenate([np.tile([0.2, -0.2, 0.0], 3), np.full(16, 1.5), np.full(3, 5.0)])
    sigma = doubted(np.array([0] * 9 + [4] * 16), residual, np.full(28, SIGMA), 0.0)
    np.testing.assert_allclose(sigma[:9], SIGMA)
    # 16 samples that share an error of 1.5 pixels tell as much as one of that noise
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1.5**-2, rel=0.01)
    np.testing.assert_allclose(sigma[25:], SIGMA)


def test_where_edges_are_off_the_others_are_less_certain_too():
    edge = np.array([0] * 9 + [4] * 16 + [5] * 4)
    residual = np.concatenate([np.zeros(9), np.full(16, 0.3), np.full(4, 9.0), np.zeros(3)])
    sigma = doubted(edge, residual, np.full(32, SIGMA), 0.5)
    typical_px2 = (0.0 + 0.3**2 + 0.5**2) / 3
    assert np.sum(sigma[:9] ** -2) == pytest.approx(1 / (SIGMA**2 / 9 + typical_px2))
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1 / (SIGMA**2 / 16 + 0.3**2 + typical_px2))
    np.testing.assert_allclose(sigma[29:], SIGMA)
    np.testing.assert_allclose(doubted(edge, np.zeros(32), np.full(32, SIGMA), 0.5), SIGMA)


def fitted(samples, doubt):
    p, information, sigma = TRUTH + 0.02, np.empty((8, 8)), np.empty(len(samples.sigma))
    p[6] = TRUTH[6]
    cost = fit_doubting(SCENE, samples, PRIORS, LOSS, doubt, p, information, sigma)
    return p, cost, information, sigma


def test_each_round_is_weighed_by_the_one_before():
    samples = perfect_samples(TRUTH)
    samples.uv[samples.edge == 4] += (0.0, 1.0)  # a streak along the bar
    samples.mark_uv[:] += np.random.default_rng(4).normal(0, 0.2, samples.mark_uv.shape)
    doubt = Doubt(3, 0.5, 4.0)
    p, cost, information, sigma = fitted(samples, doubt)
    q, expected = TRUTH + 0.02, np.empty((8, 8))
    q[6] = TRUTH[6]
    goal = len(samples.edge) + len(samples.foot_post)
    weighed, other = samples, 0.0
    for _ in range(3):
        residual = np.empty(len(samples.sigma))
        goal_residuals(SCENE, samples, q, residual)
        weights = plain_doubt(samples.edge, residual, samples.sigma, 0.5)
        weights[goal:] = plain_scatter(residual[goal:], 4.0, weights[goal:])
        weighed = samples._replace(sigma=weights)
        other = fit_goal(SCENE, weighed, PRIORS, LOSS, q, expected)
    np.testing.assert_allclose(p, q, atol=1e-12)
    np.testing.assert_allclose(sigma, weighed.sigma)
    np.testing.assert_allclose(information, expected)
    assert cost == pytest.approx(other)
    # the rest of the goal overrules the bar
    once = fitted(samples, Doubt(1, 0.5, 4.0))[0]
    assert np.hypot(*(p - TRUTH)[:2]) < np.hypot(*(once - TRUTH)[:2])


def test_a_fit_that_breaks_down_costs_infinitely_much():
    samples = perfect_samples(TRUTH)
    samples.mark_m[0] = np.nan
    assert fitted(samples, Doubt(3, 0.5, 4.0))[1] == np.inf


def test_misfit_is_that_of_the_goal_and_of_the_priors():
    samples = perfect_samples(TRUTH)
    p = TRUTH + np.array([0.05, 0.02, 0.01, 0.0, 0.03, 0.002, 0.5, 0.1])
    residual = np.empty(len(samples.sigma))
    goal_residuals(SCENE, samples, p, residual)
    goal = len(samples.edge) + len(samples.foot_post)
    known = np.isfinite(PRIORS.weight)
    expected = np.log1p((residual[:goal] / 0.3) ** 2) @ (0.3 / samples.sigma[:goal]) ** 2
    expected += PRIORS.weight[known] @ (p - TRUTH)[known] ** 2
    assert goal_misfit(samples, residual, PRIORS, 0.3, p) == pytest.approx(expected)
