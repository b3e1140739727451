"""Estimates the pose by the floor's outline: sub-pixel edges of the floor, fitted to the walls in the field file.

The paper's hull and principal axis (Sekimori et al. 2001, section 4) give the start. The fit is in image radius, where
the measurement's error is uniform, written in q = 1/range, where every wall is straight.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import doubted_camera, wall_search
from robocup_vision.kernels.floor import walls as kernels
from robocup_vision.kernels.floor.hull import hull_moments
from robocup_vision.localization.outline_lean import LeanSettings, fit_lean, leaning
from robocup_vision.perception.polar_view import PolarView

Arbiter = Callable[[list[Pose2]], int | None]

# a pixel of the paper's 256 x 220 image is this fraction of the usable radius
_UNITS = 86.0
_SURE_PX = 1e-6  # how well a centre is known that is not doubted


@dataclass(frozen=True, slots=True)
class OutlineSettings:
    """Settings of `OutlineFitter`; "units" are 1/86 of the usable image radius.

    Parameters
    ----------
    scales, rough_scales, coarse_scales, prior_scales, refine_scales : tuple of float
        Widths of the redescending weights, units: from the first guess down to the edges' own accuracy, from all
        starts of a search over the whole field, from the likely ones, from a prior, and from what that search found.
    last_scale_px : float
        Width of the weights in the last step.
    inlier : float
        Residual of an inlier, units.
    tight : float
        RMS residual, units, above which a start from nowhere may have ended beside the right place.
    certain_cost, max_cost, max_cost_at_prior : float
        Truncated mean cost up to which a fit is taken without a search: three bearings in four fit; three in five, or,
        near a prior, two, while hardly any bearing shows floor beyond a wall.
    max_beyond : float
        Bearings that may show floor beyond a wall, of all.
    min_inlier_ratio, min_bearings : float, int
        Below these the outline does not determine a pose.
    bank_bearings, bank_starts, bank_width : int, int, float
        Bearings that outlines are compared at over the whole field, how many places go on, and where a difference is
        truncated, units.
    likely_starts : int
        How many starts of a search go on to `coarse_scales`.
    refined : int
        How many of those are fitted to the end.
    rival_cost, equal_cost : float
        Fits whose costs differ less than this explain the outline about equally well; so close, none is preferred.
    systematic_px, systematic_bearings : float, int
        Error of the camera file, which no image shows, common to so many bearings (an eighth of the circle).
    few_groups : float
        Factor on the covariance: a sandwich covariance from some forty groups of bearings comes out low.
    edge_noise_px : float
        Standard deviation of a bearing's edge.
    lean : LeanSettings
        Of bodies that sway, near a prior.
    center_std_units, tilt_std_rad : float
        Of centre and tilt in a camera file that is doubted.
    min_doubt, alike_bearings : float
        Gain per independent bearing by which another centre and tilt must explain the outline better, and how many
        neighbouring bearings err alike.
    min_doubt_ratio : float
        A file is doubted only where so much of the outline agrees.
    max_std_m : float
        A pose more uncertain than this is refused.
    sliding_std_m : float
        A fit more uncertain than this is checked by a search: it may slide along the field's sides.
    """

    scales: tuple[float, ...] = (8.0, 5.0, 3.0, 2.0, 1.0)
    rough_scales: tuple[float, ...] = (8.0, 6.0, 4.0)
    likely_starts: int = 24
    coarse_scales: tuple[float, ...] = (2.0,)
    prior_scales: tuple[float, ...] = (2.0,)
    refine_scales: tuple[float, ...] = (3.0, 2.0, 1.0, 1.0)
    last_scale_px: float = 1.0
    inlier: float = 1.5
    tight: float = 0.5
    certain_cost: float = 0.25
    max_cost: float = 0.4
    max_cost_at_prior: float = 0.6
    max_beyond: float = 0.01
    min_inlier_ratio: float = 0.3
    min_bearings: int = 20
    bank_bearings: int = 80
    bank_starts: int = 30
    bank_width: float = 12.0
    refined: int = 8
    rival_cost: float = 0.08
    equal_cost: float = 0.002
    systematic_px: float = 0.02
    systematic_bearings: int = 20
    few_groups: float = 1.7
    edge_noise_px: float = 0.15
    lean: LeanSettings = LeanSettings()
    center_std_units: float = 0.5
    tilt_std_rad: float = 0.004
    min_doubt: float = 8.0
    alike_bearings: float = 3.0
    min_doubt_ratio: float = 0.65
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
    def _scene(self) -> kernels.WallScene:
        x, y, height = self.camera.viewpoint_m
        to_camera = np.ascontiguousarray(self.camera.camera_to_robot.T)
        walls = np.ascontiguousarray(self.field.walls)
        return kernels.WallScene(walls, float(x), float(y), float(height), to_camera, self._cos, self._sin)

    @cached_property
    def _coarse_scene(self) -> kernels.WallScene:
        """The scene with every second bearing."""
        return self._scene._replace(cos_b=self._cos[::2].copy(), sin_b=self._sin[::2].copy())

    def _outline(self, radius_px: FloatArray, scales: FloatArray) -> kernels.FloorOutline:
        return kernels.FloorOutline(radius_px, *self._radius_of_q, scales, self._unit_px)

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
        known, x, y, axis = hull_moments(self._cos, self._sin, radius_px, *self._q_of_radius)
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
            first, by other evidence; None: undecided. Without it the best is taken.

        Returns
        -------
        PoseEstimate or NotLocated
            With both half-turn candidates, since the outline alone does not separate them.
        (K,) float64
            Image radius at which the pose predicts the walls; NaN where it predicts none.
        """
        known = int(np.count_nonzero(radius_px > 0))
        if known < self.settings.min_bearings:
            reason = f"the floor's edge is seen in only {known} of {len(radius_px)} directions"
            return NotLocated(reason), np.full(len(radius_px), np.nan)
        fit: _Fit | None = None
        if prior is not None:
            fit = self._fit(prior.array[None], radius_px, 1, self._scales(self.settings.prior_scales))
            fit = self._as_it_leans(fit, radius_px)
        if fit is None or not self._is_good(fit, self.settings.max_cost_at_prior):
            guess = self.first_guess(radius_px)
            if guess is None:
                return NotLocated("the floor's edge encloses no area"), np.full(len(radius_px), np.nan)
            fit = self._fit(guess.array[None], radius_px, 1, self._scales(self.settings.scales))
            # a start from nowhere may have ended beside the right place: then even what agrees agrees badly
            if not self._is_good(fit, self.settings.max_cost) or fit.rms_px > self.settings.tight * self._unit_px:
                fit = self._fit_from_anywhere(fit, radius_px, arbiter)
        if fit is None:
            return NotLocated("several places explain the floor's edge equally well"), np.full(len(radius_px), np.nan)
        estimate = self._judge(fit)
        if isinstance(estimate, NotLocated):
            return estimate, np.full(len(radius_px), np.nan)
        return self._doubting_the_camera(estimate, fit, radius_px)

    def _is_good(self, fit: _Fit, good_cost: float) -> bool:
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
        beyond = np.count_nonzero(fit.residual_px > 2.0 * self._unit_px)
        return bool(beyond < self.settings.max_beyond * len(fit.residual_px))

    def _fit_from_anywhere(self, fit: _Fit, radius_px: FloatArray, arbiter: Arbiter | None) -> _Fit | None:
        """Look for a better fit over the whole field, and by sliding along the walls that already agree.

        None where several places explain the outline equally well.
        """
        starts = np.vstack([self._search(radius_px), self._slides(fit.pose)])
        half_px, settings = radius_px[::2].copy(), self.settings
        wide = np.array(settings.rough_scales) * self._unit_px
        poses, costs = self._fit_coarsely(starts, half_px, wide)
        likely = poses[np.argsort(costs)[: settings.likely_starts]]
        poses, costs = self._fit_coarsely(likely, half_px, self._scales(settings.coarse_scales))
        fits = [fit]
        tried = np.empty((self.settings.refined, 3))
        scales = self._scales(self.settings.refine_scales)
        for pose in poses[np.argsort(costs)]:
            count = len(fits) - 1
            if count == len(tried):
                break
            if wall_search.is_apart(pose, tried[:count], 0.03):
                tried[count] = pose
                fits.append(self._fit(pose[None], radius_px, 1, scales))
        fits.sort(key=lambda f: f.cost)
        rivals: list[_Fit] = []
        for candidate in fits:
            others = np.array([rival.pose for rival in rivals]).reshape(-1, 3)
            is_rival = candidate.cost < fits[0].cost + self.settings.rival_cost
            if is_rival and wall_search.is_apart(candidate.pose, others, 0.05):
                rivals.append(candidate)
        if len(rivals) == 1:
            return rivals[0]
        chosen = None if arbiter is None else arbiter([Pose2(*rival.pose.tolist()) for rival in rivals])
        if chosen is not None:
            return rivals[chosen]
        return None if rivals[1].cost < rivals[0].cost + self.settings.equal_cost else rivals[0]

    def _fit_coarsely(
        self, starts: FloatArray, half_px: FloatArray, scales: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Fit each of the starts (N, 3) to every second bearing's radius; return poses (N, 3) and costs (N,)."""
        poses, costs = np.empty_like(starts), np.empty(len(starts))
        wall_search.fit_each(starts, self._coarse_scene, self._outline(half_px, scales), 1, poses, costs)
        return poses, costs

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
        return np.array([*(unit * self._unit_px for unit in units), self.settings.last_scale_px])

    @cached_property
    def _bank(self) -> tuple[FloatArray, Float32Array]:
        spacing = float(np.ptp(self.field.floor_polygon, axis=0).min()) / 15
        low, high = self.field.floor_polygon.min(axis=0), self.field.floor_polygon.max(axis=0)
        # half the places do: the outline of the other half is the same, turned
        x, y = np.meshgrid(np.arange(spacing / 2, high[0], spacing), np.arange(low[1] + spacing / 2, high[1], spacing))
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        places = places[self.field.contains(places)]
        bearings = np.arange(self.settings.bank_bearings) * (math.tau / self.settings.bank_bearings)
        walls = self.field.walls
        q, wall = np.empty(len(bearings)), np.empty(len(bearings), dtype=np.int64)
        out = kernels.WallPrediction(q, wall, np.empty((len(walls), 4, 3)))
        scene = self._scene._replace(cos_b=np.cos(bearings), sin_b=np.sin(bearings))
        profiles = np.empty((len(places), len(bearings)), dtype=np.float32)
        for place, profile in zip(places, profiles, strict=True):
            kernels.predict_walls(np.array([*place, 0.0]), scene, out)
            profile[:] = np.interp(q, np.arange(len(self._radius_of_q[1])) * self._radius_of_q[0], self._radius_of_q[1])
        # clockwise, as `score_bank` takes them
        profiles = np.roll(profiles[:, ::-1], 1, axis=1)
        return places, np.hstack([profiles, profiles])

    def _search(self, radius_px: FloatArray) -> FloatArray:
        """Poses (N, 3) whose expected outline is most like the measured one, over the whole field and all headings."""
        (places, profiles), settings = self._bank, self.settings
        count = settings.bank_bearings
        nearest = np.rint(np.arange(count) * (len(radius_px) / count)).astype(int) % len(radius_px)
        radius = radius_px[nearest]
        known = np.isfinite(radius)
        weight = (known / max(np.count_nonzero(known), 1)).astype(np.float32)
        cost = np.empty((len(places), count), dtype=np.float32)
        width_px = np.float32(settings.bank_width * self._unit_px)
        wall_search.score_bank(profiles, np.nan_to_num(radius).astype(np.float32), weight, width_px, cost)
        most = min(10 * settings.bank_starts, cost.size)
        best = np.argpartition(cost, most - 1, axis=None)[:most]
        best = best[np.argsort(cost.ravel()[best])]
        starts = np.empty((settings.bank_starts, 3))
        return starts[: wall_search.spread_starts(places, best, count, 0.15, starts)]

    def _fit(self, starts: FloatArray, radius_px: FloatArray, stride: int, scales: FloatArray) -> _Fit:
        settings, nothing = self.settings, np.full((2, len(radius_px)), np.nan)
        best = kernels.WallFit(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)), nothing[0], nothing[1])
        covariance = np.empty((3, 3))
        cost, ratio, rms, along = kernels.fit_and_summarise(
            starts,
            self._scene,
            self._outline(radius_px, scales),
            stride,
            settings.inlier * self._unit_px,
            settings.few_groups,
            self._systematic_px2,
            best,
            covariance,
        )
        return _Fit(cost, best.pose, covariance, ratio, rms, along, best.residual, best.predicted)

    def _as_it_leans(self, fit: _Fit, radius_px: FloatArray) -> _Fit:
        """Return the fit of a body that leans, as one that moves may; the fit itself where it stands upright."""
        settings = self.settings
        # most bodies stand upright most of the time: then one look does
        outline = self._outline(radius_px, self._scales(()))
        if doubted_camera.doubt_of_camera(fit.pose, self._scene, outline, self._sway) < settings.lean.gate:
            return fit
        outline = self._outline(radius_px, self._scales(settings.prior_scales))
        found = fit_lean(
            fit.pose, self._scene, outline, self._unit_px, settings.few_groups, self._systematic_px2, settings.lean
        )
        if found is None:
            return fit
        known = found.residual_px[np.isfinite(found.residual_px)]
        inlying = known[np.abs(known) < settings.inlier * self._unit_px]
        # as `fit_walls` counts
        loss = np.minimum((known / (2 * self._unit_px)) ** 2, np.where(known < 0, 1.0, 2.0)).sum()
        seen = np.count_nonzero(radius_px > 0)
        cost = float(loss + seen - len(known)) / seen
        if cost >= fit.cost or not len(inlying):
            return fit
        return replace(
            fit,
            cost=cost,
            pose=found.pose,
            covariance=found.covariance,
            inlier_ratio=len(inlying) / len(known),
            rms_px=math.sqrt(float(np.mean(inlying**2))),
            along_m=math.sqrt(float(np.linalg.eigvalsh(found.covariance[:2, :2])[-1])),
            residual_px=found.residual_px,
            predicted_px=found.predicted_px,
            lean_rad=found.lean_rad,
        )

    @cached_property
    def _systematic_px2(self) -> float:
        return self.settings.systematic_px**2 * self.settings.systematic_bearings

    @cached_property
    def _sway(self) -> doubted_camera.CameraDoubt:
        """A body that may lean, whose camera is as its file says."""
        return doubted_camera.CameraDoubt(self.settings.edge_noise_px, _SURE_PX, self.settings.lean.sway_std_rad)

    @cached_property
    def _doubt(self) -> doubted_camera.CameraDoubt:
        s = self.settings
        # without a viewpoint's height a tilt cannot be told
        tilt_std_rad = s.tilt_std_rad if self.camera.height_m is not None else 1e-6
        return doubted_camera.CameraDoubt(s.edge_noise_px, s.center_std_units * self._unit_px, tilt_std_rad)

    def _doubting_the_camera(
        self, estimate: PoseEstimate, fit: _Fit, radius_px: FloatArray
    ) -> tuple[PoseEstimate, FloatArray]:
        """Fit centre and tilt of the camera too where the outline contradicts its file; with the walls predicted.

        Not where the outline does not fix the pose then.
        """
        s = self.settings
        if estimate.inlier_ratio < s.min_doubt_ratio:
            return estimate, fit.predicted_px
        # what a lean explains is not the file's error
        scene = leaning(self._scene, *fit.lean_rad) if any(fit.lean_rad) else self._scene
        outline = self._outline(radius_px, self._scales(()))
        gain = doubted_camera.doubt_of_camera(estimate.pose.array, scene, outline, self._doubt)
        if gain < s.min_doubt * s.alike_bearings:
            return estimate, fit.predicted_px
        unknowns, covariance = np.zeros(doubted_camera.SIZE), np.empty((3, 3))
        unknowns[:3] = estimate.pose.array
        predicted = np.empty(len(radius_px))
        is_determined = doubted_camera.fit_with_camera(
            unknowns, scene, outline, self._doubt, s.few_groups, self._systematic_px2, predicted, covariance
        )
        x, y, theta = unknowns[:3].tolist()
        (xx, xy, _), (_, yy, _), _ = covariance.tolist()
        variance = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
        if not is_determined or variance > s.sliding_std_m**2 or not self.field.is_on_floor(x, y):
            return estimate, fit.predicted_px
        pose = Pose2(x, y, theta)
        return replace(estimate, pose=pose, covariance=covariance, candidates=(pose, pose.half_turn())), predicted

    def _judge(self, fit: _Fit) -> PoseEstimate | NotLocated:
        if fit.inlier_ratio < self.settings.min_inlier_ratio:
            return NotLocated(f"only {fit.inlier_ratio:.0%} of the floor's edge agrees with the field's walls")
        if fit.along_m > self.settings.max_std_m:
            return NotLocated("the part of the floor's edge in view does not fix the pose in every direction")
        x, y, theta = fit.pose.tolist()
        pose = Pose2(x, y, theta)
        if not self.field.is_on_floor(x, y):
            return NotLocated(f"the best fit puts the robot outside the field, at ({x:.2f}, {y:.2f}) m")
        return PoseEstimate(pose, fit.covariance, fit.inlier_ratio, fit.rms_px, (pose, pose.half_turn()))


@dataclass(frozen=True, slots=True)
class _Fit:
    cost: float
    pose: FloatArray
    covariance: FloatArray
    inlier_ratio: float
    rms_px: float
    along_m: float
    residual_px: FloatArray
    predicted_px: FloatArray
    lean_rad: tuple[float, float] = (0.0, 0.0)  # pitch and roll
