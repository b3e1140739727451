"""Model of a floor's outline for fits and searches: walls, the camera's curve and the scales of residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.walls import fit as kernels
from robocup_vision.kernels.walls.camera_fit import KNOWN, CameraErrors, FitRules, Fitted, fit_leaning, fit_outline
from robocup_vision.kernels.walls.fit import Vector
from robocup_vision.perception.polar_view import PolarView


def paper_pixel_px(camera: OmniCamera) -> float:
    """Return a pixel of the paper's 256 x 220 image in pixels of the camera: 1/86 of the usable image radius."""
    inner, outer = camera.usable_radius_px
    return max(1.0, (outer - inner) / 86.0)


@dataclass(frozen=True, slots=True)
class OutlineNoise:
    """Noise of a measured outline; "units" are 1/86 of the usable image radius."""

    edge_px: float = 0.15  #: standard deviation of a bearing's edge
    #: error of the camera file, which no image shows, and the number of bearings that share it (an eighth of the
    #: circle)
    systematic_px: float = 0.02
    systematic_bearings: int = 20
    #: factor on the covariance, because a sandwich covariance from about forty groups of bearings is biased low
    few_groups: float = 1.7
    last_scale_px: float = 1.0  #: width of the weights in the last step of a fit
    inlier: float = 1.5  #: greatest residual of an inlier, units

    @property
    def systematic_px2(self) -> float:
        """Variance that all bearings have in common, px^2."""
        return self.systematic_px**2 * self.systematic_bearings


@dataclass(frozen=True, slots=True)
class OutlineCameraSettings:
    """Errors of the camera file; "units" are 1/86 of the usable image radius."""

    center_std_units: float = 0.5  #: standard deviation of the centre
    turn_std_rad: float = 0.01  #: standard deviation of the tilt, of the file and of a moving body
    #: least decrease of the weighted sum of squares, divided by the remaining mean square, at which centre and tilt are
    #: fitted: chi-square of four unknowns, 99.9 %
    min_gain: float = 18.5
    #: widths of the redescending weights, units, when pose and tilt are fitted jointly from a prior: a body that brakes
    #: hard moves far boards by two units
    leaning_scales: tuple[float, ...] = (4.0, 2.0, 1.0)
    #: greatest standard deviation of the position of a body that may lean, including its prior: on a large field an
    #: unknown tilt may leave a direction undetermined
    max_leaning_std_m: float = 0.15


class OutlineFit(NamedTuple):
    """A pose fitted to an outline; a tuple, because one is made in each frame."""

    pose: Vector  #: x, y, theta
    covariance: FloatArray  #: (3, 3) float64: covariance of the pose
    cost: float  #: truncated mean cost, 0 (perfect) to 1
    #: ratio of inliers among the bearings with an edge and a wall, and their root mean square residual
    inlier_ratio: float
    rms_px: float
    along_m: float  #: greatest standard deviation of the position
    sliding_m: float  #: `along_m` without errors of the camera file; large if the pose can slide along walls
    #: (K,) float64: see `compare_outline`
    residual_px: FloatArray
    predicted_px: FloatArray


class OutlineModel:
    """Walls, camera and bearings of an outline, in the format of the compiled loops.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards.
    view : PolarView
        Defines the bearings.
    errors : OutlineCameraSettings
        Errors of the camera file and lean of the body.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        view: PolarView,
        noise: OutlineNoise = OutlineNoise(),
        errors: OutlineCameraSettings = OutlineCameraSettings(),
    ) -> None:
        self.field, self.view, self.noise, self.errors = field, view, noise, errors
        self.unit_px = paper_pixel_px(camera)  #: a pixel of the paper's image
        x, y, height = camera.viewpoint_m.tolist()
        #: the walls and the camera
        self.scene = kernels.WallScene(
            np.ascontiguousarray(field.walls),
            x,
            y,
            height,
            np.ascontiguousarray(camera.camera_to_robot.T),
            np.cos(view.bearing_rad),
            np.sin(view.bearing_rad),
        )
        curve, (inner, outer) = camera.floor_range, camera.usable_radius_px
        q_step, radius = camera.tabulated_radius_px()
        # nothing is visible beyond a table's last range
        #: step of the inverse range, and image radius (Q,) tabulated over it
        self.radius_of_q = q_step, np.where(np.isfinite(radius), radius, outer)
        radius = np.linspace(inner, outer, 512)
        # greatest range on the field
        farthest_m = 1.2 * float(np.ptp(field.floor_polygon, axis=0).max())
        q = np.maximum(np.nan_to_num(curve.inverse_range_per_m(radius)), 1.0 / farthest_m)
        #: least image radius, its step, and inverse range (R,) tabulated over it
        self.q_of_radius = inner, float(radius[1] - radius[0]), q
        rules = FitRules(
            self.scene,
            *self.radius_of_q,
            self.unit_px,
            noise.inlier * self.unit_px,
            noise.few_groups,
            noise.systematic_px2,
            CameraErrors(
                noise.edge_px,
                errors.center_std_units * self.unit_px,
                # without a viewpoint's height the tilt is not observable
                errors.turn_std_rad if camera.height_m is not None else KNOWN,
            ),
            errors.min_gain,
        )
        self._rules, self._trusting_rules = plain(rules), plain(rules._replace(min_gain=math.inf))

    def scales(self, units: tuple[float, ...]) -> FloatArray:
        """Return widths of the weights, pixels, ending with the last scale."""
        return np.array([*(unit * self.unit_px for unit in units), self.noise.last_scale_px])

    def fit(
        self, start: Vector, radius_px: FloatArray, scales: FloatArray, *, trusts_file: bool = False
    ) -> tuple[OutlineFit, int]:
        """Fit a pose, from a start x, y, theta, to an outline (K,); returns the fit and its number of bearings.

        Centre and tilt are fitted jointly if the outline contradicts the camera file, unless the file is trusted.
        """
        lines, covariance = np.empty((2, len(radius_px))), np.empty((3, 3))
        rules = self._trusting_rules if trusts_file else self._rules
        fitted = Fitted(*fit_outline(start, radius_px, scales, rules, lines, covariance))
        # estimates take read-only arrays without a copy
        covariance.setflags(write=False)
        return _outline_fit(fitted, covariance, lines), fitted.bearings

    def fit_leaning(self, starts: Sequence[Vector], radius_px: FloatArray) -> OutlineFit | None:
        """Return the best fit of a body that may lean to an outline (K,), from some poses x, y, theta; None if none.

        Its covariance includes the lean, whether or not the outline shows one.
        """
        scales = np.array(self.errors.leaning_scales) * self.unit_px
        best: OutlineFit | None = None
        for start in starts:
            lines, covariance = np.empty((2, len(radius_px))), np.empty((3, 3))
            fitted = Fitted(*fit_leaning(start, radius_px, scales, self._rules, lines, covariance))
            fit = _outline_fit(fitted, covariance, lines)
            # the variance of an unobserved direction is a rounding error
            if not (math.isfinite(fit.along_m) and np.all(np.linalg.eigvalsh(covariance) > 0)):
                continue
            if best is None or fit.cost < best.cost:
                best = fit
        return best


def _outline_fit(fitted: Fitted, covariance: FloatArray, lines: FloatArray) -> OutlineFit:
    residual, predicted = lines
    pose, _, cost, inlier_ratio, rms_px, along_m, sliding_m = fitted
    return OutlineFit(pose, covariance, cost, inlier_ratio, rms_px, along_m, sliding_m, residual, predicted)
