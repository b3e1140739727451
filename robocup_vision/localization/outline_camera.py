"""Fits what an outline shows besides the pose: the lean of the body, or errors of centre and tilt in the camera file.

A degree of lean moves a wall's foot that is seen 2 m away from 0.2 m above the floor by a third of a metre. Where the
walls of both sides and of an end are in view, the lean differs from every motion: it turns them against each other. So
does an error of centre or tilt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls import doubted_camera as kernels
from robocup_vision.kernels.walls.fit import FitSummary, FloorOutline, Vector, WallScene
from robocup_vision.localization.outline_model import OutlineCameraSettings, OutlineFit, OutlineModel

_POSE, _LEAN = slice(0, 3), slice(5, 7)


@dataclass(frozen=True, eq=False)
class OutlineCamera:
    """Fits the lean of the body, or centre and tilt of the camera, where an outline contradicts the camera file."""

    model: OutlineModel
    settings: OutlineCameraSettings

    def with_lean(self, fit: OutlineFit, radius_px: FloatArray) -> OutlineFit:
        """Return the fit of a leaning body to an outline (K,); the fit of the upright body where it does not lean."""
        model, gate = self.model, self.settings.lean_gate
        # most bodies stand upright most of the time
        if fit.lean_gain < gate:
            return fit
        outline = model.outline(radius_px, np.array([model.unit_px]))
        summary, unknowns, covariance, residual, predicted = self._fit(
            _start(fit.pose), model.scene, outline, self.model.lean_doubt
        )
        if not summary.cost < fit.cost or _is_within(unknowns[_LEAN], gate * covariance[_LEAN, _LEAN]):
            return fit
        return _leaning_fit(unknowns, covariance, summary, residual, predicted)

    def leaning(self, starts: Sequence[Vector], radius_px: FloatArray) -> OutlineFit | None:
        """Return the best fit of pose and lean together from some poses (3,); None where there is none.

        Its covariance is that of a body which may lean, whether or not the outline shows that it does.
        """
        best: OutlineFit | None = None
        for start in starts:
            unknowns = np.zeros(kernels.SIZE)
            unknowns[_POSE] = start
            for units in self.settings.open_scales:
                outline = self.model.outline(radius_px, np.array([units * self.model.unit_px]))
                fitted = self._fit(unknowns, self.model.scene, outline, self.model.lean_doubt)
                unknowns = fitted[1]
                if not math.isfinite(fitted[0].cost):
                    break
            summary, unknowns, covariance, residual, predicted = fitted
            if not summary.along_m <= self.settings.max_open_std_m:
                continue
            # where a direction is not observed at all, rounding decides its variance
            own = covariance[_POSE, _POSE]
            if not (np.isfinite(own).all() and np.all(np.linalg.eigvalsh(own) > 0)):
                continue
            if best is None or summary.cost < best.cost:
                best = _leaning_fit(unknowns, covariance, summary, residual, predicted)
        return best

    def corrected(
        self, estimate: PoseEstimate, fit: OutlineFit, radius_px: FloatArray, max_std_m: float
    ) -> tuple[PoseEstimate, FloatArray]:
        """Fit centre and tilt of the camera too where the outline contradicts its file; with the walls predicted.

        Not where the outline does not fix the pose then, to `max_std_m`.
        """
        model, settings = self.model, self.settings
        gain = self._file_gain(fit, radius_px) if fit.file_gain is None else fit.file_gain
        if gain < settings.min_gain * settings.alike_bearings:
            return estimate, fit.predicted_px
        outline = model.outline(radius_px, model.scales(()))
        summary, unknowns, covariance, _, predicted = self._fit(
            _start(fit.pose), self._scene(fit), outline, self.model.file_doubt
        )
        x, y, theta = unknowns[_POSE].tolist()
        own = covariance[_POSE, _POSE]
        if not summary.along_m <= max_std_m or not model.field.is_on_floor(x, y):
            return estimate, fit.predicted_px
        pose = Pose2(x, y, theta)
        return replace(estimate, pose=pose, covariance=own, candidates=(pose, pose.half_turn())), predicted

    def _scene(self, fit: OutlineFit) -> WallScene:
        """Return the walls as the leaning body of a fit sees them: the lean is not an error of the file."""
        return kernels.turned_scene(self.model.scene, *fit.lean_rad, True) if any(fit.lean_rad) else self.model.scene

    def _file_gain(self, fit: OutlineFit, radius_px: FloatArray) -> float:
        """Return the gain of another centre and tilt over the fit of a leaning body."""
        model = self.model
        outline = model.outline(radius_px, model.scales(()))
        return kernels.doubts_of_camera(
            np.array(fit.pose), self._scene(fit), outline, model.lean_doubt, model.file_doubt
        )[1]

    def _fit(
        self, start: FloatArray, scene: WallScene, outline: FloorOutline, doubt: kernels.CameraDoubt
    ) -> tuple[FitSummary, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the fit's summary, unknowns (7,), their covariance (7, 7), residuals and predicted walls (K,)."""
        noise, count = self.model.noise, len(outline.radius)
        unknowns, covariance = start.copy(), np.empty((kernels.SIZE, kernels.SIZE))
        residual, predicted = np.empty(count), np.empty(count)
        inlier_px = noise.inlier * self.model.unit_px
        rules = inlier_px, noise.few_groups, noise.systematic_px2
        summary = kernels.fit_with_camera(unknowns, scene, outline, doubt, *rules, residual, predicted, covariance)
        return summary, unknowns, covariance, residual, predicted


def _start(pose: Vector) -> FloatArray:
    """Unknowns (7,) of an upright body at a pose, whose camera is as its file says."""
    return np.append(pose, np.zeros(kernels.SIZE - 3))


def _leaning_fit(
    unknowns: FloatArray, covariance: FloatArray, summary: FitSummary, residual_px: FloatArray, predicted_px: FloatArray
) -> OutlineFit:
    """Return the fit of a body that leans, by unknowns (7,) and their covariance."""
    x, y, theta, _, _, about_x, about_y = unknowns.tolist()
    return OutlineFit((x, y, theta), covariance[_POSE, _POSE], *summary, residual_px, predicted_px, (about_x, about_y))


def _is_within(vector: FloatArray, bound: FloatArray) -> bool:
    """Whether a vector (2,) lies within the ellipse of a positive definite matrix (2, 2)."""
    (x, y), ((xx, xy), (_, yy)) = vector.tolist(), bound.tolist()
    return bool(yy * x * x - 2.0 * xy * x * y + xx * y * y < xx * yy - xy * xy)
