"""Fit of a pose to white line points, with its covariance.

Residuals are in pixels across the line, because the errors are those of the image: one pixel is a centimetre beside the
robot and half a metre at the horizon.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.lines.pose_fit import (
    PointFitRules,
    PointRows,
    SeenPoints,
    fit_points,
    measure_points,
    spread_px,
)
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import MIN_POINTS
from robocup_vision.perception.line_points import LinePoints

# robust scale of the first step
_START_PX = 8.0
_MIN_NOISE_PX = 0.1  # least standard deviation of a single point
# a wrong centre or tilt shifts whole stretches of line. The pose absorbs most of the shift and the residuals show
# the rest, so that the shift is estimated as this multiple of the mean residual of the stretches.
_HIDDEN_SHIFT = 2.0
# length on the floor over which errors of lens, carpet and paint along a line are correlated
_CORRELATION_M = 0.5
# Gauss-Newton steps, and halvings of one step
_MAX_STEPS = 15
_MAX_HALVINGS = 4
_INLIER_PX = 3.0  # greatest residual of an inlier


def seen_points(points: LinePoints, line_map: LineMap) -> SeenPoints:
    """Return line points (N) in the format of the compiled fit."""
    # copies, because the loop would be compiled again for read-only arrays
    return SeenPoints(np.array(points.floor_m), np.array(points.floor_per_px), line_map.lines, line_map.arcs)


def _empty_rows(count: int) -> PointRows:
    """Return arrays for the residuals of this number of line points."""
    return PointRows(np.empty(count), np.empty((count, 3)), np.empty((count, 2)), np.empty(count, dtype=np.int64))


def stretches(index: npt.NDArray[np.int64], floor_m: FloatArray) -> npt.NDArray[np.int64]:
    """Return the index (N,) of each point's stretch: one line in one square of the floor."""
    patch = np.floor(floor_m / _CORRELATION_M).astype(np.int64)
    _, member = np.unique((index * 40_009 + patch[:, 0]) * 40_009 + patch[:, 1], return_inverse=True)
    return np.asarray(member.ravel(), dtype=np.int64)


def refine_by_lines(
    pose: Pose2,
    points: LinePoints,
    line_map: LineMap,
) -> PoseEstimate | NotLocated:
    """Refine a pose by line points."""
    points = line_map.within_reach(points)
    if len(points) < MIN_POINTS:
        return NotLocated(f"only {len(points)} line points")
    unknowns, rows = pose.array.copy(), _empty_rows(len(points))
    rules = PointFitRules(_MIN_NOISE_PX, _MAX_STEPS, _MAX_HALVINGS)
    scale = fit_points(unknowns, seen_points(points, line_map), np.array(points.weight), _START_PX, rules, rows)
    if not math.isfinite(scale):
        return NotLocated("the lines in view do not fix the pose")
    return _estimate(unknowns, rows, scale, points)


def _estimate(unknowns: FloatArray, rows: PointRows, scale_px: float, points: LinePoints) -> PoseEstimate | NotLocated:
    """Return a fitted pose x, y, theta with its covariance; `scale_px` is the last robust scale of the fit."""
    residual, jacobian, weights = rows.residual, rows.jacobian, points.weight
    good = residual <= _INLIER_PX
    if np.count_nonzero(good) < MIN_POINTS:
        return NotLocated("too few line points lie on lines")
    sigma2 = max(spread_px(residual, scale_px, np.empty((2, len(residual) + 1))), _MIN_NOISE_PX) ** 2
    weight = weights / (1 + (residual / scale_px) ** 2) ** 2 / sigma2
    fisher = (jacobian.T * weight) @ jacobian
    # cluster-robust sandwich covariance with the stretches as groups, because errors within one are correlated
    member = stretches(rows.nearest, points.floor_m)
    count = np.bincount(member)
    scores = np.zeros((len(count), 3))
    np.add.at(scores, member, jacobian * (weight * residual)[:, None])
    spread = scores.T @ scores * (len(count) / max(len(count) - 3, 1))
    shifts = np.zeros((len(count), 2))
    np.add.at(shifts, member, rows.normal_px * np.where(good, residual, 0.0)[:, None])
    long = count >= 5
    shift2_px2 = float(np.mean((shifts[long] / count[long, None]) ** 2)) * 2 if long.any() else sigma2
    pull = jacobian.T @ (rows.normal_px * weight[:, None])
    meat = fisher + spread + _HIDDEN_SHIFT**2 * shift2_px2 * (pull @ pull.T)
    try:
        bread = np.linalg.inv(fisher)
    except np.linalg.LinAlgError:
        return NotLocated("the lines in view do not fix the pose")
    covariance = bread @ meat @ bread
    known = np.isfinite(covariance).all() and np.isfinite(unknowns).all()
    if not (known and (np.diag(covariance) > 0).all()):
        return NotLocated("the lines in view do not fix the pose")
    return PoseEstimate(
        Pose2(*unknowns.tolist()),
        (covariance + covariance.T) / 2,
        float(weights[good].sum() / weights.sum()),
        float(np.sqrt(np.mean(residual[good] ** 2))),
    )


def residuals_of(pose: Pose2, seen: SeenPoints) -> PointRows:
    """Return the residuals of `seen_points` at a pose, with their derivatives and nearest lines."""
    rows = _empty_rows(len(seen.floor_m))
    measure_points(pose.array, seen, rows)
    return rows
