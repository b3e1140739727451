"""Compiled fit of a pose, and of tilt and roll where the body sways, to white line points: all steps in one call."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import solve_symmetric
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.algebra.order import quantiles
from robocup_vision.kernels.algebra.pinhole import Axis, camera_axes
from robocup_vision.kernels.lines.lines import ANYWHERE2, nearest_line

# a point is mapped to the floor with those so many pixels about it, and under tilt and roll turned by so much
AROUND_PX, TURN_RAD = 0.5, 1e-5
# a point that a tilt puts above the horizon is so far off any line
NOWHERE_PX = 1e6
Pair = tuple[float, float]


class SeenPoints(NamedTuple):
    """Line points of a frame, robot frame.

    Parameters
    ----------
    floor_m, floor_per_px : (N, 2), (N, 2, 2) float64
        As in `LinePoints`; not asked for where the body sways.
    rays : (N, 5, 3) or (0, 5, 3) float64
        Where the body sways: directions, camera frame, of the pixel and of those `AROUND_PX` right, left, below and
        above.
    mount : (6,) float64
        Pan, tilt and roll, height over the floor, and x and y of the camera, as its file says.
    lines, arcs : (L, 4), (A, 5) float64
        Of the field.
    """

    floor_m: FloatArray
    floor_per_px: FloatArray
    rays: FloatArray
    mount: FloatArray
    lines: FloatArray
    arcs: FloatArray


class PointRows(NamedTuple):
    """Line points measured against the nearest lines in the image.

    Parameters
    ----------
    residual : (N,) float64
        Distances, px, never negative.
    jacobian : (N, P) float64
        Their derivatives by the unknowns: x, y, theta and, where the body sways, tilt and roll.
    normal_px : (N, 2) float64
        Unit normals in the image, from the line towards the point.
    nearest : (N,) int64
        Which line or arc.
    """

    residual: FloatArray
    jacobian: FloatArray
    normal_px: FloatArray
    nearest: Int64Array


class PointFitRules(NamedTuple):
    """As `LineFitSettings` says; see there."""

    min_noise_px: float
    max_steps: int
    max_halvings: int


@compiled(error_model="numpy")
def _on_floor(axes: tuple[Axis, Axis, Axis], rays: FloatArray, n: int, mount: FloatArray) -> Pair:
    """Return the floor point, robot frame, of one of some rays (5, 3); NaN from the horizon on."""
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = axes
    ahead, left, up = rays[n, 0], rays[n, 1], rays[n, 2]
    down = r20 * ahead + r21 * left + r22 * up
    reach = -mount[3] / down if down < -1e-3 else np.nan
    return (
        mount[4] + (r00 * ahead + r01 * left + r02 * up) * reach,
        mount[5] + (r10 * ahead + r11 * left + r12 * up) * reach,
    )


@compiled(error_model="numpy")
def measure_points(unknowns: FloatArray, seen: SeenPoints, rows: PointRows) -> None:
    """Measure line points from a pose.

    Parameters
    ----------
    unknowns : (3,) or (5,) float64
        x, y (m) and theta (rad); where the body sways, tilt and roll beyond the file's, too.
    seen : SeenPoints
        The points.
    rows : PointRows
        Result.
    """
    sways = unknowns.shape[0] > 3
    tilt, roll = (unknowns[3], unknowns[4]) if sways else (0.0, 0.0)
    pan, tilt, roll = seen.mount[0], seen.mount[1] + tilt, seen.mount[2] + roll
    held, tilted = camera_axes(pan, tilt, roll), camera_axes(pan, tilt + TURN_RAD, roll)
    rolled = camera_axes(pan, tilt, roll + TURN_RAD)
    c, s = math.cos(unknowns[2]), math.sin(unknowns[2])
    for n in range(rows.residual.shape[0]):
        shown = True
        by_tilt, by_roll = (0.0, 0.0), (0.0, 0.0)
        if sways:
            rays = seen.rays[n]
            x, y = _on_floor(held, rays, 0, seen.mount)
            right, left = _on_floor(held, rays, 1, seen.mount), _on_floor(held, rays, 2, seen.mount)
            below, above = _on_floor(held, rays, 3, seen.mount), _on_floor(held, rays, 4, seen.mount)
            x_by_u, x_by_v = (right[0] - left[0]) / (2 * AROUND_PX), (below[0] - above[0]) / (2 * AROUND_PX)
            y_by_u, y_by_v = (right[1] - left[1]) / (2 * AROUND_PX), (below[1] - above[1]) / (2 * AROUND_PX)
            turned = _on_floor(tilted, rays, 0, seen.mount)
            by_tilt = (turned[0] - x) / TURN_RAD, (turned[1] - y) / TURN_RAD
            turned = _on_floor(rolled, rays, 0, seen.mount)
            by_roll = (turned[0] - x) / TURN_RAD, (turned[1] - y) / TURN_RAD
            shown = math.isfinite(x + y + x_by_u + x_by_v + y_by_u + y_by_v)
            shown = shown and math.isfinite(by_tilt[0] + by_tilt[1] + by_roll[0] + by_roll[1])
            if not shown:
                x, y, x_by_u, x_by_v, y_by_u, y_by_v = 0.0, 0.0, 1.0, 1.0, 1.0, 1.0
        else:
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
        if shown:
            rows.residual[n] = distance / per_px
            rows.jacobian[n, 0], rows.jacobian[n, 1] = normal_x / per_px, normal_y / per_px
            rows.jacobian[n, 2] = (normal_y * from_x - normal_x * from_y) / per_px
            if sways:
                rows.jacobian[n, 3] = (ahead * by_tilt[0] + aside * by_tilt[1]) / per_px
                rows.jacobian[n, 4] = (ahead * by_roll[0] + aside * by_roll[1]) / per_px
        else:
            rows.residual[n] = NOWHERE_PX
            for i in range(unknowns.shape[0]):
                rows.jacobian[n, i] = 0.0


@compiled(error_model="numpy")
def spread_px(residual: FloatArray, within_px: float, scratch: FloatArray) -> float:
    """Robust standard deviation of unsigned residuals (N,), from those within twice a bound; scratch: (2, N + 1)."""
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
    """Sum what a fit with these weights (N,) makes least."""
    total = 0.0
    for n in range(residual.shape[0]):
        square = residual[n] * residual[n]
        total += weight[n] * square / (1.0 + square / (scale_px * scale_px))
    return total


@compiled
def _off_expected(unknowns: FloatArray, expected: FloatArray, information: FloatArray, pull: FloatArray) -> float:
    """Return the chi-square of a deviation (P,) from what is expected, and fill its pull (P,)."""
    offset = unknowns - expected
    offset[2] -= 2.0 * math.pi * np.rint(offset[2] / (2.0 * math.pi))
    total = 0.0
    for i in range(offset.shape[0]):
        pull[i] = 0.0
        for j in range(offset.shape[0]):
            pull[i] += information[i, j] * offset[j]
        total += offset[i] * pull[i]
    return total


@compiled(error_model="numpy")
def fit_points(
    unknowns: FloatArray,
    seen: SeenPoints,
    weights: FloatArray,
    expected: FloatArray,
    information: FloatArray,
    shared_px: FloatArray,
    start_px: float,
    rules: PointFitRules,
    rows: PointRows,
) -> float:
    """Fit unknowns to line points by Gauss-Newton, taking in ever fewer that lie off.

    Parameters
    ----------
    unknowns : (P,) float64
        In: where to start. Out: what was found.
    seen : SeenPoints
        N points.
    weights, shared_px : (N,) float64
        Of the points; see `fit_line_points`.
    expected, information : (P,), (P, P) float64
        What is expected, and its inverse covariance; zeros: nothing is.
    start_px : float
        Residuals well beyond this are ignored from the first step on.
    rules : PointFitRules
        May be plain.
    rows : PointRows
        Result: from what was found.

    Returns
    -------
    float
        Residuals well beyond this were ignored, px; NaN where the points do not fix the unknowns.
    """
    known = PointFitRules(*rules)
    count, size = rows.residual.shape[0], unknowns.shape[0]
    tried_rows = PointRows(
        np.empty(count), np.empty((count, size)), np.empty((count, 2)), np.empty(count, np.int64)
    )  # fmt: skip
    weight, scratch = np.empty(count), np.empty((2, count + 1))
    hessian, step, pull, tried = np.empty((size, size)), np.empty(size), np.empty(size), np.empty(size)
    measure_points(unknowns, seen, rows)
    scale = start_px
    for _ in range(known.max_steps):
        noise = max(spread_px(rows.residual, scale, scratch), known.min_noise_px)
        loss = _off_expected(unknowns, expected, information, pull)
        for i in range(size):
            step[i] = -pull[i]
            for j in range(size):
                hessian[i, j] = information[i, j]
        for n in range(count):
            weight[n] = weights[n] / (noise * noise + shared_px[n] * shared_px[n])
            ratio = rows.residual[n] / scale
            robust = weight[n] / (1.0 + ratio * ratio) ** 2
            for i in range(size):
                told = robust * rows.jacobian[n, i]
                step[i] -= told * rows.residual[n]
                for j in range(i + 1):
                    hessian[i, j] += told * rows.jacobian[n, j]
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
        loss += loss_of(rows.residual, weight, scale)
        for _ in range(known.max_halvings):
            for i in range(size):
                tried[i] = unknowns[i] + step[i]
            measure_points(tried, seen, tried_rows)
            off = _off_expected(tried, expected, information, pull)
            # a valley of poses that tilt makes nearly alike bends: a whole step along it may climb its side
            if loss_of(tried_rows.residual, weight, scale) + off <= loss:
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
    """Copy what was measured, loop by loop."""
    copy_vector(rows.residual, out.residual)
    copy_vector(rows.jacobian.reshape(-1), out.jacobian.reshape(-1))
    copy_vector(rows.normal_px.reshape(-1), out.normal_px.reshape(-1))
    for n in range(rows.nearest.shape[0]):
        out.nearest[n] = rows.nearest[n]
