"""Pose from the floor's outline: sub-pixel edges of the floor, fitted to the walls the field file knows.

The paper's hull and principal axis (Sekimori et al. 2001, section 4) give the start. The fit is in image radius, where
the measurement's error is uniform, written in q = 1/range, where every wall is straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2
from robocup_vision.perception import kernels
from robocup_vision.perception.polar_view import PolarView

# pixels: from the hull's first guess down to the edges' own accuracy
_SCALES_PX = np.array([8.0, 8.0, 5.0, 3.0, 2.0, 1.0, 1.0, 1.0])
_COARSE_SCALES_PX = np.array([8.0, 8.0, 6.0, 4.0, 2.0])
_PRIOR_SCALES_PX = np.array([2.0, 1.0, 1.0])
_INLIER_PX = 1.5
_GOOD_COST = 0.25
_LEAST_INLIER_SHARE = 0.3
_LEAST_BEARINGS = 20
# what no image tells: the camera file's own error, in pixels common to neighbouring edges
_SYSTEMATIC_PX = 0.03


@dataclass(frozen=True, eq=False)
class FloorLocalizer:
    """Fits a measured floor outline to a field's walls.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards.
    camera : OmniCamera
        The camera.
    view : PolarView
        Defines the bearings of the outline.

    Raises
    ------
    ArgumentError
        If nothing bounds the field's floor.
    """

    field: Field
    camera: OmniCamera
    view: PolarView

    def __post_init__(self) -> None:
        if not self.field.is_bounded:
            raise ArgumentError(
                f"method 'floor' needs walls or boards, but the floor of '{self.field.name}' is not bounded (carpet)"
            )

    @cached_property
    def _cos(self) -> FloatArray:
        return np.cos(self.view.bearing_rad)

    @cached_property
    def _sin(self) -> FloatArray:
        return np.sin(self.view.bearing_rad)

    @cached_property
    def _radius_of_q(self) -> tuple[float, FloatArray]:
        inner, outer = self.camera.usable_radius_px
        top = float(self.camera.floor_range.inverse_range_per_m(inner))
        q = np.linspace(0.0, top, 1024)
        radius = self.camera.floor_range.radius_px(q)
        # a table does not reach the horizon: beyond its last range nothing is seen
        return float(q[1]), np.where(np.isfinite(radius), radius, outer)

    @cached_property
    def _geometry(self) -> tuple[FloatArray, float, float, float, FloatArray]:
        x, y, height = self.camera.viewpoint_m
        to_camera = np.ascontiguousarray(self.camera.camera_to_robot.T)
        return np.ascontiguousarray(self.field.walls), float(x), float(y), float(height), to_camera

    @cached_property
    def _farthest_m(self) -> float:
        return float(np.ptp(self.field.floor_polygon, axis=0).max()) * 1.2

    def first_guess(self, radius_px: FloatArray) -> Pose2 | None:
        """Pose from the outline's convex hull, taken in the image, by its centroid and principal axis (paper, step 5).

        Parameters
        ----------
        radius_px : (K,) float64
            Image radius of the floor's edge at each bearing, NaN where none.

        Returns
        -------
        Pose2 or None
            One of the two headings, or None with fewer than three points.
        """
        hull = np.empty_like(radius_px)
        if kernels.hull_radius(self._cos, self._sin, radius_px, hull) < 3:
            return None
        q = np.maximum(self.camera.floor_range.inverse_range_per_m(hull), 1.0 / self._farthest_m)
        x, y, axis = kernels.star_moments(
            self._cos, self._sin, 1.0 / np.where(np.isfinite(q), q, 1.0 / self._farthest_m)
        )
        return Pose2(x, y, axis).inverse()

    def locate(self, radius_px: FloatArray, prior: PoseEstimate | None = None) -> PoseEstimate | NotLocated:
        """Fit the outline.

        Parameters
        ----------
        radius_px : (K,) float64
            Image radius of the floor's edge at each of the view's bearings, NaN where none.
        prior : PoseEstimate, optional
            Where the robot probably is: a start, and, if the outline agrees with it, the only one.

        Returns
        -------
        PoseEstimate or NotLocated
            With both half-turn candidates in no particular order: the outline alone cannot tell them apart.
        """
        known = int(np.count_nonzero(radius_px > 0))
        if known < _LEAST_BEARINGS:
            return NotLocated(f"the floor's edge is seen in only {known} of {len(radius_px)} directions")
        fit = None
        if prior is not None:
            fit = self._fit(prior.pose.array[None], radius_px, 1, _PRIOR_SCALES_PX)
        if fit is None or fit.cost > _GOOD_COST:
            guess = self.first_guess(radius_px)
            if guess is None:
                return NotLocated("the floor's edge encloses no area")
            fit = self._fit(guess.array[None], radius_px, 1, _SCALES_PX)
            if fit.cost > _GOOD_COST:
                coarse = self._fit(self._alternatives(guess), radius_px, 3, _COARSE_SCALES_PX)
                retry = self._fit(coarse.pose[None], radius_px, 1, _SCALES_PX)
                fit = retry if retry.cost < fit.cost else fit
        return self._judge(fit)

    def _alternatives(self, guess: Pose2) -> FloatArray:
        along, across = np.ptp(self.field.floor_polygon, axis=0) / 4
        starts = [guess.array + (0.0, 0.0, turn) for turn in np.radians([-40.0, -20.0, 20.0, 40.0, 90.0])]
        starts += [guess.array + (dx, dy, 0.0) for dx in (-along, 0.0, along) for dy in (-across, 0.0, across)]
        return np.array(starts)

    def _fit(self, starts: FloatArray, radius_px: FloatArray, stride: int, scales: FloatArray) -> _Fit:
        pose, information, scatter = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
        residual = np.full(len(radius_px), np.nan)
        q_step, radius_of_q = self._radius_of_q
        cost = kernels.fit_walls(
            starts, *self._geometry, self._cos, self._sin, radius_px, stride, q_step, radius_of_q, scales,
            np.zeros((3, 3)), pose, information, scatter, residual,
        )  # fmt: skip
        return _Fit(cost, pose, information, scatter, residual)

    def _judge(self, fit: _Fit) -> PoseEstimate | NotLocated:
        residual = fit.residual_px[np.isfinite(fit.residual_px)]
        inliers = residual[np.abs(residual) < _INLIER_PX]
        share = len(inliers) / max(len(residual), 1)
        if share < _LEAST_INLIER_SHARE:
            return NotLocated(f"only {share:.0%} of the floor's edge agrees with the field's walls")
        spread = np.linalg.eigvalsh(fit.information)
        if spread[0] < 1e-3 * spread[1] or spread[0] <= 0:
            return NotLocated("the part of the floor's edge in view fixes only one direction")
        inverse = np.linalg.inv(fit.information)
        covariance = inverse @ fit.scatter @ inverse + _SYSTEMATIC_PX**2 * len(inliers) * inverse
        pose = Pose2(*(float(v) for v in fit.pose))
        if not self.field.contains(np.array([[pose.x_m, pose.y_m]]))[0]:
            return NotLocated(f"the best fit puts the robot outside the field, at ({pose.x_m:.2f}, {pose.y_m:.2f}) m")
        rms = math.sqrt(float(np.mean(inliers**2)))
        return PoseEstimate(pose, covariance, share, rms, (pose, pose.half_turn()))


@dataclass(frozen=True, slots=True)
class _Fit:
    cost: float
    pose: FloatArray
    information: FloatArray
    scatter: FloatArray
    residual_px: FloatArray
