"""Pose estimation by the floor's outline: sub-pixel edges of the floor, fitted to the walls in the field file.

The paper's hull and principal axis (Sekimori et al. 2001, section 4) give the start. Residuals are in image radius,
in which the noise is uniform. The model is written in q = 1/range, in which every wall is straight.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.camera.downward import DownwardCamera
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.fit import Vector
from robocup_vision.kernels.walls.hull import hull_moments
from robocup_vision.localization.evidence import (
    LineOdds,
    OutlineEvidence,
    OutlineTally,
    load_evidence,
    no_lines,
    odds_text,
)
from robocup_vision.localization.fusion import fused
from robocup_vision.localization.outline_model import (
    OutlineCameraSettings,
    OutlineFit,
    OutlineModel,
    OutlineNoise,
)
from robocup_vision.localization.outline_search import OutlineSearch
from robocup_vision.localization.walls import wall_range_m
from robocup_vision.perception.polar_view import PolarView

# one edge for each unknown of the pose
_MIN_EDGES = 3
_OPEN = "the part of the floor's edge in view does not fix the pose in every direction"


def require_bounded(field: Field, method: str = "floor") -> None:
    """Raise ArgumentError unless walls or boards bound a field's floor."""
    if not field.is_bounded:
        raise ArgumentError(
            f"method '{method}' needs walls or boards, but the floor of '{field.name}' is not bounded (carpet)"
        )


@dataclass(frozen=True, slots=True)
class OutlineSettings:
    """Settings of `OutlineFitter`; "units" are 1/86 of the usable image radius."""

    noise: OutlineNoise = OutlineNoise()
    camera: OutlineCameraSettings = OutlineCameraSettings()
    #: widths of the redescending weights, units: from the first guess, and from a prior
    scales: tuple[float, ...] = (8.0, 5.0, 3.0, 2.0, 1.0)
    prior_scales: tuple[float, ...] = (2.0,)
    max_std_m: float = 0.05  #: greatest standard deviation of an accepted pose
    #: standard deviation from which a fit is checked by a search, because it may slide along the field's sides
    sliding_std_m: float = 0.008


class OutlineAnswer(NamedTuple):
    """Result of the fit of an outline."""

    estimate: PoseEstimate | NotLocated
    wall_px: FloatArray  #: (K,) float64: predicted image radius of the walls, NaN if there is none
    #: the estimate without the prior, if `estimate` includes the prior as a factor
    measurement: PoseEstimate | None = None


