"""The robust fit of a camera to a goal's edges and feet and to marks on the floor: one Gauss-Newton loop for all."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import solve_symmetric
from robocup_vision.kernels.algebra.copies import copy_matrix, copy_vector
from robocup_vision.kernels.goal.picture import (
    FLOOR_UNKNOWNS,
    GoalScene,
    floor_derivatives,
    floor_residuals,
    goal_derivatives,
    predict_goal,
)

# inverse variance, 1/m^2 and 1/rad^2, of what neither samples nor priors determine: above the rounding errors of the
# others' information, so that the whole is definite
_OPEN = 1e-4


class FitSamples(NamedTuple):
    """What was measured, in ideal pixels.

    Parameters
    ----------
    edge : (N,) int64
        Silhouette edge of each edge sample.
    uv : (N, 2) float64
        Where it was found.
    foot_post, foot_at : (M,) int64
        Post of each foot sample, and its index into `GoalScene.offsets`.
    foot_uv, foot_direction : (M, 2) float64
        Where the paint ends, and along which direction that was measured.
    mark_m : (L, 2) float64
        Points of the floor, field frame, metres.
    mark_uv, mark_direction : (L, 2) float64
        Where each was seen, and along which direction that was measured.
    sigma : (N + M + L,) float64
        Noise of all, pixels.
    """

    edge: Int64Array
    uv: FloatArray
    foot_post: Int64Array
    foot_at: Int64Array
    foot_uv: FloatArray
    foot_direction: FloatArray
    mark_m: FloatArray
    mark_uv: FloatArray
    mark_direction: FloatArray
    sigma: FloatArray


class FitPriors(NamedTuple):
    """Expected unknowns (8,) and their inverse variances (8,); infinity holds an unknown where the fit starts."""

    expected: FloatArray
    weight: FloatArray


@compiled
def goal_residuals(scene: GoalScene, samples: FitSamples, p: FloatArray, residual: FloatArray) -> None:
    """Signed pixel residuals of edge samples, foot samples and floor marks, in this order; NaN behind the camera."""
    lines, feet = np.empty((6, 3)), np.empty((2, scene.offsets.shape[0], 2))
    predict_goal(scene, p, lines, feet)
    edges, goal = samples.edge.shape[0], samples.edge.shape[0] + samples.foot_post.shape[0]
    for n in range(edges):
        e = samples.edge[n]
        residual[n] = lines[e, 0] * samples.uv[n, 0] + lines[e, 1] * samples.uv[n, 1] + lines[e, 2]
    for n in range(goal - edges):
        post, k = samples.foot_post[n], samples.foot_at[n]
        residual[edges + n] = (
            (samples.foot_uv[n, 0] - feet[post, k, 0]) * samples.foot_direction[n, 0]
            + (samples.foot_uv[n, 1] - feet[post, k, 1]) * samples.foot_direction[n, 1]
            - p[7]
        )
    floor_residuals(scene.camera, p, samples.mark_m, samples.mark_uv, samples.mark_direction, residual[goal:])


@compiled
def robust_cost(samples: FitSamples, residual: FloatArray, scale: float, p: FloatArray, priors: FitPriors) -> float:
    """Cauchy's cost of residuals at a scale in pixels, plus the priors' squares; infinite where one is NaN."""
    cost = 0.0
    for n in range(residual.shape[0]):
        if math.isnan(residual[n]):
            return np.inf
        cost += (scale / samples.sigma[n]) ** 2 * math.log1p((residual[n] / scale) ** 2)
    for i in range(p.shape[0]):
        if not math.isinf(priors.weight[i]):
            cost += priors.weight[i] * (p[i] - priors.expected[i]) ** 2
    return cost


@compiled
def _add_edges(
    samples: FitSamples, by_lines: FloatArray, residual: FloatArray, scale: float, normal: FloatArray, right: FloatArray
) -> None:
    """Add the edge samples to the normal equations.

    A residual is linear in its line: of all samples on one edge only their second moments count.
    """
    moments, pull = np.zeros((6, 3, 3)), np.zeros((6, 3))
    for n in range(samples.edge.shape[0]):
        w = 1.0 / (samples.sigma[n] ** 2 * (1.0 + (residual[n] / scale) ** 2))
        e, u, v = samples.edge[n], samples.uv[n, 0], samples.uv[n, 1]
        wu, wv = w * u, w * v
        moments[e, 0, 0] += wu * u
        moments[e, 0, 1] += wu * v
        moments[e, 0, 2] += wu
        moments[e, 1, 1] += wv * v
        moments[e, 1, 2] += wv
        moments[e, 2, 2] += w
        pull[e, 0] += wu * residual[n]
        pull[e, 1] += wv * residual[n]
        pull[e, 2] += w * residual[n]
    for e in range(6):
        moments[e, 1, 0], moments[e, 2, 0] = moments[e, 0, 1], moments[e, 0, 2]
        moments[e, 2, 1] = moments[e, 1, 2]
        for i in range(8):
            d = by_lines[i, e]
            right[i] -= d[0] * pull[e, 0] + d[1] * pull[e, 1] + d[2] * pull[e, 2]
            m0 = d[0] * moments[e, 0, 0] + d[1] * moments[e, 1, 0] + d[2] * moments[e, 2, 0]
            m1 = d[0] * moments[e, 0, 1] + d[1] * moments[e, 1, 1] + d[2] * moments[e, 2, 1]
            m2 = d[0] * moments[e, 0, 2] + d[1] * moments[e, 1, 2] + d[2] * moments[e, 2, 2]
            for j in range(i + 1):
                normal[i, j] += m0 * by_lines[j, e, 0] + m1 * by_lines[j, e, 1] + m2 * by_lines[j, e, 2]


@compiled
def _add_feet(
    samples: FitSamples, by_feet: FloatArray, residual: FloatArray, scale: float, normal: FloatArray, right: FloatArray
) -> None:
    """Add the foot samples to the normal equations."""
    row = np.empty(8)
    first = samples.edge.shape[0]
    for n in range(samples.foot_post.shape[0]):
        r = residual[first + n]
        post, at = samples.foot_post[n], samples.foot_at[n]
        for k in range(FLOOR_UNKNOWNS):
            moved = by_feet[k, post, at]
            row[k] = -moved[0] * samples.foot_direction[n, 0] - moved[1] * samples.foot_direction[n, 1]
        row[7] = -1.0  # paint that bleeds moves every edge and foot alike
        w = 1.0 / (samples.sigma[first + n] ** 2 * (1.0 + (r / scale) ** 2))
        for i in range(8):
            right[i] -= w * row[i] * r
            for j in range(i + 1):
                normal[i, j] += w * row[i] * row[j]


@compiled
def _add_marks(
    samples: FitSamples,
    jacobian: FloatArray,
    residual: FloatArray,
    scale: float,
    normal: FloatArray,
    right: FloatArray,
) -> None:
    """Add the floor marks to the normal equations; bloom does not move them."""
    first = samples.edge.shape[0] + samples.foot_post.shape[0]
    for n in range(jacobian.shape[0]):
        r = residual[first + n]
        w = 1.0 / (samples.sigma[first + n] ** 2 * (1.0 + (r / scale) ** 2))
        for i in range(FLOOR_UNKNOWNS):
            wj = w * jacobian[n, i]
            right[i] -= wj * r
            for j in range(i + 1):
                normal[i, j] += wj * jacobian[n, j]


@compiled
def normal_equations(
    scene: GoalScene,
    samples: FitSamples,
    priors: FitPriors,
    scale: float,
    p: FloatArray,
    residual: FloatArray,
    normal: FloatArray,
    right: FloatArray,
) -> None:
    """Set up the normal equations of one Gauss-Newton step, priors included.

    Parameters
    ----------
    scene, samples, priors
        What is fitted to what.
    scale : float
        Of Cauchy's loss, pixels.
    p : (8,) float64
        The unknowns.
    residual : (N + M + L,) float64
        Of `goal_residuals` there, none of them NaN.
    normal, right : (8, 8), (8,) float64
        Results.
    """
    normal[:, :] = 0.0
    right[:] = 0.0
    by_lines, by_feet = np.empty((8, 6, 3)), np.empty((8, 2, scene.offsets.shape[0], 2))
    goal_derivatives(scene, p, by_lines, by_feet)
    _add_edges(samples, by_lines, residual, scale, normal, right)
    _add_feet(samples, by_feet, residual, scale, normal, right)
    if samples.mark_m.shape[0]:
        jacobian = np.empty((samples.mark_m.shape[0], FLOOR_UNKNOWNS))
        floor_derivatives(scene.camera, p, samples.mark_m, samples.mark_direction, jacobian)
        _add_marks(samples, jacobian, residual, scale, normal, right)
    for i in range(8):
        if math.isinf(priors.weight[i]):
            normal[i, :] = 0.0
            normal[:, i] = 0.0
            normal[i, i] = 1.0
            right[i] = 0.0
        else:
            normal[i, i] += priors.weight[i] + _OPEN
            right[i] -= priors.weight[i] * (p[i] - priors.expected[i])
    for i in range(8):
        for j in range(i):
            normal[j, i] = normal[i, j]


@compiled
def fit_goal(
    scene: GoalScene, samples: FitSamples, priors: FitPriors, scales: FloatArray, p: FloatArray, normal: FloatArray
) -> float:
    """Gauss-Newton on the eight unknowns under priors, robust by weights whose scale shrinks step by step.

    Parameters
    ----------
    scene, samples, priors
        What is fitted to what.
    scales : (K,) float64
        Scale of Cauchy's loss in each iteration, pixels.
    p : (8,) float64
        Start, overwritten with the result.
    normal : (8, 8) float64
        Result: the last iteration's normal matrix, priors included.

    Returns
    -------
    float
        The last iteration's `robust_cost`, or infinity where the fit broke down.
    """
    count, iterations = samples.sigma.shape[0], scales.shape[0]
    base, moved = np.empty(count), np.empty(count)
    work, step, trial = np.empty((8, 8)), np.empty(8), np.empty(8)
    cost = np.inf
    goal_residuals(scene, samples, p, base)
    for iteration in range(iterations):
        before = robust_cost(samples, base, scales[iteration], p, priors)
        if math.isinf(before):
            return np.inf
        normal_equations(scene, samples, priors, scales[iteration], p, base, normal, step)
        copy_matrix(normal, work)
        if not solve_symmetric(work, step):
            return np.inf
        # one step never goes further than the linear picture can hold, nor uphill
        limit = 1.0
        for i in range(8):
            bound = 1.0 if i < 2 else 0.3
            if i != 7 and abs(step[i]) > bound:
                limit = min(limit, bound / abs(step[i]))
        for _ in range(5):
            for i in range(8):
                trial[i] = p[i] + limit * step[i]
            goal_residuals(scene, samples, trial, moved)
            cost = robust_cost(samples, moved, scales[iteration], trial, priors)
            if cost <= before:
                copy_vector(trial, p)
                base, moved = moved, base
                break
            limit *= 0.4
            cost = before
        if scales[iteration] == scales[-1]:
            still = True
            for i in range(8):
                still = still and abs(limit * step[i]) < (1e-4 if i < 2 or i == 7 else 1e-5)
            if still:
                break
    return cost
