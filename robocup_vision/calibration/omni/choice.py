"""Choice of a mirror's family of curves, and whether to fit its tilt, by cross-validation; checks of the result."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit, Points, truncated
from robocup_vision.calibration.omni.model import CENTER, CURVES, HORIZON, MAX_TILT_RAD, SCALE, TILT, Curve
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.starts import Observer, Sighting
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2

# greatest residual of an inlier, in units of `Search.unit_px`
AGREEMENT = 2.0
# sectors of the image about the camera's centre; every other one is held out
_SECTORS = 12
# residual scales of the loss: all but the last in units of `Search.unit_px`; the last, by which families are compared,
# is a few times the points' noise
_SCALES, _SCALE_PX = (2.0, 1.0), 1.0
# least gain on held-out points, in standard errors, for a family with more parameters
_MIN_GAIN_STDS = 2.0
# chi-square of a significant tilt: 2 degrees of freedom, 99.9 %
_MIN_TILT_CHI2 = 13.8
# correlation above which two numbers are reported as inseparable
_MAX_CORRELATION = 0.9
# least number of points on a visible line, and their least ratio among all inliers
_MIN_FEATURE_POINTS, _MIN_FEATURE_RATIO = 12, 0.02
# without walls: ranges, in robot radii, that must be determined
_RANGE_RADII = np.array([3.0, 6.0, 10.0])

MORE = "give more frames, from other places and headings"


@dataclass(frozen=True, slots=True)
class Choice:
    """One evaluated family of cameras."""

    curve: Curve  #: its curve
    tilted: bool  #: whether its tilt was fitted
    held_out_cost: float  #: mean robust loss, 0 to 1, of the held-out points
    held_out_px: float  #: median residual of their inliers, pixels


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    choice: Choice
    # (N,) loss of each point under the fit that did not use it
    loss: FloatArray


class Chooser:
    """Compares families of cameras on the same points.

    Parameters
    ----------
    fit : Fit
        Start of every family.
    max_change : (float, float, float)
        Greatest changes from the start, see `CameraModel.bounds`.
    unit_px : float
        See `Search.unit_px`.
    """

    def __init__(
        self,
        shape: FieldShape,
        points: Points,
        fit: Fit,
        max_change: tuple[float, float, float],
        unit_px: float,
    ) -> None:
        self.shape, self.points, self.fit = shape, points, fit
        self._max_change = max_change
        self._scales = (*(scale * unit_px for scale in _SCALES), _SCALE_PX)
        offset = points.pixels - np.array(fit.camera.center_px)
        sector = np.floor(np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) * _SECTORS).astype(int)
        # alternating between frames, so that no direction is held out in all of them
        self._half = halves(sector + points.frame, points.frame)
        self._tried: tuple[_Trial, ...] = ()
        # errors within one sector of a frame are correlated
        self._group = np.unique(points.frame * 2 * _SECTORS + sector, return_inverse=True)[1].ravel()

    def choose(self) -> tuple[Choice, ...]:
        """Return all choices, best first: the fit's family without tilt, unless another is significantly better.

        If painted lines may deviate from the field file, a tilt is seldom significant, and an untilted camera would
        compensate all of it by its centre. There the tilt is always fitted, under its prior.
        """
        usual = self.fit.model.curve
        assert usual != "magnified"
        curves = dict.fromkeys((usual, *CURVES))
        tried = {curve: self._try(curve, True) for curve in curves}
        self._tried = tuple(tried.values())
        best = tried[usual]
        for curve in curves:
            if self._is_better(tried[curve], best):
                best = tried[curve]
        if self.shape.paint_std_m > 0:
            return (best.choice, *(trial.choice for trial in tried.values() if trial is not best))
        level = self._try(best.choice.curve, False)
        if not self._is_better(best, level) and not self._is_tilted(best.choice):
            best = level
        others = [trial.choice for trial in (*tried.values(), level) if trial is not best]
        return (best.choice, *others)

    def equally_good(self, chosen: Choice) -> tuple[Choice, ...]:
        """Return the other tilted curves that are not significantly worse on the held-out points."""
        best = next((trial for trial in self._tried if trial.choice is chosen), None)
        if best is None:
            return ()
        return tuple(one.choice for one in self._tried if one is not best and not self._is_better(best, one))

    def _is_tilted(self, choice: Choice) -> bool:
        """Whether the fitted tilt is significant."""
        fit = self.final(choice, _SCALE_PX)
        covariance = self._joint(self.points).covariance(fit)[TILT, TILT]
        tilt = fit.vector[TILT] - fit.model.vector(fit.model.frame)[TILT]
        return float(tilt @ np.linalg.solve(covariance, tilt)) > _MIN_TILT_CHI2

    def _is_better(self, trial: _Trial, other: _Trial) -> bool:
        gain = np.bincount(self._group, self.points.weight * (other.loss - trial.loss))
        return bool(gain.sum() > _MIN_GAIN_STDS * np.sqrt(np.sum(gain**2)))

    def final(self, choice: Choice, scale_px: float) -> Fit:
        """Fit a family to all points, with a final residual scale in pixels."""
        return self._fit(self.points, choice.curve, choice.tilted, (*self._scales, scale_px))

    def _try(self, curve: Curve, tilted: bool) -> _Trial:
        residual = np.empty(len(self.points.pixels))
        for half in (0, 1):
            seen, hidden = self.points.take(self._half == half), self._half != half
            fit = self._fit(seen, curve, tilted, self._scales)
            residual[hidden] = self._joint(self.points.take(hidden)).residuals(fit.camera, fit.poses, fit.paint_m)
        loss = truncated(residual, _SCALE_PX)
        good = np.abs(residual)[np.abs(residual) < 3 * _SCALE_PX]
        weight = self.points.weight
        choice = Choice(
            curve, tilted, float(weight @ loss / weight.sum()), float(np.median(good)) if len(good) else np.inf
        )
        return _Trial(choice, loss)

    def _joint(self, points: Points) -> JointFit:
        return JointFit(self.shape, points, painted=True)

    def _fit(self, points: Points, curve: Curve, tilted: bool, scales: Sequence[float]) -> Fit:
        model = dataclasses.replace(self.fit.model, curve=curve)
        vector = self.fit.vector.copy() if model.curve == self.fit.model.curve else model.vector(self.fit.camera)
        start = model.vector(model.frame)
        free = np.ones(model.size, dtype=bool)
        if not tilted:
            vector[TILT] = start[TILT]
            free[TILT] = False
        prior = start.copy()
        if curve != "own":
            prior[4:] = vector[4:]
        bounds = model.bounds(start, *self._max_change)
        return self._joint(points).solve(model, vector, self.fit.poses, tuple(scales), prior, bounds, free)


def halves(sector: Int64Array, frame: Int64Array) -> Int64Array:
    """Split points (N,) into halves 0 and 1 by even and odd sectors, so that each frame has points in both.

    Parameters
    ----------
    frame : (N,) int64
        Frame of each point; at least two points in each.
    """
    half = sector % 2
    for one in np.unique(frame):
        own = np.flatnonzero(frame == one)
        if len(np.unique(half[own])) == 1:
            # all points in one sector
            half[own] = np.arange(len(own)) % 2
    return half


@dataclass(frozen=True, eq=False)
class CalibratedFrame:
    """One frame of a calibration."""

    index: int  #: index in the given sequence
    name: str
    pose: Pose2  #: pose of the robot; on a point-symmetric field possibly rotated by half a turn
    #: (B, 2) float64, (L, 2) float64: points of the floor's edge and of painted lines
    boundary_px: FloatArray
    line_px: FloatArray
    #: (B,) float64, (L,) float64: their signed residuals from the walls and lines
    boundary_residual_px: FloatArray
    line_residual_px: FloatArray


@dataclass(frozen=True, eq=False)
class OmniCalibration:
    """A calibrated mirror camera with its uncertainty."""

    camera: OmniCamera  #: ready for a camera file
    frames: tuple[CalibratedFrame, ...]  #: the frames used
    #: standard deviations: ``center_u_px``, ``center_v_px``, ``tilt_x_rad``, ``tilt_y_rad``, and the relative ones of
    #: the curve's main parameters, ``scale`` (near the centre) and ``horizon``. They are marginal, so that they are
    #: large for correlated parameters.
    std: dict[str, float]
    choices: tuple[Choice, ...]  #: evaluated families of curves, the chosen one first
    notes: tuple[str, ...]  #: parameters that the images do not determine or separate, and unused frames


def standard_deviations(covariance: FloatArray) -> dict[str, float]:
    """Return the square roots of a covariance's diagonal (G, G) with the names of `OmniCalibration.std`."""
    std = np.sqrt(np.diag(covariance))
    names = ("center_u_px", "center_v_px", "tilt_x_rad", "tilt_y_rad", "scale", "horizon")
    return {name: float(value) for name, value in zip(names, std, strict=False)}