class OutlineFitter:
    """Fits a measured floor outline to a field's walls.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards.
    view : PolarView
        Defines the bearings of the outline.

    Raises
    ------
    ArgumentError
        If nothing bounds the field's floor.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        view: PolarView,
        settings: OutlineSettings = OutlineSettings(),
    ) -> None:
        require_bounded(field)
        self.field, self.camera, self.view, self.settings = field, camera, view, settings
        self.evidence = load_evidence()
        self.model = OutlineModel(field, camera, view, settings.noise, settings.camera)
        self.search = OutlineSearch(self.model)
        self._outline_evidence = OutlineEvidence(view, self.model.unit_px, self.evidence.outline)
        self._scales, self._prior_scales = (self.model.scales(one) for one in (settings.scales, settings.prior_scales))

    def first_guess(self, radius_px: FloatArray) -> Pose2 | None:
        """Return the pose by the centroid and principal axis of the outline's convex hull in the image (paper, step 5).

        The outline (K,) is the image radius of the floor's edge at each bearing, NaN if there is none. The pose has
        one of the two possible headings; it is None with fewer than three edges.
        """
        bearings, guess = self._guess(radius_px)
        return None if bearings < _MIN_EDGES else Pose2(*guess)

    def _guess(self, radius_px: FloatArray) -> tuple[int, Vector]:
        """Return the number of edges, and x, y and theta of the first guess; zeros with fewer than three edges."""
        model = self.model
        known, x, y, axis = hull_moments(model.scene.cos_b, model.scene.sin_b, radius_px, *model.q_of_radius)
        c, s = math.cos(axis), math.sin(axis)
        return known, (-c * x - s * y, s * x - c * y, -axis)

    def likeliest(self, radius_px: FloatArray) -> Pose2 | None:
        """Return the pose that fits an outline (K,) best, accepted or not; None with fewer than three edges."""
        fit = self.from_guess(radius_px)
        if fit is None:
            return None
        fixed = [one for one in self.search.candidates(fit, radius_px) if self.is_fixed_place(one)]
        return Pose2(*min(fixed, key=lambda one: one.cost).pose) if fixed else self.first_guess(radius_px)

    def from_guess(self, radius_px: FloatArray) -> OutlineFit | None:
        """Fit an outline (K,) from the first guess; None with fewer than three edges."""
        bearings, guess = self._guess(radius_px)
        return None if bearings < _MIN_EDGES else self.from_start(guess, radius_px)

    def from_start(self, start: Vector, radius_px: FloatArray) -> OutlineFit:
        """Fit an outline (K,) from x, y, theta of a rough pose."""
        return self.model.fit(start, radius_px, self._scales)[0]

    def from_prior(self, prior: Pose2, radius_px: FloatArray) -> OutlineFit | None:
        """Fit an outline (K,) from a prior; None with fewer than three edges."""
        fit, bearings = self.model.fit((prior.x_m, prior.y_m, prior.theta_rad), radius_px, self._prior_scales)
        return None if bearings < _MIN_EDGES else fit

    def fixes_pose(self, fit: OutlineFit) -> bool:
        """Whether the inliers of a fit determine the pose: without an end of the field it slides along its sides."""
        return fit.sliding_m <= self.settings.sliding_std_m

    def weigh(self, fit: OutlineFit, floor_column: Int64Array) -> OutlineTally:
        """Weigh a fit by the outline alone, given each bearing's outermost floor sample (K,), -1 if none."""
        return self._outline_evidence.weigh(fit, floor_column)

    def weigh_pose(
        self, pose: Pose2, camera: DownwardCamera, radius_px: FloatArray, floor_column: Int64Array
    ) -> OutlineTally:
        """Weigh a pose from another source, with the camera as it leans, by an outline (K,) alone."""
        bearing = self.view.bearing_rad
        range_m = wall_range_m(self.field.walls, pose.compose(self.camera.camera_in_robot), bearing)
        away = (
            np.stack([np.cos(bearing), np.sin(bearing)], axis=-1) * np.where(range_m < np.inf, range_m, np.nan)[:, None]
        )
        feet = camera.floor_to_pixel(self.camera.offset_m + away) - self.camera.center_px
        walls = np.hypot(feet[:, 0], feet[:, 1])
        return self._outline_evidence.weigh_walls(radius_px - walls, walls, floor_column)

    def locate(
        self,
        radius_px: FloatArray,
        floor_column: Int64Array,
        prior: PoseEstimate | Pose2 | None = None,
        line_odds: LineOdds = no_lines,
    ) -> OutlineAnswer:
        """Fit the outline from each start in turn, and test the fits.

        The prior is the first start, then the outline's hull. If neither fit is certain, the whole field is searched.

        Parameters
        ----------
        radius_px : (K,) float64
            Image radius of the floor's edge at each of the view's bearings, NaN if there is none.
        floor_column : (K,) int64
            Outermost floor sample of each bearing; -1 if there is none.
        prior : PoseEstimate or Pose2, optional
            Probable pose: a start, and the only one if the outline certainly agrees with it. Its covariance is a factor
            of the pose of a body that may lean, of which the outline often does not determine one direction.
        line_odds : callable, optional
            Log odds of a pose by the lines, for use where the outline is ambiguous.

        Returns
        -------
        OutlineAnswer
            A pose has both half-turn candidates, since the outline alone does not separate them.
        """
        settings = self.settings
        start = pose_of(prior)
        if start is not None:
            fit = self.from_prior(start, radius_px)
            if fit is None:
                return self._too_little(radius_px)
            if self.fixes_pose(fit) and self._is_sure(fit, floor_column, line_odds):
                return self._judge(fit, settings.max_std_m)
            leaning = self.model.fit_leaning((fit.pose, (start.x_m, start.y_m, start.theta_rad)), radius_px)
            if leaning is not None and self._is_sure(leaning, floor_column, line_odds):
                answer = self._judge_leaning(leaning, prior)
                if answer.estimate:
                    return answer
        fit = self.from_guess(radius_px)
        if fit is None:
            return self._too_little(radius_px)
        if self.fixes_pose(fit) and self._is_sure(fit, floor_column, line_odds):
            return self._judge(fit, settings.max_std_m)
        max_std_m = settings.max_std_m if prior is None else settings.camera.max_leaning_std_m
        fits = [one for one in self.search.candidates(fit, radius_px) if self._is_place(one)]
        found = self._choose(fits, max_std_m, floor_column, line_odds)
        if isinstance(found, NotLocated):
            return OutlineAnswer(found, _nothing(radius_px))
        if prior is None or self.fixes_pose(found):
            return self._judge(self.model.fit(found.pose, radius_px, self.model.scales(()))[0], settings.max_std_m)
        # the search assumes an upright body, but a moving one may lean, which may shift the pose by half a metre
        leaning = self.model.fit_leaning((found.pose,), radius_px)
        if leaning is None:
            reason = "the floor's edge does not fix the pose of a body that may lean"
            return OutlineAnswer(NotLocated(reason), _nothing(radius_px))
        return self._judge_leaning(leaning, prior)

    def _is_place(self, fit: OutlineFit) -> bool:
        """Whether a fit is on the field, with any uncertainty."""
        return math.isfinite(fit.along_m) and self.field.is_on_floor(*fit.pose[:2])

    def is_fixed_place(self, fit: OutlineFit) -> bool:
        """Whether a fit is on the field and determined in every direction."""
        return fit.along_m <= self.settings.max_std_m and self._is_place(fit)

    def _is_sure(self, fit: OutlineFit, floor_column: Int64Array, line_odds: LineOdds) -> bool:
        by_outline, sure = self.weigh(fit, floor_column).log_odds, self.evidence.sure_log_odds
        # a goal's sides may be taken for walls, but then the lines do not fit
        return by_outline >= sure and by_outline + line_odds(Pose2(*fit.pose)) >= sure

    def _choose(
        self, fits: list[OutlineFit], max_std_m: float, floor_column: Int64Array, line_odds: LineOdds
    ) -> OutlineFit | NotLocated:
        """Return the determined fit that the evidence favours over clutter and over every other place."""
        fixed = [n for n, fit in enumerate(fits) if fit.along_m <= max_std_m]
        if not fixed:
            return NotLocated(_OPEN)
        tallies = [self.weigh(fit, floor_column) for fit in fits]
        by_outline = np.array([tally.log_odds for tally in tallies])
        by_lines = np.array([line_odds(Pose2(*fit.pose)) for fit in fits])
        evidence = self.evidence
        # occlusion and worn paint affect the lines of all places alike. In the comparison of places the errors of line
        # samples are therefore correlated no more than those of bearings
        compared = by_outline + evidence.lines.correlation / evidence.outline.correlation * by_lines
        best = max(fixed, key=lambda n: float(compared[n]))
        odds = float(by_outline[best] + by_lines[best])
        if odds < evidence.min_log_odds:
            return NotLocated(tallies[best].reason(odds))
        # a fit that slides along a wall is not accepted, but it is a rival unless it can slide to the same place
        rivals = [float(compared[n]) for n, fit in enumerate(fits) if not self.search.may_be_one(fits[best], fit)]
        lead = float(compared[best]) - max(rivals, default=-math.inf)
        if lead < evidence.min_log_odds:
            return NotLocated(f"two places explain the floor's edge about equally well, odds {odds_text(lead)}")
        return fits[best]

    def _judge(self, fit: OutlineFit, max_std_m: float) -> OutlineAnswer:
        """Return the result for an accepted fit, if it is determined and on the field."""
        if fit.along_m > max_std_m:
            return OutlineAnswer(NotLocated(_OPEN), _nothing(fit.predicted_px))
        return self._on_floor(fit, _estimate(fit))

    def _judge_leaning(self, fit: OutlineFit, prior: PoseEstimate | Pose2 | None) -> OutlineAnswer:
        """Return the result for a body that may lean, whose prior's covariance is a factor of the pose."""
        max_std_m = self.settings.camera.max_leaning_std_m
        if not isinstance(prior, PoseEstimate):
            return self._judge(fit, max_std_m)
        alone = _estimate(fit)
        both = fused(alone, dataclasses.replace(prior, candidates=(prior.pose,)))
        if both is None:
            x, y, _ = fit.pose
            reason = f"the floor's edge puts a body that may lean to ({x:.2f}, {y:.2f}) m, where the prior excludes it"
            return OutlineAnswer(NotLocated(reason), _nothing(fit.predicted_px))
        if both.std[:2].max() > max_std_m:
            return OutlineAnswer(NotLocated(_OPEN), _nothing(fit.predicted_px))
        candidates = (both.pose, both.pose.half_turn())
        estimate = dataclasses.replace(alone, pose=both.pose, covariance=both.covariance, candidates=candidates)
        return self._on_floor(fit, estimate, alone)

    def _on_floor(
        self, fit: OutlineFit, estimate: PoseEstimate, measurement: PoseEstimate | None = None
    ) -> OutlineAnswer:
        x, y = estimate.x_m, estimate.y_m
        if self.field.is_on_floor(x, y):
            return OutlineAnswer(estimate, fit.predicted_px, measurement)
        reason = f"the best fit puts the robot outside the field, at ({x:.2f}, {y:.2f}) m"
        return OutlineAnswer(NotLocated(reason), _nothing(fit.predicted_px))

    def _too_little(self, radius_px: FloatArray) -> OutlineAnswer:
        seen = np.count_nonzero(radius_px > 0.0)
        reason = f"the floor's edge is seen in only {seen} of {len(radius_px)} directions"
        return OutlineAnswer(NotLocated(reason), _nothing(radius_px))


def _estimate(fit: OutlineFit) -> PoseEstimate:
    pose = Pose2(*fit.pose)
    return PoseEstimate(pose, fit.covariance, fit.inlier_ratio, fit.rms_px, (pose, pose.half_turn()))


def _nothing(radius_px: FloatArray) -> FloatArray:
    """Return a predicted outline (K,) without walls."""
    return np.full(len(radius_px), np.nan)
