"""Compiled fit of a pose to white line points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import solve_symmetric
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.algebra.order import quantiles
from robocup_vision.kernels.lines.lines import ANYWHERE2, nearest_line


class SeenPoints(NamedTuple):
    """Line points of a frame, robot frame.

    Parameters
    ----------
    floor_m, floor_per_px : (N, 2), (N, 2, 2) float64
        As in `LinePoints`.
    lines, arcs : (L, 4), (A, 5) float64
        Lines and arcs of the field.
    """

    floor_m: FloatArray
    floor_per_px: FloatArray
    lines: FloatArray
    arcs: FloatArray


class PointRows(NamedTuple):
    """Residuals of line points against the nearest lines, in the image.

    Parameters
    ----------
    residual : (N,) float64
        Unsigned distances, px.
    jacobian : (N, 3) float64
        Their derivatives by x, y and theta.
    normal_px : (N, 2) float64
        Unit normals in the image, from the line towards the point.
    nearest : (N,) int64
        Index of the nearest line or arc.
    """

    residual: FloatArray
    jacobian: FloatArray
    normal_px: FloatArray
    nearest: Int64Array


class PointFitRules(NamedTuple):
    """Least noise of a point (pixels), and greatest numbers of steps and of halvings of one."""

    min_noise_px: float
    max_steps: int
    max_halvings: int


@compiled(error_model="numpy")
def measure_points(unknowns: FloatArray, seen: SeenPoints, rows: PointRows) -> None:
    """Compute residuals and derivatives of line points at a pose.

    Parameters
    ----------
    unknowns : (3,) float64
        x, y (m) and theta (rad).
    seen : SeenPoints
        The points.
    rows : PointRows
        Filled.
    """
    c, s = math.cos(unknowns[2]), math.sin(unknowns[2])
    for n in range(rows.residual.shape[0]):
        x, y = seen.floor_m[n, 0], seen.floor_m[n, 1]
        x_by_u, x_by_v = seen.floor_per_px[n, 0, 0], seen.floor_per_px[n, 0, 1]
        y_by_u, y_by_v = seen.floor_per_px[n, 1, 0], seen.floor_per_px[n, 1, 1]
        from_x, from_y = c * x - s * y, s * x + c * y
        distance, normal_x, normal_y, rows.nearest[n] = nearest_line(
            from_x + unknowns[0], from_y + unknowns[1], seen.lines, seen.arcs, ANYWHERE2
        )
        ahead, aside = c * normal_x + s * normal_y, c * normal_y - s * normal_x
        along_u, along_v = ahead * x_by_u + aside * y_by_u, ahead * x_by_v + aside * y_by_v
        per_px = max(math.hypot(along_u, along_v), 1e-9)
        rows.normal_px[n, 0], rows.normal_px[n, 1] = along_u / per_px, along_v / per_px
        rows.residual[n] = distance / per_px
        rows.jacobian[n, 0], rows.jacobian[n, 1] = normal_x / per_px, normal_y / per_px
        rows.jacobian[n, 2] = (normal_y * from_x - normal_x * from_y) / per_px


@compiled(error_model="numpy")
def spread_px(residual: FloatArray, within_px: float, scratch: FloatArray) -> float:
    """Robust standard deviation of unsigned residuals (N,), of those within twice a bound; scratch: (2, N + 1)."""
    count = 0
    for e in residual:
        if e <= 2.0 * within_px:
            scratch[0, count] = e
            count += 1
    if count == 0:
        return within_px
    median = np.empty(1)
    quantiles(scratch[0, :count], np.full(1, 0.5), scratch[1], median)
    return 1.48 * float(median[0])


@compiled(error_model="numpy")
def loss_of(residual: FloatArray, weight: FloatArray, scale_px: float) -> float:
    """Return the robust cost that a fit with these weights (N,) minimises."""
    total = 0.0
    for n in range(residual.shape[0]):
        square = residual[n] * residual[n]
        total += weight[n] * square / (1.0 + square / (scale_px * scale_px))
    return total


@compiled(error_model="numpy")
def fit_points(
    unknowns: FloatArray,
    seen: SeenPoints,
    weights: FloatArray,
    start_px: float,
    rules: PointFitRules,
    rows: PointRows,
) -> float:
    """Fit unknowns to line points by Gauss-Newton with a robust scale that decreases.

    Parameters
    ----------
    unknowns : (3,) float64
        In: start. Out: result.
    seen : SeenPoints
        N points.
    weights : (N,) float64
        Weights of the points.
    start_px : float
        Robust scale of the first step; residuals far above it have no influence.
    rules : PointFitRules
        Settings; may be a plain tuple.
    rows : PointRows
        Filled with the residuals at the result.

    Returns
    -------
    float
        Robust scale of the last step, px; NaN if the points do not determine the unknowns.
    """
    known = PointFitRules(*rules)
    count, size = rows.residual.shape[0], unknowns.shape[0]
    tried_rows = PointRows(
        np.empty(count), np.empty((count, size)), np.empty((count, 2)), np.empty(count, np.int64)
    )  # fmt: skip
    weight, scratch = np.empty(count), np.empty((2, count + 1))
    hessian, step, tried = np.empty((size, size)), np.empty(size), np.empty(size)
    measure_points(unknowns, seen, rows)
    scale = start_px
    for _ in range(known.max_steps):
        noise = max(spread_px(rows.residual, scale, scratch), known.min_noise_px)
        for i in range(size):
            step[i] = 0.0
            for j in range(size):
                hessian[i, j] = 0.0
        for n in range(count):
            weight[n] = weights[n] / (noise * noise)
            ratio = rows.residual[n] / scale
            robust = weight[n] / (1.0 + ratio * ratio) ** 2
            for i in range(size):
                weighted = robust * rows.jacobian[n, i]
                step[i] -= weighted * rows.residual[n]
                for j in range(i + 1):
                    hessian[i, j] += weighted * rows.jacobian[n, j]
        trace = 0.0
        for i in range(size):
            trace += hessian[i, i]
        for i in range(size):
            hessian[i, i] += 1e-9 * trace
        if not solve_symmetric(hessian, step):
            return np.nan
        largest = 0.0
        for i in range(size):
            largest = max(largest, abs(step[i]))
        for i in range(size):
            step[i] *= min(1.0, 0.3 / max(largest, 1e-12))
        loss = loss_of(rows.residual, weight, scale)
        for _ in range(known.max_halvings):
            for i in range(size):
                tried[i] = unknowns[i] + step[i]
            measure_points(tried, seen, tried_rows)
            if loss_of(tried_rows.residual, weight, scale) <= loss:
                copy_vector(tried, unknowns)
                _copy_rows(tried_rows, rows)
                break
            for i in range(size):
                step[i] /= 2.0
        narrow = max(3.0 * noise, 1.0)
        largest = 0.0
        for i in range(size):
            largest = max(largest, abs(step[i]))
        if scale <= narrow and largest < 1e-5:
            break
        scale = max(0.6 * scale, narrow) if scale > narrow else narrow
    return scale


@compiled
def _copy_rows(rows: PointRows, out: PointRows) -> None:
    """Copy residuals, derivatives, normals and indices."""
    copy_vector(rows.residual, out.residual)
    copy_vector(rows.jacobian.reshape(-1), out.jacobian.reshape(-1))
    copy_vector(rows.normal_px.reshape(-1), out.normal_px.reshape(-1))
    for n in range(rows.nearest.shape[0]):
        out.nearest[n] = rows.nearest[n]