def range_std(
    fit: Fit, covariance: FloatArray, radius_px: FloatArray, equally_good: Sequence[OmniCamera] = ()
) -> FloatArray:
    """Return the greatest relative standard deviation (R,), over all bearings, of the floor range at image radii (R,).

    The range is measured from the foot of the mirror's axis, where the calibration puts the robot, so that a centre and
    a tilt that compensate for each other do not change it. Equally good cameras contribute their differences.
    """
    bearing = np.arange(12) * math.tau / 12
    pixels = fit.camera.polar_to_pixel(bearing[:, None], radius_px[None]).reshape(-1, 2)
    floor_m = fit.camera.pixel_to_floor(pixels)
    range_m = np.hypot(*floor_m.T)
    by_vector = np.empty((len(pixels), len(fit.vector)))
    for g in range(len(fit.vector)):
        ahead = fit.vector.copy()
        ahead[g] += 1e-4
        by_vector[:, g] = (np.hypot(*fit.model.camera(ahead).pixel_to_floor(pixels).T) - range_m) / 1e-4
    variance = np.einsum("ng,gh,nh->n", by_vector, covariance, by_vector)
    for camera in equally_good:
        variance += (np.hypot(*camera.pixel_to_floor(pixels).T) - range_m) ** 2 / (len(equally_good) + 1)
    variance /= range_m**2
    std: FloatArray = np.sqrt(np.fmax.reduce(variance.reshape(len(bearing), -1), axis=0))
    return std


