"""A pose fitted to white line points, and what its covariance is.

Residuals are in PIXELS across the line, because what errs is the image, and an error of one pixel is a centimetre
beside the robot and half a metre at the horizon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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
    loss_of,
    measure_points,
    spread_px,
)
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints

_NO_RAYS, _NO_MOUNT = np.empty((0, 5, 3)), np.zeros(6)


@dataclass(frozen=True, slots=True)
class LineFitSettings:
    """Settings of the fit in pixels.

    Parameters
    ----------
    min_noise_px : float
        No single point is better than this, however smooth the picture.
    hidden_shift : float
        A wrong centre or tilt shifts whole stretches of line together. The pose takes up most of such a shift, the
        residuals keep the rest: the shift is taken to be this many times what the stretches are off by on average.
    correlation_m : float
        Length of floor over which neighbours along a line have common errors of lens, carpet and paint.
    max_steps, max_halvings : int
        Gauss-Newton steps, and how often one is halved.
    inlier_px : float
        A point within this many pixels of a line agrees with a pose.
    min_points : int
        Fewer agreeing points determine no pose.
    """

    min_noise_px: float = 0.1
    hidden_shift: float = 2.0
    correlation_m: float = 0.5
    max_steps: int = 15
    max_halvings: int = 4
    inlier_px: float = 3.0
    min_points: int = 18


@dataclass(frozen=True, slots=True, eq=False)
class LineRowsFit:
    """Unknowns (P,) float64, pose first, fitted to line points, with the rows there.

    Parameters
    ----------
    unknowns : (P,) float64
        x, y (m), theta (rad) and what else was unknown.
    rows : PointRows
        At the end.
    scale_px : float
        Residuals well beyond this were ignored.
    information : (P, P) float64
        Of the prior.
    shared_px : (N,) float64
        See `fit_line_points`.
    settings : LineFitSettings
        Of the fit.
    """

    unknowns: FloatArray
    rows: PointRows
    scale_px: float
    information: FloatArray
    shared_px: FloatArray
    settings: LineFitSettings

    def loss(self, weights: FloatArray, scale_px: float) -> float:
        """Sum the robust loss of the points, in chi-square: to compare fits of the same points.

        Parameters
        ----------
        weights : (N,) float64
            Of the points.
        scale_px : float
            Residuals beyond this count hardly more than this.
        """
        weight = weights / (scale_px**2 / 9 + self.shared_px**2)
        return float(loss_of(self.rows.residual, weight, scale_px))

    def estimate(self, floor_m: FloatArray, weights: FloatArray) -> PoseEstimate | NotLocated:
        """Pose and its covariance, the other unknowns' uncertainty included.

        Parameters
        ----------
        floor_m : (N, 2) float64
            The points on the floor, robot frame: neighbours there err together.
        weights : (N,) float64
            Of the points.
        """
        settings = self.settings
        residual, jacobian, size = self.rows.residual, self.rows.jacobian, len(self.unknowns)
        good = residual <= settings.inlier_px
        if np.count_nonzero(good) < settings.min_points:
            return NotLocated("too few line points lie on lines")
        sigma2 = max(spread_px(residual, self.scale_px, np.empty((2, len(residual) + 1))), settings.min_noise_px) ** 2
        weight = weights / (1 + (residual / self.scale_px) ** 2) ** 2 / (sigma2 + self.shared_px**2)
        fisher = (jacobian.T * weight) @ jacobian
        # one group per line and stretch of floor: what errs there errs together (a cluster-robust "sandwich")
        member = stretches(self.rows.nearest, floor_m, settings)
        count = np.bincount(member)
        scores = np.zeros((len(count), size))
        np.add.at(scores, member, jacobian * (weight * residual)[:, None])
        spread = scores.T @ scores * (len(count) / max(len(count) - size, 1))
        shifts = np.zeros((len(count), 2))
        np.add.at(shifts, member, self.rows.normal_px * np.where(good, residual, 0.0)[:, None])
        long = count >= 5
        shift2_px2 = float(np.mean((shifts[long] / count[long, None]) ** 2)) * 2 if long.any() else sigma2
        pull = jacobian.T @ (self.rows.normal_px * weight[:, None])
        meat = fisher + spread + settings.hidden_shift**2 * shift2_px2 * (pull @ pull.T) + self.information
        try:
            bread = np.linalg.inv(fisher + self.information)
        except np.linalg.LinAlgError:
            return NotLocated("the lines in view do not fix the pose")
        covariance = (bread @ meat @ bread)[:3, :3]
        known = np.isfinite(covariance).all() and np.isfinite(self.unknowns).all()
        if not (known and (np.diag(covariance) > 0).all()):
            return NotLocated("the lines in view do not fix the pose")
        return PoseEstimate(
            Pose2(*self.unknowns[:3].tolist()),
            (covariance + covariance.T) / 2,
            float(weights[good].sum() / weights.sum()),
            float(np.sqrt(np.mean(residual[good] ** 2))),
        )


def seen_points(points: LinePoints, line_map: LineMap) -> SeenPoints:
    """Return line points (N) of an upright body as the compiled fit takes them."""
    # copies: what is read only would be compiled for once more
    return SeenPoints(
        np.array(points.floor_m), np.array(points.floor_per_px), _NO_RAYS, _NO_MOUNT, line_map.lines, line_map.arcs
    )


def measure(unknowns: FloatArray, seen: SeenPoints, count: int) -> PointRows:
    """Measure so many line points against the field's lines in the image, from unknowns (P,), the pose first."""
    rows = _room(count, len(unknowns))
    measure_points(unknowns, seen, rows)
    return rows


