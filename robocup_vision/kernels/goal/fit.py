"""The goal's picture and the robust fit of a camera to it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.kernels.algebra.cholesky import solve_symmetric
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera


@njit(cache=True, nogil=True)
def goal_prediction(
    shape: FloatArray, view: FloatArray, p: FloatArray, offsets: FloatArray, lines: FloatArray, feet: FloatArray
) -> None:
    """Silhouette lines (6, 3) and foot pixels (2, K, 2) of the goal at +x (see localization/goal_geometry.py).

    Parameters
    ----------
    shape : (4,) float64
        line_x_m, width_m, height_m, radius_m.
    view : (4,) float64
        Focal lengths and centre, pixels.
    p : (8,) float64
        The unknowns.
    offsets : (K,) float64
        Across the foot, -1 to 1.
    lines, feet : float64
        Results.
    """
    axes = camera_axes(p[2], p[3], p[4])
    scale = math.exp(p[6])
    fu, fv = view[0] * scale, view[1] * scale
    dx = shape[0] - p[0]
    dz = shape[2] - p[5]
    side = -1.0 if dx < 0 else 1.0
    # planes that touch a cylinder: the direction to its axis, turned by the angle that its radius subtends
    bar_away = math.sqrt(dx * dx + dz * dz)
    bar_sin, bar_cos = dz / bar_away, abs(dx) / bar_away
    bar_half = min(1.0, shape[3] / bar_away)
    bar_rest = math.sqrt(1.0 - bar_half * bar_half)
    for e in range(6):
        nx, ny, nz = 0.0, 0.0, 0.0
        if e < 4:
            dy = (0.5 if e < 2 else -0.5) * shape[1] - p[1]
            away = math.sqrt(dx * dx + dy * dy)
            half = min(1.0, shape[3] / away)
            rest = math.sqrt(1.0 - half * half)
            if e == 0 or e == 2:
                nx, ny = -(dy * rest + dx * half) / away, (dx * rest - dy * half) / away
            else:
                nx, ny = (dy * rest - dx * half) / away, -(dx * rest + dy * half) / away
        elif e == 4:
            nx, nz = -side * (bar_sin * bar_rest + bar_cos * bar_half), bar_cos * bar_rest - bar_sin * bar_half
        else:
            nx, nz = side * (bar_sin * bar_rest - bar_cos * bar_half), -(bar_cos * bar_rest + bar_sin * bar_half)
        cx, cy, cz = in_camera(axes, nx, ny, nz)
        a, b = -cy / fu, -cz / fv
        c = cx - a * view[2] - b * view[3]
        norm = math.sqrt(a * a + b * b)
        lines[e, 0], lines[e, 1], lines[e, 2] = a / norm, b / norm, c / norm - p[7]
    for post in range(2):
        dy = (0.5 if post == 0 else -0.5) * shape[1] - p[1]
        distance = math.sqrt(dx * dx + dy * dy)
        ux, uy = dx / distance, dy / distance
        for k in range(offsets.shape[0]):
            along = math.sqrt(1.0 - offsets[k] ** 2)
            x = dx + shape[3] * (offsets[k] * uy - along * ux)
            y = dy + shape[3] * (-offsets[k] * ux - along * uy)
            depth, left, up = in_camera(axes, x, y, -p[5])
            if depth > 1e-6:
                feet[post, k, 0], feet[post, k, 1] = ideal_pixel(fu, fv, view[2], view[3], depth, left, up)
            else:
                feet[post, k, 0] = np.nan
                feet[post, k, 1] = np.nan


@njit(cache=True, nogil=True)
def goal_residuals(
    shape: FloatArray,
    view: FloatArray,
    p: FloatArray,
    offsets: FloatArray,
    edge: Int64Array,
    uv: FloatArray,
    foot_post: Int64Array,
    foot_at: Int64Array,
    foot_uv: FloatArray,
    foot_direction: FloatArray,
    mark_m: FloatArray,
    mark_uv: FloatArray,
    mark_direction: FloatArray,
    residual: FloatArray,
) -> None:
    """Signed pixel residuals of edge samples, foot samples and floor marks, in this order."""
    lines, feet = np.empty((6, 3)), np.empty((2, offsets.shape[0], 2))
    goal_prediction(shape, view, p, offsets, lines, feet)
    for n in range(edge.shape[0]):
        e = edge[n]
        residual[n] = lines[e, 0] * uv[n, 0] + lines[e, 1] * uv[n, 1] + lines[e, 2]
    for n in range(foot_post.shape[0]):
        post, k = foot_post[n], foot_at[n]
        residual[edge.shape[0] + n] = (
            (foot_uv[n, 0] - feet[post, k, 0]) * foot_direction[n, 0]
            + (foot_uv[n, 1] - feet[post, k, 1]) * foot_direction[n, 1]
            - p[7]
        )
    floor_residuals(view, p, mark_m, mark_uv, mark_direction, residual[edge.shape[0] + foot_post.shape[0] :])


@njit(cache=True, nogil=True)
def floor_residuals(
    view: FloatArray, p: FloatArray, mark_m: FloatArray, uv: FloatArray, direction: FloatArray, residual: FloatArray
) -> None:
    """Signed pixel residuals, along a direction each, of floor points (N, 2) in the field frame, metres."""
    axes = camera_axes(p[2], p[3], p[4])
    scale = math.exp(p[6])
    for n in range(mark_m.shape[0]):
        depth, left, up = in_camera(axes, mark_m[n, 0] - p[0], mark_m[n, 1] - p[1], -p[5])
        if depth > 1e-6:
            u, v = ideal_pixel(scale * view[0], scale * view[1], view[2], view[3], depth, left, up)
            residual[n] = (uv[n, 0] - u) * direction[n, 0] + (uv[n, 1] - v) * direction[n, 1]
        else:
            residual[n] = np.nan


@njit(cache=True, nogil=True)
def robust_cost(
    residual: FloatArray, sigma: FloatArray, scale: float, p: FloatArray, prior: FloatArray, weight: FloatArray
) -> float:
    """Cauchy cost of residuals at a pixel scale, plus the priors' squares; infinite where a residual is NaN."""
    cost = 0.0
    for n in range(residual.shape[0]):
        if math.isnan(residual[n]):
            return np.inf
        cost += (scale / sigma[n]) ** 2 * math.log1p((residual[n] / scale) ** 2)
    for i in range(p.shape[0]):
        if not math.isinf(weight[i]):
            cost += weight[i] * (p[i] - prior[i]) ** 2
    return cost