def undetermined(covariance: FloatArray, tilted: bool, unknown: bool) -> list[str]:
    """Return a note for each parameter that the images do not determine, or do not separate from another.

    Parameters
    ----------
    tilted : bool
        Whether the tilt was fitted.
    unknown : bool
        Whether there is no start.
    """
    notes = []
    std = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(std, std)
    for tilt, center, names in ((2, 1, ("center v", "tilt x")), (3, 0, ("center u", "tilt y"))):
        if abs(correlation[tilt, center]) > _MAX_CORRELATION:
            px = abs(covariance[tilt, center] / covariance[tilt, tilt]) * math.radians(0.1)
            notes.append(
                f"{' and '.join(names)} are hard to separate (correlation "
                f"{correlation[tilt, center]:+.2f}): {px:.2f} px of the first look like 0.1 degrees of the second"
            )
    if not tilted:
        fixed = "zero" if unknown else "the start's"
        notes.append(f"the images do not separate the tilt from the centre: the tilt is {fixed}, the centre fits it")
    origin = "assumed" if unknown else "taken from the start"
    notes.append(f"heading, offset and mirroring of the camera are {origin}: pictures of a field do not show them")
    return notes


def confirmed(
    field: Field,
    frames: Sequence[UInt8Array],
    fit: Fit,
    sightings: Sequence[Sighting],
    mask: UInt8Array | None = None,
    settings: OmniCalibrationSettings = OmniCalibrationSettings(),
) -> tuple[list[Sighting], dict[int, str]]:
    """Verify a fit by locating the robot in each frame with the fitted camera.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8
        All frames, to which the sightings' indices refer.
    fit : Fit
        Camera, and the pose of each sighting.
    mask : (H, W) uint8, optional
        Non-zero pixels are ignored.

    Returns
    -------
    list of Sighting
        Sightings whose located pose agrees with the fit, with the fit's poses.
    dict of int to str
        Reason for each other frame, by its index.
    """
    observer = Observer(field, fit.model.written(fit.vector), mask, locate=True)
    max_m = settings.max_confirmed_radii * field.robot_radius_m
    kept, notes = [], {}
    for sighting, array in zip(sightings, fit.poses, strict=True):
        pose = Pose2(*array.tolist())
        seen = observer.look(sighting.index, frames[sighting.index]).pose
        if seen is None:
            notes[sighting.index] = "by the camera found, the robot does not find itself in it"
        elif seen.error_to(pose, symmetric=not field.halves_differ)[0] > max_m:
            notes[sighting.index] = "by the camera found, the robot is somewhere else"
        else:
            kept.append(dataclasses.replace(sighting, pose=pose))
    return kept, notes


