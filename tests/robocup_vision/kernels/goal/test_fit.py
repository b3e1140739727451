"""The fit of a camera to a goal that a plain projection draws."""

import math

import numpy as np
from goal_samples import SCENE, SHAPE, VIEW, perfect_samples, silhouette_lines, some_camera
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.goal.fit import FitPriors, fit_goal, goal_residuals

seeds = st.integers(0, 2**32 - 1)


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
    cost = fit_goal(SCENE, samples._replace(uv=uv), FitPriors(prior, weight), scales, p, information)
    assert np.isfinite(cost)
    # wrong samples beside right ones pull a far camera farther: a centimetre a metre
    distance_m = math.hypot(truth[0] - SHAPE.line_x_m, truth[1])
    np.testing.assert_allclose(p[:2], truth[:2], atol=0.02 + 0.01 * distance_m)
    np.testing.assert_allclose(p[2:5], truth[2:5], atol=0.02)
    assert p[5] == fixed
    assert np.linalg.eigvalsh(information).min() > 0


@given(seeds)
def test_samples_measured_worse_never_tell_more(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    priors = FitPriors(p, np.array([0, 0, 0, 0, 0, 1e4, 1e4, 1e-3]))
    scales = np.ones(4)
    information = np.zeros((2, 8, 8))
    worse = np.where(rng.random(74) < 0.5, 3.0, 1.0)
    for sigma, out in zip((np.full(74, 0.3), 0.3 * worse), information, strict=True):
        fit_goal(SCENE, perfect_samples(p, sigma=sigma), priors, scales, p.copy(), out)
    lost = np.linalg.eigvalsh(information[0] - information[1])
    assert lost.min() > -1e-6 * lost.max()