def _room(count: int, size: int) -> PointRows:
    """Return arrays for so many line points, measured by so many unknowns."""
    return PointRows(np.empty(count), np.empty((count, size)), np.empty((count, 2)), np.empty(count, dtype=np.int64))


def fit_line_points(
    seen: SeenPoints,
    start: FloatArray,
    weights: FloatArray,
    information: FloatArray,
    start_px: float,
    *,
    expected: FloatArray | None = None,
    shared_px: FloatArray | None = None,
    settings: LineFitSettings = LineFitSettings(),
) -> LineRowsFit | NotLocated:
    """Fit unknowns to line points, taking in ever fewer that lie off.

    Parameters
    ----------
    seen : SeenPoints
        The points.
    start : (P,) float64
        Where to start: x, y (m), theta (rad) and, where the body sways, tilt and roll.
    weights : (N,) float64
        Of the points.
    information : (P, P) float64
        Inverse covariance of what is expected; zeros: nothing is.
    start_px : float
        Residuals well beyond this are ignored from the first step on.
    expected : (P,) float64, optional
        What is expected; `start` unless given.
    shared_px : (N,) float64, optional
        Error of each point that its neighbours have in common, times the square root of their number: so many
        of them then weigh together no more than one that has that error alone.
    settings : LineFitSettings, optional
        Of the fit.
    """
    count, weights = len(weights), np.array(weights)
    shared = np.zeros(count) if shared_px is None else shared_px
    unknowns, rows = start.copy(), _room(count, len(start))
    rules = PointFitRules(settings.min_noise_px, settings.max_steps, settings.max_halvings)
    scale = fit_points(
        unknowns, seen, weights, start if expected is None else expected, information, shared, start_px, rules, rows
    )
    if not math.isfinite(scale):
        return NotLocated("the lines in view do not fix the pose")
    return LineRowsFit(unknowns, rows, scale, information, shared, settings)


def stretches(
    index: npt.NDArray[np.int64], floor_m: FloatArray, settings: LineFitSettings = LineFitSettings()
) -> npt.NDArray[np.int64]:
    """Return the stretch of line that each point lies on, (N,): one line, one patch of floor."""
    patch = np.floor(floor_m / settings.correlation_m).astype(np.int64)
    _, member = np.unique((index * 40_009 + patch[:, 0]) * 40_009 + patch[:, 1], return_inverse=True)
    return np.asarray(member.ravel(), dtype=np.int64)


def refine_by_lines(
    pose: Pose2,
    points: LinePoints,
    line_map: LineMap,
    prior_covariance: FloatArray | None = None,
    *,
    start_px: float = 8.0,
    settings: LineFitSettings = LineFitSettings(),
) -> PoseEstimate | NotLocated:
    """Refine a pose by line points, with residuals in pixels across the lines.

    Parameters
    ----------
    pose : Pose2
        Where to start.
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field.
    prior_covariance : (3, 3) float64, optional
        How well `pose` is known beforehand; it then counts as a measurement of its own.
    start_px : float
        Residuals well beyond this are ignored from the first step on.
    settings : LineFitSettings, optional
        Of the fit.
    """
    low, high = line_map.extent_m
    points = points.take(np.hypot(*points.floor_m.T) <= np.hypot(*(high - low)))
    if len(points) < settings.min_points:
        return NotLocated(f"only {len(points)} line points")
    information = np.zeros((3, 3)) if prior_covariance is None else np.asarray(np.linalg.inv(prior_covariance))
    fit = fit_line_points(
        seen_points(points, line_map), pose.array, points.weight, information, start_px, settings=settings
    )
    if isinstance(fit, NotLocated):
        return fit
    return fit.estimate(points.floor_m, points.weight)


def residuals_px(pose: Pose2, points: LinePoints, line_map: LineMap) -> FloatArray:
    """Return how far line points lie off the lines by a pose, (N,) float64, px, never negative."""
    return measure(pose.array, seen_points(points, line_map), len(points)).residual
