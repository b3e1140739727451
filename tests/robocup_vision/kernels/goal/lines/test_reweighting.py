"""Edges that are off as a whole weigh less."""

import numpy as np
import pytest
from goal_twins import SCENE, perfect_samples

from robocup_vision.kernels.goal.fit import FitPriors
from robocup_vision.kernels.goal.lines.reweighting import Reweighting, fit_reweighted, reweight_edges

SIGMA = 0.3
TRUTH = np.array([-0.5, 0.4, -0.1, -0.05, 0.0, 0.185, 0.0, 0.0])
PRIORS = FitPriors(TRUTH, np.array([0, 0, 0, 0, 100.0, 1e4, np.inf, 44.0]))
SCALES = np.full(4, 1.0)


def weighed(edge, residual, sigma, typical_px):
    found = np.empty(len(sigma))
    reweight_edges(edge, residual, sigma, typical_px, found)
    return found


def test_an_edge_that_is_off_as_a_whole_counts_less_and_marks_as_before():
    residual = np.concatenate([np.tile([0.2, -0.2, 0.0], 3), np.full(16, 1.5), np.full(3, 5.0)])
    sigma = weighed(np.array([0] * 9 + [4] * 16), residual, np.full(28, SIGMA), 0.0)
    np.testing.assert_allclose(sigma[:9], SIGMA)
    # 16 samples that share an error of 1.5 pixels tell as much as one of that noise
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1.5**-2, rel=0.01)
    np.testing.assert_allclose(sigma[25:], SIGMA)


def test_where_edges_are_off_the_others_are_less_certain_too():
    edge = np.array([0] * 9 + [4] * 16 + [5] * 4)
    residual = np.concatenate([np.zeros(9), np.full(16, 0.3), np.full(4, 9.0), np.zeros(3)])
    sigma = weighed(edge, residual, np.full(32, SIGMA), 0.5)
    typical_px2 = (0.0 + 0.3**2 + 0.5**2) / 3
    assert np.sum(sigma[:9] ** -2) == pytest.approx(1 / (SIGMA**2 / 9 + typical_px2))
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1 / (SIGMA**2 / 16 + 0.3**2 + typical_px2))
    np.testing.assert_allclose(sigma[29:], SIGMA)
    np.testing.assert_allclose(weighed(edge, np.zeros(32), np.full(32, SIGMA), 0.5), SIGMA)


def fitted(samples, doubt):
    p, information, sigma = TRUTH + 0.02, np.empty((8, 8)), np.empty(len(samples.sigma))
    p[6] = TRUTH[6]
    cost = fit_reweighted(SCENE, samples, PRIORS, SCALES, doubt, p, information, sigma)
    return p, cost, information, sigma


def test_a_fit_that_breaks_down_costs_infinitely_much():
    samples = perfect_samples(TRUTH)
    samples.mark_m[0] = np.nan
    assert fitted(samples, Reweighting(3, 0.5, 4.0))[1] == np.inf
