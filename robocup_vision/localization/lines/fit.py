"""A pose fitted to white line points, and what its covariance is.

Residuals are in PIXELS across the line, because what errs is the image, and an error of one pixel is a centimetre
beside the robot and half a metre at the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints


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
class LineRows:
    """Line points measured against the field's lines in the image.

    Parameters
    ----------
    residual : (N,) float64
        Distances from the nearest lines, px, never negative.
    jacobian : (N, P) float64
        Their derivatives by x, y (px/m), theta (px/rad) and whatever else is unknown.
    normal_px : (N, 2) float64
        Unit normals in the image, from the line towards the point.
    index : (N,) int64
        Which line or arc.
    """

    residual: FloatArray
    jacobian: FloatArray
    normal_px: FloatArray
    index: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class LineRowsFit:
    """Unknowns (P,) float64, pose first, fitted to line points, with the rows there.

    Parameters
    ----------
    unknowns : (P,) float64
        x, y (m), theta (rad) and what else was unknown.
    rows : LineRows
        At the end.
    scale_px : float
        Residuals well beyond this were ignored.
    information : (P, P) float64
        Of the prior.
    shared_px : (N,) float64
        See `fit_line_rows`.
    settings : LineFitSettings
        Of the fit.
    """

    unknowns: FloatArray
    rows: LineRows
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
        return _loss(self.rows.residual, weight, scale_px)

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
        sigma2 = max(_spread_px(residual, self.scale_px), settings.min_noise_px) ** 2
        weight = weights / (1 + (residual / self.scale_px) ** 2) ** 2 / (sigma2 + self.shared_px**2)
        fisher = (jacobian.T * weight) @ jacobian
        # one group per line and stretch of floor: what errs there errs together (a cluster-robust "sandwich")
        member = stretches(self.rows.index, floor_m, settings)
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


def fit_line_rows(
    rows_of: Callable[[FloatArray], LineRows],
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
    rows_of : callable
        From unknowns (P,) float64, pose first, to the points' rows.
    start : (P,) float64
        Where to start.
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
    shared = np.zeros(len(weights)) if shared_px is None else shared_px
    expected = start if expected is None else expected
    unknowns, rows = start.copy(), rows_of(start)
    scale = start_px
    for _ in range(settings.max_steps):
        sigma2 = max(_spread_px(rows.residual, scale), settings.min_noise_px) ** 2
        weight = weights / (sigma2 + shared**2)
        robust = weight / (1 + (rows.residual / scale) ** 2) ** 2
        offset = _offset(unknowns, expected)
        hessian = (rows.jacobian.T * robust) @ rows.jacobian + information
        gradient = rows.jacobian.T @ (robust * rows.residual) + information @ offset
        try:
            step = -np.linalg.solve(hessian + 1e-9 * np.trace(hessian) * np.eye(len(start)), gradient)
        except np.linalg.LinAlgError:
            return NotLocated("the lines in view do not fix the pose")
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        loss = _loss(rows.residual, weight, scale) + float(offset @ information @ offset)
        for _ in range(settings.max_halvings):
            tried = rows_of(unknowns + step)
            offset = _offset(unknowns + step, expected)
            # a valley of poses that tilt makes nearly alike bends: a whole step along it may climb its side
            if _loss(tried.residual, weight, scale) + float(offset @ information @ offset) <= loss:
                unknowns, rows = unknowns + step, tried
                break
            step = step / 2
        narrow = max(3 * math.sqrt(sigma2), 1.0)
        if scale <= narrow and float(np.abs(step).max()) < 1e-5:
            break
        scale = max(0.6 * scale, narrow) if scale > narrow else narrow
    return LineRowsFit(unknowns, rows, scale, information, shared, settings)


def _offset(unknowns: FloatArray, start: FloatArray) -> FloatArray:
    offset = unknowns - start
    offset[2] = wrap_angle(offset[2])
    return offset


def _loss(residual: FloatArray, weight: FloatArray, scale_px: float) -> float:
    """Sum what a fit with these weights makes least."""
    square = residual**2
    return float(np.sum(weight * square / (1 + square / scale_px**2)))


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
    fit = fit_line_rows(
        lambda unknowns: pixel_residuals(unknowns, points.floor_m, points.floor_per_px, line_map),
        pose.array,
        points.weight,
        information,
        start_px,
        settings=settings,
    )
    if isinstance(fit, NotLocated):
        return fit
    return fit.estimate(points.floor_m, points.weight)


def pixel_residuals(unknowns: FloatArray, floor_m: FloatArray, floor_per_px: FloatArray, line_map: LineMap) -> LineRows:
    """Measure line points against the field's lines in the image.

    Parameters
    ----------
    unknowns : (P,) float64
        The pose first; only it counts.
    floor_m, floor_per_px : (N, 2), (N, 2, 2) float64
        As in `LinePoints`.
    line_map : LineMap
        Of the field.

    Returns
    -------
    LineRows
        With derivatives (N, 3) by the pose.
    """
    c, s = math.cos(unknowns[2]), math.sin(unknowns[2])
    turned = floor_m @ np.array([[c, s], [-s, c]])
    near = line_map.nearest(turned + unknowns[:2])
    normal_in_robot = near.normal @ np.array([[c, -s], [s, c]])
    slope = np.einsum("ni,nij->nj", normal_in_robot, floor_per_px)
    metres_per_px = np.maximum(np.hypot(slope[:, 0], slope[:, 1]), 1e-9)
    by_theta = near.normal[:, 1] * turned[:, 0] - near.normal[:, 0] * turned[:, 1]
    jacobian = np.column_stack([near.normal, by_theta]) / metres_per_px[:, None]
    return LineRows(near.distance_m / metres_per_px, jacobian, slope / metres_per_px[:, None], near.index)


def _spread_px(residual: FloatArray, within: float) -> float:
    """Robust standard deviation of unsigned residuals, from those within a bound."""
    good = residual <= 2 * within
    return 1.48 * float(np.median(residual[good])) if good.any() else within