@dataclass(frozen=True, eq=False)
class Trust:
    """Checks whether a fit is reliable."""

    shape: FieldShape
    started: bool  #: whether there is a start
    unit_px: float  #: see `Search.unit_px`
    #: greatest changes of the centre (px) and of the logarithms of scale and horizon from the start
    max_change: tuple[float, float, float]
    settings: OmniCalibrationSettings = OmniCalibrationSettings()

    def problem(self, fit: Fit, covariance: FloatArray, points: Points) -> str:
        """Return why a fit is not reliable; empty if it is."""
        settings, field = self.settings, self.shape.field
        agrees = np.abs(fit.residual_px) < AGREEMENT * self.unit_px
        ratio = float(points.weight[agrees].sum() / points.weight.sum())
        if ratio < settings.min_inlier_ratio:
            return f"only {ratio:.0%} of the points found lie on the walls and lines of field '{field.name}'"
        is_free = not self.started and not field.is_bounded
        if is_free and self._features(fit, points, agrees) < settings.min_features:
            return "the few lines in view look alike at any size; give more frames, from other places, or a start"
        problem = "" if field.is_bounded else self._unsure_of_lines(fit, covariance, points, agrees)
        if problem:
            return problem
        side = min(fit.camera.size_px)
        std = np.sqrt(np.diag(covariance))
        if std[CENTER].max() > settings.max_center_std_ratio * side:
            return (
                f"the images do not determine the centre: its standard deviation is {std[CENTER].max():.1f} px; {MORE}"
            )
        if std[SCALE : HORIZON + 1].max() > settings.max_curve_std:
            worst = 100 * std[SCALE : HORIZON + 1].max()
            return f"the images do not determine the mirror's curve: its standard deviation is {worst:.0f} %; {MORE}"
        low, high = fit.model.bounds(fit.model.vector(fit.model.frame), *self.max_change)
        off = np.minimum(fit.vector - low, high - fit.vector)
        if off[CENTER].min() < 1e-6:
            limit = f"{self.max_change[0]:.0f} px from the start's"
            return f"the centre reached its limit, {limit}: are camera file and field those of the images?"
        if self.started and off[SCALE : HORIZON + 1].min() < 1e-6:
            return "the curve reached the limit that the start sets" + "; try without a start" * field.is_bounded
        return ""

    def range_note(self, fit: Fit, covariance: FloatArray, equally_good: Sequence[OmniCamera] = ()) -> str:
        """Return the standard deviations of the floor range, near and far, also with equally good cameras."""
        ranges_m = _RANGE_RADII * self.shape.field.robot_radius_m

        def known(cameras: Sequence[OmniCamera]) -> str:
            near_to_far = zip(self._range_std(fit, covariance, cameras), ranges_m, strict=True)
            return ", ".join(f"{100 * std:.1f} % at {range_m:.2g} m" for std, range_m in near_to_far if std >= 0)

        note = f"its standard deviation is {known(())}"
        if not equally_good:
            return note
        return f"{note} by this curve; {known(equally_good)} with others that explain as much"

    def _range_std(self, fit: Fit, covariance: FloatArray, equally_good: Sequence[OmniCamera] = ()) -> FloatArray:
        inverse_per_m = 1.0 / (_RANGE_RADII * self.shape.field.robot_radius_m)
        return range_std(fit, covariance, fit.camera.floor_range.radius_px(inverse_per_m), equally_good)

    def _unsure_of_lines(self, fit: Fit, covariance: FloatArray, points: Points, agrees: npt.NDArray[np.bool_]) -> str:
        """Return why lines alone do not determine the camera; empty if they do."""
        settings, field = self.settings, self.shape.field
        features = self._features(fit, points, agrees)
        single, unknown = len(fit.poses) == 1, not self.started
        if single and features < (settings.min_single_features if unknown else settings.min_started_features):
            return f"one image of so few lines does not determine a camera: lines lie where they were painted; {MORE}"
        few = single and features <= settings.min_started_features
        height_m, highest_m = fit.camera.height_m or 0.0, settings.max_height_radii * field.robot_radius_m
        if few and unknown and height_m > highest_m:
            # a similar field of another size fits with a higher mirror
            return (
                f"the curve is that of a mirror {height_m:.2f} m high, more than robots are: is field "
                f"'{field.name}' that of the image? {MORE}, or a start"
            )
        off_m = float(np.hypot(*fit.camera.tilt_rad)) * height_m
        if off_m > MAX_TILT_RAD * highest_m:
            return (
                f"the tilt found puts the mirror's axis {100 * off_m:.0f} cm beside the robot's place: give a start "
                f"with viewpoint_height_m, or {MORE.removeprefix('give ')}"
            )
        limit = settings.max_range_std if few or unknown else settings.max_started_range_std
        if np.nanmax(self._range_std(fit, covariance)) > limit:
            return f"the images do not determine the floor's range: {self.range_note(fit, covariance)}; {MORE}"
        return ""

    def _features(self, fit: Fit, points: Points, agrees: npt.NDArray[np.bool_]) -> int:
        """Return the number of the field's lines and arcs with enough points."""
        floor_m = fit.camera.pixel_to_floor(points.pixels[agrees])
        frame = points.frame[agrees]
        count = np.zeros(len(self.shape.lines) + len(self.shape.arcs), dtype=np.int64)
        for place, pose in enumerate(fit.poses):
            on_field = Pose2(*pose.tolist()).transform(floor_m[frame == place])
            on_field = on_field[np.isfinite(on_field).all(axis=1)]
            count += np.bincount(self.shape.nearest(on_field).which, minlength=len(count))
        least = max(_MIN_FEATURE_POINTS, _MIN_FEATURE_RATIO * count.sum())
        return int(np.count_nonzero(count >= least))
