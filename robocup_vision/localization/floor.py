"""Estimates the pose by the floor's outline: sub-pixel edges of the floor, fitted to the walls in the field file.

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
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.fit import Vector
from robocup_vision.kernels.walls.hull import hull_moments
from robocup_vision.localization.outline_camera import OutlineCamera
from robocup_vision.localization.outline_model import (
    OutlineCameraSettings,
    OutlineFit,
    OutlineModel,
    OutlineNoise,
)
from robocup_vision.localization.outline_search import Arbiter, OutlineSearch, OutlineSearchSettings
from robocup_vision.perception.polar_view import PolarView


@dataclass(frozen=True, slots=True)
class OutlineSettings:
    """Settings of `OutlineFitter`; "units" are 1/86 of the usable image radius.

    Parameters
    ----------
    noise, search, camera : OutlineNoise, OutlineSearchSettings, OutlineCameraSettings
        See there.
    scales, prior_scales : tuple of float
        Widths of the redescending weights, units: from the first guess down to the edges' own accuracy, and from a
        prior.
    tight : float
        RMS residual, units, above which a start from nowhere may have ended beside the right place.
    certain_cost, max_cost, max_cost_at_prior : float
        Truncated mean cost up to which a fit is taken without a search: three bearings in four fit; three in five, or,
        near a prior, two, while hardly any bearing shows floor beyond a wall.
    max_beyond : float
        Bearings that may show floor beyond a wall, of all.
    min_inlier_ratio, min_bearings : float, int
        Below these the outline does not determine a pose.
    max_std_m : float
        A pose more uncertain than this is refused.
    sliding_std_m : float
        A fit more uncertain than this is checked by a search: it may slide along the field's sides.
    """

    noise: OutlineNoise = OutlineNoise()
    search: OutlineSearchSettings = OutlineSearchSettings()
    camera: OutlineCameraSettings = OutlineCameraSettings()
    scales: tuple[float, ...] = (8.0, 5.0, 3.0, 2.0, 1.0)
    prior_scales: tuple[float, ...] = (2.0,)
    tight: float = 0.5
    certain_cost: float = 0.25
    max_cost: float = 0.4
    max_cost_at_prior: float = 0.6
    max_beyond: float = 0.01
    min_inlier_ratio: float = 0.3
    min_bearings: int = 20
    max_std_m: float = 0.05
    sliding_std_m: float = 0.008


@dataclass(frozen=True, eq=False)
class OutlineFitter:
    """Fits a measured floor outline to a field's walls.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards.
    camera : OmniCamera
        The camera.
    view : PolarView
        Defines the bearings of the outline.
    settings : OutlineSettings, optional
        Of the fit and the search.

    Raises
    ------
    ArgumentError
        If nothing bounds the field's floor.
    """

    field: Field
    camera: OmniCamera
    view: PolarView
    settings: OutlineSettings = OutlineSettings()

    def __post_init__(self) -> None:
        if not self.field.is_bounded:
            raise ArgumentError(
                f"method 'floor' needs walls or boards, but the floor of '{self.field.name}' is not bounded (carpet)"
            )

    @cached_property
    def _model(self) -> OutlineModel:
        return OutlineModel(self.field, self.camera, self.view, self.settings.noise, self.settings.camera)

    @cached_property
    def _search(self) -> OutlineSearch:
        return OutlineSearch(self._model, self.settings.search)

    @cached_property
    def _camera(self) -> OutlineCamera:
        return OutlineCamera(self._model, self.settings.camera)

    @cached_property
    def _scales(self) -> FloatArray:
        return self._model.scales(self.settings.scales)

    @cached_property
    def _prior_scales(self) -> FloatArray:
        return self._model.scales(self.settings.prior_scales)

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
        bearings, guess = self._guess(radius_px)
        return None if bearings < 3 else Pose2(*guess)

    def _guess(self, radius_px: FloatArray) -> tuple[int, Vector]:
        """Return how many bearings have an edge, and the first guess's x, y and theta; zeros with fewer than three."""
        model = self._model
        known, x, y, axis = hull_moments(model.scene.cos_b, model.scene.sin_b, radius_px, *model.q_of_radius)
        c, s = math.cos(axis), math.sin(axis)
        return known, (-c * x - s * y, s * x - c * y, -axis)

    def _too_little(self, radius_px: FloatArray, bearings: int) -> tuple[NotLocated, FloatArray]:
        reason = f"the floor's edge is seen in only {bearings} of {len(radius_px)} directions"
        return NotLocated(reason), _nothing(radius_px)

    def locate(
        self, radius_px: FloatArray, prior: Pose2 | None = None, arbiter: Arbiter | None = None
    ) -> tuple[PoseEstimate | NotLocated, FloatArray]:
        """Fit the outline.

        Parameters
        ----------
        radius_px : (K,) float64
            Image radius of the floor's edge at each of the view's bearings, NaN where none.
        prior : Pose2, optional
            Where the robot probably is: a start, and, if the outline agrees with it, the only one.
        arbiter : callable, optional
            Takes the index of the right one of several poses that explain the outline about equally well, the best
            first, by other evidence; None: undecided. Without it the best is taken.

        Returns
        -------
        PoseEstimate or NotLocated
            With both half-turn candidates, since the outline alone does not separate them.
        (K,) float64
            Image radius at which the pose predicts the walls; NaN where it predicts none.
        """
        settings, model = self.settings, self._model
        fit: OutlineFit | None = None
        is_good = False
        if prior is not None:
            start = prior.x_m, prior.y_m, prior.theta_rad
            fit, bearings = model.fit(start, radius_px, self._prior_scales)
            if bearings < settings.min_bearings:
                return self._too_little(radius_px, bearings)
            fit = self._camera.leaned(fit, radius_px)
            is_good = self._is_good(fit, settings.max_cost_at_prior)
            if not is_good:
                leaning = self._camera.leaning((fit.pose, start), radius_px)
                if leaning is not None:
                    return self._judge(leaning, settings.camera.max_open_std_m), leaning.predicted_px
        if fit is None or not is_good:
            bearings, guess = self._guess(radius_px)
            if bearings < settings.min_bearings:
                return self._too_little(radius_px, bearings)
            fit, _ = model.fit(guess, radius_px, self._scales)
            # a start from nowhere may have ended beside the right place: then even what agrees agrees badly
            if not self._is_good(fit, settings.max_cost) or fit.rms_px > settings.tight * model.unit_px:
                fit = self._search.improve(fit, radius_px, arbiter)
        if fit is None:
            return NotLocated("several places explain the floor's edge equally well"), _nothing(radius_px)
        if prior is not None and fit.along_m > settings.sliding_std_m and not any(fit.lean_rad):
            # found as an upright body sees it: one that moves may lean, and on a far field that is half a metre
            leaning = self._camera.leaning((fit.pose,), radius_px)
            if leaning is None:
                return NotLocated("the floor's edge does not fix the pose of a body that may lean"), _nothing(radius_px)
            return self._judge(leaning, settings.camera.max_open_std_m), leaning.predicted_px
        estimate = self._judge(fit, settings.max_std_m)
        if isinstance(estimate, NotLocated):
            return estimate, _nothing(radius_px)
        return self._camera.corrected(estimate, fit, radius_px, settings.sliding_std_m)

    def _is_good(self, fit: OutlineFit, good_cost: float) -> bool:
        """Whether a fit needs no search.

        Most of the outline agrees, hardly any floor shows beyond a wall, and the inliers fix the pose: a fit without an
        end of the field slides along its sides.
        """
        if fit.along_m > self.settings.sliding_std_m:
            return False
        if fit.cost <= self.settings.certain_cost:
            return True
        if fit.cost > good_cost:
            return False
        beyond = np.count_nonzero(fit.residual_px > 2.0 * self._model.unit_px)
        return bool(beyond < self.settings.max_beyond * len(fit.residual_px))

    def _judge(self, fit: OutlineFit, max_std_m: float) -> PoseEstimate | NotLocated:
        if fit.inlier_ratio < self.settings.min_inlier_ratio:
            return NotLocated(f"only {fit.inlier_ratio:.0%} of the floor's edge agrees with the field's walls")
        if fit.along_m > max_std_m:
            return NotLocated("the part of the floor's edge in view does not fix the pose in every direction")
        x, y, theta = fit.pose
        pose = Pose2(x, y, theta)
        if not self.field.is_on_floor(x, y):
            return NotLocated(f"the best fit puts the robot outside the field, at ({x:.2f}, {y:.2f}) m")
        return PoseEstimate(pose, fit.covariance, fit.inlier_ratio, fit.rms_px, (pose, pose.half_turn()))


def _nothing(radius_px: FloatArray) -> FloatArray:
    """Return a predicted outline (K,) of no pose."""
    return np.full(len(radius_px), np.nan)
