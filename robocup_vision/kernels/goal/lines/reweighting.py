"""The last rounds of a fit of goal and lines: edges that the rest contradicts lose weight, marks count as they scatter.

A lamp's streak along a bar has a border that passes for the bar's edge. Weights that follow the residuals of whole
edges let all the others overrule it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.goal.fit import FitPriors, FitSamples, fit_goal, goal_residuals, with_marks
from robocup_vision.kernels.goal.picture import GoalScene

_EDGES = 6
_FAR2 = 9.0  # squared residual in variances: a mark farther off counts as one so far off


class Reweighting(NamedTuple):
    """How weights follow residuals.

    Parameters
    ----------
    rounds : int
        Fits, each with the weights that follow from the one before.
    typical_px : float
        Edges farther off are no edges of the goal, and tell nothing of the others: blur moves one by half a pixel.
    prior_weight : float
        So many marks of the expected noise are added to those whose scatter is measured.
    """

    rounds: int = 3
    typical_px: float = 0.5
    prior_weight: float = 4.0


@compiled
def reweight_edges(
    edge: Int64Array, residual: FloatArray, sigma: FloatArray, typical_px: float, weighed: FloatArray
) -> None:
    """Let each edge as a whole be as uncertain as it is off: one that all others contradict is somebody else's.

    Where some edges are off in a picture, the others may be as well, though a fit has followed them: each is as
    uncertain as edges are off on average besides, up to `typical_px` each.

    Parameters
    ----------
    edge : (N,) int64
        Silhouette edge of each edge sample.
    residual, sigma : (N + M,) float64
        Of a fit to these and other samples, and their noise, pixels.
    typical_px : float
        See `Reweighting`.
    weighed : (N + M,) float64
        Result: noise; that of other samples is unchanged.
    """
    count, square = np.zeros(_EDGES), np.zeros(_EDGES)
    for n in range(edge.shape[0]):
        count[edge[n]] += 1.0
        square[edge[n]] += residual[n]
    typical, seen = 0.0, 0
    for e in range(_EDGES):
        square[e] = (square[e] / max(count[e], 1.0)) ** 2
        if count[e] > 0.0:
            typical += min(square[e], typical_px**2)
            seen += 1
    typical /= max(seen, 1)
    copy_vector(sigma, weighed)
    for n in range(edge.shape[0]):
        weighed[n] = math.sqrt(sigma[n] ** 2 + (square[edge[n]] + typical) * count[edge[n]])


@compiled
def scatter_marks(residual: FloatArray, prior_weight: float, sigma: FloatArray) -> None:
    """Let the noise of marks be what they scatter; what lines are off as a whole comes and goes with it.

    Parameters
    ----------
    residual : (L,) float64
        Of the marks, pixels.
    prior_weight : float
        See `Reweighting`.
    sigma : (L,) float64
        Their noise, pixels; overwritten.
    """
    square = prior_weight
    for n in range(residual.shape[0]):
        square += min((residual[n] / sigma[n]) ** 2, _FAR2)
    scatter = math.sqrt(square / (residual.shape[0] + prior_weight))
    for n in range(residual.shape[0]):
        sigma[n] *= scatter


@compiled
def fit_reweighted(
    scene: GoalScene,
    samples: FitSamples,
    priors: FitPriors,
    scales: FloatArray,
    by: Reweighting,
    p: FloatArray,
    information: FloatArray,
    sigma: FloatArray,
) -> float:
    """Fit goal and marks round by round, weighed by the residuals of the round before.

    Parameters
    ----------
    scene, samples, priors, scales
        See `fit_goal`.
    by : Reweighting
        How weights follow residuals.
    p : (8,) float64
        Start, overwritten with the result.
    information : (8, 8) float64
        Result, see `fit_goal`.
    sigma : (N + M + L,) float64
        Result: noise of the last round, pixels.

    Returns
    -------
    float
        The last round's cost, or infinity where a fit broke down.
    """
    goal = samples.edge.shape[0] + samples.foot_post.shape[0]
    residual = np.empty(samples.sigma.shape[0])
    joined = with_marks(samples, samples.mark_m, samples.mark_uv, samples.mark_direction, sigma)
    cost = np.inf
    for _ in range(by.rounds):
        goal_residuals(scene, samples, p, residual)
        reweight_edges(samples.edge, residual, samples.sigma, by.typical_px, sigma)
        scatter_marks(residual[goal:], by.prior_weight, sigma[goal:])
        cost = fit_goal(scene, joined, priors, scales, p, information)
        if math.isinf(cost):
            break
    return cost


@compiled
def goal_misfit(samples: FitSamples, residual: FloatArray, priors: FitPriors, scale_px: float, p: FloatArray) -> float:
    """Cost of a goal's own samples and of the priors at a camera, chi-square; unknowns that are held cost nothing.

    Parameters
    ----------
    samples : FitSamples
        The goal's, without marks or before them.
    residual : (N + M + ...,) float64
        Of the samples there, pixels.
    priors : FitPriors
        On the camera.
    scale_px : float
        Of Cauchy's loss.
    p : (8,) float64
        The camera.
    """
    cost = 0.0
    for n in range(samples.edge.shape[0] + samples.foot_post.shape[0]):
        cost += math.log1p((residual[n] / scale_px) ** 2) * (scale_px / samples.sigma[n]) ** 2
    for i in range(p.shape[0]):
        if not math.isinf(priors.weight[i]):
            cost += priors.weight[i] * (p[i] - priors.expected[i]) ** 2
    return cost
