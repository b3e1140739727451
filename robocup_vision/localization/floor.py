"""Pose from the floor's outline: sub-pixel edges of the floor, fitted to the walls the field file knows.

The paper's hull and principal axis (Sekimori et al. 2001, section 4) give the start. The fit is in image radius, where
the measurement's error is uniform, written in q = 1/range, where every wall is straight.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.floor import walls as kernels
from robocup_vision.perception.polar_view import PolarView

Arbiter = Callable[[list[Pose2]], int | None]

# widths of the redescending weights, in units of 1/86 of the usable radius (a pixel of the paper's 256 x 220 image):
# from the first guess down to the edges' own accuracy; a last one in pixels proper
_SCALES = (8.0, 5.0, 3.0, 2.0, 1.0)
_COARSE_SCALES = (8.0, 6.0, 4.0, 2.0)
_PRIOR_SCALES = (2.0,)
_REFINE_SCALES = (3.0, 2.0, 1.0, 1.0)
_UNITS = 86.0
_LAST_SCALE_PX = 1.0
_INLIER = 1.5
_TIGHT = 0.5
# truncated mean cost up to which a fit is taken without looking for a better one: three bearings in four fit; three in
# five, or, near where the robot is known to be, two, while hardly any bearing shows floor beyond a wall
_SURE_COST = 0.25
_GOOD_COST = 0.4
_GOOD_COST_AT_PRIOR = 0.6
_MAX_BEYOND = 0.01
_MIN_INLIER_SHARE = 0.3
_MIN_BEARINGS = 20
_BANK_BEARINGS = 80
_BANK_STARTS = 30
_BANK_WIDTH = 12.0
_REFINED = 8
# a fit whose cost is within this of the best one's explains the outline about as well
_RIVAL_COST = 0.08
_EQUAL_COST = 0.002
# what no image tells: the camera file's own error, in pixels, common to an eighth of the circle
_SYSTEMATIC_PX = 0.02
_SYSTEMATIC_BEARINGS = 20
# a sandwich covariance from some forty groups of bearings comes out low
_FEW_GROUPS = 1.7
_LARGEST_STD_M = 0.05
# a fit with more play than this is doubted
_SLIDING_STD_M = 0.008


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
    def _q_of_radius(self) -> tuple[float, float, FloatArray]:
        inner, outer = self.camera.usable_radius_px
        radius = np.linspace(inner, outer, 512)
        q = self.camera.floor_range.inverse_range_per_m(radius)
        # nothing on the field is farther away than its own length
        nearest = 1.2 * float(np.ptp(self.field.floor_polygon, axis=0).max())
        return inner, float(radius[1] - radius[0]), np.maximum(np.nan_to_num(q), 1.0 / nearest)

    @cached_property
    def _geometry(self) -> tuple[FloatArray, float, float, float, FloatArray]:
        x, y, height = self.camera.viewpoint_m
        to_camera = np.ascontiguousarray(self.camera.camera_to_robot.T)
        return np.ascontiguousarray(self.field.walls), float(x), float(y), float(height), to_camera

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
        known, x, y, axis = kernels.hull_moments(self._cos, self._sin, radius_px, *self._q_of_radius)
        if known < 3:
            return None
        return Pose2(x, y, axis).inverse()

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
            first, from other evidence; None: it cannot tell. Without it the best is taken.

        Returns
        -------
        PoseEstimate or NotLocated
            With both half-turn candidates, since the outline alone cannot tell which is right.
        (K,) float64
            Image radius at which the pose expects the walls; NaN where it does not say.
        """
        known = int(np.count_nonzero(radius_px > 0))
        if known < _MIN_BEARINGS:
            reason = f"the floor's edge is seen in only {known} of {len(radius_px)} directions"
            return NotLocated(reason), np.full(len(radius_px), np.nan)
        fit: _Fit | None = None
        if prior is not None:
            fit = self._fit(prior.array[None], radius_px, 1, self._scales(_PRIOR_SCALES))
        if fit is None or not self._is_good(fit, _GOOD_COST_AT_PRIOR):
            guess = self.first_guess(radius_px)
            if guess is None:
                return NotLocated("the floor's edge encloses no area"), np.full(len(radius_px), np.nan)
            fit = self._fit(guess.array[None], radius_px, 1, self._scales(_SCALES))
            # a start from nowhere may have ended beside the right place: then even what agrees agrees badly
            if not self._is_good(fit, _GOOD_COST) or fit.rms_px > _TIGHT * self._unit_px:
                fit = self._fit_from_anywhere(fit, radius_px, arbiter)
        if fit is None:
            return NotLocated("several places explain the floor's edge equally well"), np.full(len(radius_px), np.nan)
        estimate = self._judge(fit)
        return estimate, fit.predicted_px if estimate else np.full(len(radius_px), np.nan)

    def _is_good(self, fit: _Fit, good_cost: float) -> bool:
        """Whether a fit need not be doubted.

        Most of the outline agrees, hardly any floor shows beyond a wall, and what agrees fixes the pose: a fit that has
        lost an end of the field slides along its sides.
        """
        if fit.along_m > _SLIDING_STD_M:
            return False
        if fit.cost <= _SURE_COST:
            return True
        if fit.cost > good_cost:
            return False
        beyond = np.count_nonzero(fit.residual_px > 2.0 * self._unit_px)
        return bool(beyond < _MAX_BEYOND * len(fit.residual_px))

    def _fit_from_anywhere(self, fit: _Fit, radius_px: FloatArray, arbiter: Arbiter | None) -> _Fit | None:
        """Look for a better fit over the whole field, and by sliding along the walls that already agree.

        None where several places explain the outline equally well.
        """
        starts = np.vstack([self._search(radius_px), self._slides(fit.pose)])
        poses, costs = np.empty_like(starts), np.empty(len(starts))
        kernels.fit_each(
            starts, *self._geometry, self._cos, self._sin, radius_px, 2, *self._radius_of_q,
            self._scales(_COARSE_SCALES), self._unit_px, poses, costs,
        )  # fmt: skip
        tried: list[FloatArray] = []
        fits = [fit]
        for pose in poses[np.argsort(costs)]:
            if not _is_new(pose, tried, 0.03):
                continue
            tried.append(pose)
            fits.append(self._fit(pose[None], radius_px, 1, self._scales(_REFINE_SCALES)))
            if len(tried) == _REFINED:
                break
        fits.sort(key=lambda f: f.cost)
        rivals: list[_Fit] = []
        for candidate in fits:
            if candidate.cost < fits[0].cost + _RIVAL_COST and _is_new(candidate.pose, [r.pose for r in rivals], 0.05):
                rivals.append(candidate)
        if len(rivals) == 1:
            return rivals[0]
        chosen = None if arbiter is None else arbiter([Pose2(*rival.pose.tolist()) for rival in rivals])
        if chosen is not None:
            return rivals[chosen]
        return None if rivals[1].cost < rivals[0].cost + _EQUAL_COST else rivals[0]

    def _slides(self, pose: FloatArray) -> FloatArray:
        low, high = self.field.floor_polygon.min(axis=0), self.field.floor_polygon.max(axis=0)
        along = [np.array([x, pose[1], pose[2]]) for x in np.linspace(low[0], high[0], 15)[1:-1]]
        across = [np.array([pose[0], y, pose[2]]) for y in np.linspace(low[1], high[1], 9)[1:-1]]
        return np.array(along + across)

    @cached_property
    def _unit_px(self) -> float:
        inner, outer = self.camera.usable_radius_px
        return max(1.0, (outer - inner) / _UNITS)

    def _scales(self, units: tuple[float, ...]) -> FloatArray:
        return np.array([*(unit * self._unit_px for unit in units), _LAST_SCALE_PX])

    @cached_property
    def _bank(self) -> tuple[FloatArray, FloatArray]:
        spacing = float(np.ptp(self.field.floor_polygon, axis=0).min()) / 15
        low, high = self.field.floor_polygon.min(axis=0), self.field.floor_polygon.max(axis=0)
        # half the places do: the outline of the other half is the same, turned
        x, y = np.meshgrid(np.arange(spacing / 2, high[0], spacing), np.arange(low[1] + spacing / 2, high[1], spacing))
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        places = places[self.field.contains(places)]
        bearings = np.arange(_BANK_BEARINGS) * (math.tau / _BANK_BEARINGS)
        cos_b, sin_b = np.cos(bearings), np.sin(bearings)
        q, wall = np.empty(_BANK_BEARINGS), np.empty(_BANK_BEARINGS, dtype=np.int64)
        planes = np.empty((len(self.field.walls), 4, 3))
        profiles = np.empty((len(places), _BANK_BEARINGS))
        for place, profile in zip(places, profiles, strict=True):
            kernels.predict_walls(np.array([*place, 0.0]), *self._geometry, cos_b, sin_b, q, wall, planes)
            profile[:] = np.interp(q, np.arange(len(self._radius_of_q[1])) * self._radius_of_q[0], self._radius_of_q[1])
        return places, np.hstack([profiles, profiles])

    def _search(self, radius_px: FloatArray) -> FloatArray:
        """Poses (N, 3) whose expected outline is most like the measured one, over the whole field and all headings."""
        places, profiles = self._bank
        nearest = np.rint(np.arange(_BANK_BEARINGS) * (len(radius_px) / _BANK_BEARINGS)).astype(int) % len(radius_px)
        radius = radius_px[nearest]
        weight = np.isfinite(radius) / max(np.count_nonzero(np.isfinite(radius)), 1)
        cost = np.empty((len(places), _BANK_BEARINGS))
        kernels.score_bank(profiles, np.nan_to_num(radius), weight, _BANK_WIDTH * self._unit_px, cost)
        most = min(10 * _BANK_STARTS, cost.size)
        best = np.argpartition(cost, most - 1, axis=None)[:most]
        starts: list[FloatArray] = []
        for index in best[np.argsort(cost.ravel()[best])]:
            place, shift = divmod(int(index), _BANK_BEARINGS)
            start = np.array([*places[place], -shift * math.tau / _BANK_BEARINGS])
            if _is_new(start, starts, 0.15):
                starts.append(start)
            if len(starts) == _BANK_STARTS:
                break
        return np.array(starts)

    def _fit(self, starts: FloatArray, radius_px: FloatArray, stride: int, scales: FloatArray) -> _Fit:
        pose, information, scatter = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
        residual, predicted = np.full(len(radius_px), np.nan), np.full(len(radius_px), np.nan)
        q_step, radius_of_q = self._radius_of_q
        cost = kernels.fit_walls(
            starts, *self._geometry, self._cos, self._sin, radius_px, stride, q_step, radius_of_q, scales,
            self._unit_px, pose, information, scatter, residual, predicted,
        )  # fmt: skip
        covariance = np.empty((3, 3))
        share, rms, along = kernels.summarise_fit(
            residual, _INLIER * self._unit_px, information, scatter, _FEW_GROUPS,
            _SYSTEMATIC_PX**2 * _SYSTEMATIC_BEARINGS, covariance,
        )  # fmt: skip
        return _Fit(cost, pose, covariance, share, rms, along, residual, predicted)

    def _judge(self, fit: _Fit) -> PoseEstimate | NotLocated:
        if fit.inlier_share < _MIN_INLIER_SHARE:
            return NotLocated(f"only {fit.inlier_share:.0%} of the floor's edge agrees with the field's walls")
        if fit.along_m > _LARGEST_STD_M:
            return NotLocated("the part of the floor's edge in view does not fix the pose in every direction")
        x, y, theta = fit.pose.tolist()
        pose = Pose2(x, y, theta)
        if not self.field.is_on_floor(x, y):
            return NotLocated(f"the best fit puts the robot outside the field, at ({x:.2f}, {y:.2f}) m")
        return PoseEstimate(pose, fit.covariance, fit.inlier_share, fit.rms_px, (pose, pose.half_turn()))


def _is_new(pose: FloatArray, others: list[FloatArray], apart: float) -> bool:
    """Whether a pose differs from all others, and their half turns, by more than `apart`, metres and radians added."""
    for other in others:
        here = math.hypot(*(pose - other)[:2]) + abs(wrap_angle(pose[2] - other[2]))
        turned = math.hypot(*(pose + other)[:2]) + math.pi - abs(wrap_angle(pose[2] - other[2]))
        if min(here, turned) <= apart:
            return False
    return True


@dataclass(frozen=True, slots=True)
class _Fit:
    cost: float
    pose: FloatArray
    covariance: FloatArray
    inlier_share: float
    rms_px: float
    along_m: float
    residual_px: FloatArray
    predicted_px: FloatArray