@njit(cache=True, nogil=True)
def fit_goal(
    shape: FloatArray,
    view: FloatArray,
    p: FloatArray,
    prior: FloatArray,
    weight: FloatArray,
    offsets: FloatArray,
    edge: Int64Array,
    uv: FloatArray,
    foot_post: Int64Array,
    foot_at: Int64Array,
    foot_uv: FloatArray,
    foot_direction: FloatArray,
    mark_m: FloatArray,
    mark_uv: FloatArray,
    mark_direction: FloatArray,
    sigma: FloatArray,
    scales: FloatArray,
    normal: FloatArray,
) -> float:
    """Gauss-Newton on the eight unknowns under priors, robust by Cauchy weights whose scale shrinks step by step.

    Parameters
    ----------
    shape, view, offsets : see `goal_prediction`
    p : (8,) float64
        Start, overwritten with the result.
    prior, weight : (8,) float64
        Expected unknowns and their inverse variances; a weight of infinity holds the unknown at its start.
    edge, uv, foot_post, foot_at, foot_uv, foot_direction, mark_m, mark_uv, mark_direction, sigma
        Edge samples (N), foot samples (M) and floor marks (L), with the noise (N + M + L) of all, pixels.
    scales : (K,) float64
        Cauchy scale of each iteration, pixels.
    normal : (8, 8) float64
        Result: the last iteration's normal matrix, priors included.

    Returns
    -------
    float
        The last iteration's `robust_cost`, or infinity where the fit broke down.
    """
    edges, first_mark = edge.shape[0], edge.shape[0] + foot_post.shape[0]
    count = first_mark + mark_m.shape[0]
    lines, feet = np.empty((6, 3)), np.empty((2, offsets.shape[0], 2))
    moved_lines, moved_feet = np.empty((6, 3)), np.empty((2, offsets.shape[0], 2))
    base, moved = np.empty(count), np.empty(count)
    by_line, jacobian = np.empty((8, 6, 3)), np.empty((count - edges, 8))
    moments, pull = np.empty((6, 3, 3)), np.empty((6, 3))
    free, freed = np.empty(8, np.int64), 0
    for k in range(8):
        if not math.isinf(weight[k]):
            free[freed] = k
            freed += 1
    step = np.array([1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-4])
    work, right = np.empty((8, 8)), np.empty(8)
    trial = np.empty(8)
    cost = np.inf
    goal_residuals(
        shape,
        view,
        p,
        offsets,
        edge,
        uv,
        foot_post,
        foot_at,
        foot_uv,
        foot_direction,
        mark_m,
        mark_uv,
        mark_direction,
        base,
    )
    for iteration in range(scales.shape[0]):
        goal_prediction(shape, view, p, offsets, lines, feet)
        for k in free[:freed]:
            trial[:] = p
            trial[k] += step[k]
            if k == 7:  # paint that bleeds moves every edge and foot alike, and no line on the floor
                by_line[k, :, :] = 0.0
                by_line[k, :, 2] = -1.0
                jacobian[: first_mark - edges, k] = -1.0
                jacobian[first_mark - edges :, k] = 0.0
                continue
            # the picture is a few lines and points: their derivatives serve all samples
            goal_prediction(shape, view, trial, offsets, moved_lines, moved_feet)
            for e in range(6):
                for i in range(3):
                    by_line[k, e, i] = (moved_lines[e, i] - lines[e, i]) / step[k]
            for n in range(foot_post.shape[0]):
                post, at = foot_post[n], foot_at[n]
                by_u = (moved_feet[post, at, 0] - feet[post, at, 0]) / step[k]
                by_v = (moved_feet[post, at, 1] - feet[post, at, 1]) / step[k]
                jacobian[n, k] = -by_u * foot_direction[n, 0] - by_v * foot_direction[n, 1]
            if mark_m.shape[0]:
                floor_residuals(view, trial, mark_m, mark_uv, mark_direction, moved[first_mark:])
                for n in range(first_mark, count):
                    jacobian[n - edges, k] = (moved[n] - base[n]) / step[k]
        normal[:, :] = 0.0
        right[:] = 0.0
        # a residual is linear in its line: of all samples on one edge only their second moments count
        moments[:, :, :] = 0.0
        pull[:, :] = 0.0
        for n in range(edges):
            if math.isnan(base[n]):
                return np.inf
            w = 1.0 / (sigma[n] ** 2 * (1.0 + (base[n] / scales[iteration]) ** 2))
            e, u, v = edge[n], uv[n, 0], uv[n, 1]
            wu, wv = w * u, w * v
            moments[e, 0, 0] += wu * u
            moments[e, 0, 1] += wu * v
            moments[e, 0, 2] += wu
            moments[e, 1, 1] += wv * v
            moments[e, 1, 2] += wv
            moments[e, 2, 2] += w
            pull[e, 0] += wu * base[n]
            pull[e, 1] += wv * base[n]
            pull[e, 2] += w * base[n]
        for e in range(6):
            moments[e, 1, 0], moments[e, 2, 0] = moments[e, 0, 1], moments[e, 0, 2]
            moments[e, 2, 1] = moments[e, 1, 2]
            for i in free[:freed]:
                d = by_line[i, e]
                right[i] -= d[0] * pull[e, 0] + d[1] * pull[e, 1] + d[2] * pull[e, 2]
                m0 = d[0] * moments[e, 0, 0] + d[1] * moments[e, 1, 0] + d[2] * moments[e, 2, 0]
                m1 = d[0] * moments[e, 0, 1] + d[1] * moments[e, 1, 1] + d[2] * moments[e, 2, 1]
                m2 = d[0] * moments[e, 0, 2] + d[1] * moments[e, 1, 2] + d[2] * moments[e, 2, 2]
                for j in free[:freed]:
                    if j <= i:
                        normal[i, j] += m0 * by_line[j, e, 0] + m1 * by_line[j, e, 1] + m2 * by_line[j, e, 2]
        for n in range(edges, count):
            if math.isnan(base[n]):
                return np.inf
            w = 1.0 / (sigma[n] ** 2 * (1.0 + (base[n] / scales[iteration]) ** 2))
            for i in free[:freed]:
                wj = w * jacobian[n - edges, i]
                right[i] -= wj * base[n]
                for j in free[:freed]:
                    if j <= i:
                        normal[i, j] += wj * jacobian[n - edges, j]
        for i in range(8):
            if math.isinf(weight[i]):
                normal[i, i] = 1.0
            else:
                normal[i, i] += weight[i] + 1e-9
                right[i] -= weight[i] * (p[i] - prior[i])
            for j in range(i):
                normal[j, i] = normal[i, j]
        work[:, :] = normal
        if not solve_symmetric(work, right):
            return np.inf
        # one step never goes further than the linear picture can hold, nor uphill
        limit = 1.0
        for i in range(8):
            bound = 1.0 if i < 2 else 0.3
            if i != 7 and abs(right[i]) > bound:
                limit = min(limit, bound / abs(right[i]))
        before = robust_cost(base, sigma, scales[iteration], p, prior, weight)
        for _ in range(5):
            for i in range(8):
                trial[i] = p[i] + limit * right[i]
            goal_residuals(
                shape,
                view,
                trial,
                offsets,
                edge,
                uv,
                foot_post,
                foot_at,
                foot_uv,
                foot_direction,
                mark_m,
                mark_uv,
                mark_direction,
                moved,
            )
            cost = robust_cost(moved, sigma, scales[iteration], trial, prior, weight)
            if cost <= before:
                p[:] = trial
                base, moved = moved, base
                break
            limit *= 0.4
            cost = before
        if scales[iteration] == scales[-1]:
            still = True
            for i in range(8):
                still = still and abs(limit * right[i]) < (1e-4 if i < 2 or i == 7 else 1e-5)
            if still:
                break
    return cost
