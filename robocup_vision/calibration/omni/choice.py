"""Chooses a mirror's family of curves, and whether its tilt is fitted, by points that are held out of the fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.calibration.omni.fit import Fit, JointFit, Points
from robocup_vision.calibration.omni.model import CURVES, TILT, Curve
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.shape import FieldShape


@dataclass(frozen=True, slots=True)
class Choice:
    """One family of cameras that was tried."""

    curve: Curve  #: its curve
    tilted: bool  #: whether its tilt was free
    held_out_cost: float  #: mean robust loss, 0 to 1, of the points held out of the fit
    held_out_px: float  #: median distance of those that agree, pixels


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    choice: Choice
    # (N,) of each point under the fit it was held out of
    loss: FloatArray


class Chooser:
    """Tries families of cameras on the same points.

    Parameters
    ----------
    fit : Fit
        Start of every family.
    reach : (float, float, float)
        Largest changes from the start, see `CameraModel.bounds`.
    unit_px : float
        Pixels of one unit of the weights' widths.
    settings : OmniCalibrationSettings, optional
        Its `choice`, `fit` and `model` are used.
    """

    def __init__(
        self,
        shape: FieldShape,
        points: Points,
        fit: Fit,
        reach: tuple[float, float, float],
        unit_px: float,
        settings: OmniCalibrationSettings = OmniCalibrationSettings(),
    ) -> None:
        self.shape, self.points, self.fit = shape, points, fit
        self._reach, self._all_settings, self._settings = reach, settings, settings.choice
        self._scales = (*(scale * unit_px for scale in settings.choice.scales), settings.choice.scale_px)
        sectors = settings.choice.sectors
        offset = points.pixels - np.array(fit.camera.center_px)
        sector = np.floor(np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) * sectors).astype(int)
        # other sectors in every other frame, so that no direction is held out everywhere
        self._half = halves(sector + points.frame, points.frame)
        self._tried: tuple[_Trial, ...] = ()
        # points of one sector of one frame err together
        self._group = np.unique(points.frame * 2 * sectors + sector, return_inverse=True)[1].ravel()

    def choose(self) -> tuple[Choice, ...]:
        """Return all that was tried, the best first: the fit's family, level, unless another is significantly better.

        Where lines may be painted somewhat beside where the field has them, a tilt is hardly ever significant; a level
        camera then puts the whole of it into the centre. So the tilt stays free, within what its prior says.
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

    def as_good(self, chosen: Choice) -> tuple[Choice, ...]:
        """Return the other curves that were tried and, tilted alike, explain the held-out points as well."""
        best = next((trial for trial in self._tried if trial.choice is chosen), None)
        if best is None:
            return ()
        return tuple(one.choice for one in self._tried if one is not best and not self._is_better(best, one))

    def _is_tilted(self, choice: Choice) -> bool:
        """Whether the tilt found is significant."""
        fit = self.final(choice, self._settings.scale_px)
        joint = self._joint(self.points)
        covariance = joint.covariance(fit)[TILT, TILT]
        tilt = fit.vector[TILT] - fit.model.vector(fit.model.frame)[TILT]
        return float(tilt @ np.linalg.solve(covariance, tilt)) > self._settings.min_tilt_chi2

    def _is_better(self, trial: _Trial, other: _Trial) -> bool:
        gain = np.bincount(self._group, self.points.weight * (other.loss - trial.loss))
        return bool(gain.sum() > self._settings.min_gain_stds * np.sqrt(np.sum(gain**2)))

    def final(self, choice: Choice, scale_px: float) -> Fit:
        """Fit a family to all points, down to a width in pixels."""
        return self._fit(self.points, choice.curve, choice.tilted, (*self._scales, scale_px))

    def _try(self, curve: Curve, tilted: bool) -> _Trial:
        residual = np.empty(len(self.points.pixels))
        for half in (0, 1):
            seen, hidden = self.points.take(self._half == half), self._half != half
            fit = self._fit(seen, curve, tilted, self._scales)
            residual[hidden] = self._joint(self.points.take(hidden)).residuals(fit.camera, fit.poses, fit.paint_m)
        square = np.minimum(residual**2, 1e6)
        scale_px = self._settings.scale_px
        loss = square / (square + scale_px**2)
        good = np.abs(residual)[np.abs(residual) < 3 * scale_px]
        weight = self.points.weight
        choice = Choice(
            curve, tilted, float(weight @ loss / weight.sum()), float(np.median(good)) if len(good) else np.inf
        )
        return _Trial(choice, loss)

    def _joint(self, points: Points) -> JointFit:
        return JointFit(self.shape, points, self._all_settings.fit, painted=True)

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
        bounds = model.bounds(start, *self._reach)
        return self._joint(points).solve(model, vector, self.fit.poses, tuple(scales), prior, bounds, free)


def halves(sector: Int64Array, frame: Int64Array) -> Int64Array:
    """Divide points (N,) into halves 0 and 1 by every other sector, so that each frame has points in both.

    Parameters
    ----------
    frame : (N,) int64
        Its frame, of at least two points.
    """
    half = sector % 2
    for one in np.unique(frame):
        own = np.flatnonzero(frame == one)
        if len(np.unique(half[own])) == 1:
            # a frame that shows a line in one direction only
            half[own] = np.arange(len(own)) % 2
    return half
