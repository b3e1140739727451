"""Which family of curves a mirror is, and whether images tell its tilt: settled by points that the fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit, Points
from robocup_vision.calibration.omni.model import CURVES, TILT, CameraModel, Curve

# points are held back by sectors of the image about the camera's centre, every other one
_SECTORS = 12
# width of the loss that families are compared by, pixels
_SCALE_PX = 1.0
# a family with more freedom must explain the points held back better by this many standard errors
_BEYOND_CHANCE = 2.0
# 2 degrees of freedom, 99.9 %
_TILTED = 13.8
_SCALES = (2.0, 1.0)


@dataclass(frozen=True, slots=True)
class Choice:
    """One family of cameras that was tried.

    Parameters
    ----------
    curve : {"hyperboloid", "tangent", "table"}
        Its curve.
    tilted : bool
        Whether its tilt was free.
    held_back_cost : float
        Mean robust loss, 0 to 1, of points that the fit did not see.
    held_back_px : float
        Median distance of those that agree, pixels.
    """

    curve: Curve
    tilted: bool
    held_back_cost: float
    held_back_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    choice: Choice
    # (N,) of every point by the fit that did not see it
    loss: FloatArray


class Chooser:
    """Tries families of cameras on the same points.

    Parameters
    ----------
    shape : FieldShape
        What the points lie on.
    points : Points
        All points.
    fit : Fit
        Explains them; where every family starts from.
    reach : (float, float, float)
        How far the start may be left, see `CameraModel.bounds`.
    unit_px : float
        What widths of weights are counted in.
    """

    def __init__(
        self, shape: FieldShape, points: Points, fit: Fit, reach: tuple[float, float, float], unit_px: float
    ) -> None:
        self.shape, self.points, self.fit = shape, points, fit
        self._reach = reach
        self._scales = (*(scale * unit_px for scale in _SCALES), _SCALE_PX)
        offset = points.pixels - np.array(fit.camera.center_px)
        sector = np.floor(np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) * _SECTORS).astype(int)
        # other sectors in every other frame, so that no direction is held back everywhere
        self._half = (sector + points.frame) % 2
        # points of one sector of one frame err together
        self._group = np.unique(points.frame * 2 * _SECTORS + sector, return_inverse=True)[1].ravel()

    def choose(self, usual: Curve) -> tuple[Choice, ...]:
        """Return what was tried, the best first: `usual`, level, unless another is better by more than chance."""
        tried = {curve: self._try(curve, True) for curve in CURVES}
        best = tried[usual]
        for curve in CURVES:
            if self._is_better(tried[curve], best):
                best = tried[curve]
        level = self._try(best.choice.curve, False)
        if not self._is_better(best, level) and not self._is_tilted(best.choice):
            best = level
        others = [trial.choice for trial in (*tried.values(), level) if trial is not best]
        return (best.choice, *others)

    def _is_tilted(self, choice: Choice) -> bool:
        """Whether the tilt found is too large for chance."""
        fit = self.final(choice, _SCALE_PX)
        joint = JointFit(self.shape, self.points)
        covariance = joint.covariance(fit)[TILT, TILT]
        tilt = fit.vector[TILT] - fit.model.vector(fit.model.frame)[TILT]
        return float(tilt @ np.linalg.solve(covariance, tilt)) > _TILTED

    def _is_better(self, trial: _Trial, other: _Trial) -> bool:
        gain = np.bincount(self._group, self.points.weight * (other.loss - trial.loss))
        return bool(gain.sum() > _BEYOND_CHANCE * np.sqrt(np.sum(gain**2)))

    def final(self, choice: Choice, scale_px: float) -> Fit:
        """Fit a family to all points, down to a width in pixels."""
        return self._fit(self.points, choice.curve, choice.tilted, (*self._scales, scale_px))

    def _try(self, curve: Curve, tilted: bool) -> _Trial:
        residual = np.empty(len(self.points.pixels))
        for half in (0, 1):
            seen, hidden = self.points.take(self._half == half), self._half != half
            fit = self._fit(seen, curve, tilted, self._scales)
            residual[hidden] = JointFit(self.shape, self.points.take(hidden)).residuals(fit.camera, fit.poses)
        square = np.minimum(residual**2, 1e6)
        loss = square / (square + _SCALE_PX**2)
        good = np.abs(residual)[np.abs(residual) < 3 * _SCALE_PX]
        weight = self.points.weight
        choice = Choice(
            curve, tilted, float(weight @ loss / weight.sum()), float(np.median(good)) if len(good) else np.inf
        )
        return _Trial(choice, loss)

    def _fit(self, points: Points, curve: Curve, tilted: bool, scales: Sequence[float]) -> Fit:
        model = CameraModel(self.fit.model.frame, curve)
        vector = model.vector(self.fit.camera)
        start = model.vector(model.frame)
        free = np.ones(model.size, dtype=bool)
        if not tilted:
            vector[TILT] = start[TILT]
            free[TILT] = False
        prior = vector.copy()
        prior[:4] = start[:4]
        bounds = model.bounds(start, *self._reach)
        return JointFit(self.shape, points).solve(model, vector, self.fit.poses, tuple(scales), prior, bounds, free)
