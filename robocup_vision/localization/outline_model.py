"""The model of a floor's outline: the field's walls, the camera's curve and the scales of the residuals.

The fit, the search and the checks of the camera use it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.walls import fit as kernels
from robocup_vision.kernels.walls.doubted_camera import CameraDoubt, UprightRules, fit_upright
from robocup_vision.kernels.walls.fit import Vector
from robocup_vision.perception.polar_view import PolarView

# standard deviations of a centre and a tilt that are taken as known
_SURE_PX, _SURE_RAD = 1e-6, 1e-6


def paper_pixel_px(camera: OmniCamera) -> float:
    """Return a pixel of the paper's 256 x 220 image in pixels of the camera: 1/86 of the usable image radius."""
    inner, outer = camera.usable_radius_px
    return max(1.0, (outer - inner) / 86.0)


@dataclass(frozen=True, slots=True)
class OutlineNoise:
    """How a measured outline errs; "units" are 1/86 of the usable image radius."""

    edge_px: float = 0.15  #: standard deviation of a bearing's edge
    #: error of the camera file, which no image shows, and the number of bearings that have it in common (an eighth
    #: of the circle)
    systematic_px: float = 0.02
    systematic_bearings: int = 20
    #: factor on the covariance: a sandwich covariance from some forty groups of bearings comes out low
    few_groups: float = 1.7
    last_scale_px: float = 1.0  #: width of the weights in the last step of a fit
    inlier: float = 1.5  #: residual of an inlier, units

    @property
    def systematic_px2(self) -> float:
        """As `summarise_fit` takes it."""
        return self.systematic_px**2 * self.systematic_bearings


@dataclass(frozen=True, slots=True)
class OutlineCameraSettings:
    """When an outline shows a lean or an error of the camera file; "units" are 1/86 of the usable image radius."""

    sway_std_rad: float = 0.01  #: standard deviation of pitch and roll of a moving body
    #: squared Mahalanobis distance from upright from which a lean is accepted: 99.9 % for two dimensions
    lean_gate: float = 13.8
    #: widths of the redescending weights, units, where pose and lean are fitted together from a prior: a body that
    #: brakes hard moves far boards by two units
    open_scales: tuple[float, ...] = (4.0, 2.0, 1.0)
    #: greatest standard deviation of the position in a fit of pose and lean: on a large field an unknown lean leaves
    #: some direction open
    max_open_std_m: float = 0.15
    #: standard deviations of centre and tilt where the camera file may be wrong
    center_std_units: float = 0.5
    tilt_std_rad: float = 0.004
    #: least gain per independent bearing by another centre and tilt, and the number of neighbouring bearings with
    #: correlated errors
    min_gain: float = 8.0
    alike_bearings: float = 3.0


class OutlineFit(NamedTuple):
    """A pose fitted to an outline; a tuple, as one is made in each frame."""

    pose: Vector  #: x, y, theta
    covariance: FloatArray  #: (3, 3) float64: of the pose
    cost: float  #: truncated mean cost, 0 (all fits) to 1 (nothing fits)
    #: bearings that agree, of those that show an edge and a wall, and their root mean square residual
    inlier_ratio: float
    rms_px: float
    along_m: float  #: largest standard deviation of the position
    #: (K,) float64: as the lines of `fit_upright`
    residual_px: FloatArray
    predicted_px: FloatArray
    lean_rad: tuple[float, float] = (0.0, 0.0)  #: turns of the body about x, ahead, and y, left, about its foot
    lean_gain: float = 0.0  #: gain of a lean over an upright body's fit, see `doubts_of_camera`
    #: gain of another centre and tilt of the camera; None where not computed yet
    file_gain: float | None = None


@dataclass(frozen=True, eq=False)
class OutlineModel:
    """Walls, camera and bearings of an outline, as the compiled loops take them."""

    field: Field  #: its floor is bounded by walls or boards
    camera: OmniCamera
    view: PolarView  #: defines the bearings
    noise: OutlineNoise
    file_errors: OutlineCameraSettings = OutlineCameraSettings()  #: errors of the camera file, and the body's lean

    @cached_property
    def unit_px(self) -> float:
        """A pixel of the paper's image."""
        return paper_pixel_px(self.camera)

    @cached_property
    def scene(self) -> kernels.WallScene:
        """The walls as the camera sees them."""
        x, y, height = self.camera.viewpoint_m
        to_camera = np.ascontiguousarray(self.camera.camera_to_robot.T)
        walls = np.ascontiguousarray(self.field.walls)
        cos, sin = np.cos(self.view.bearing_rad), np.sin(self.view.bearing_rad)
        return kernels.WallScene(walls, float(x), float(y), float(height), to_camera, cos, sin)

    @cached_property
    def half_scene(self) -> kernels.WallScene:
        """The scene with every second bearing."""
        return self.scene._replace(cos_b=self.scene.cos_b[::2].copy(), sin_b=self.scene.sin_b[::2].copy())

    @cached_property
    def radius_of_q(self) -> tuple[float, FloatArray]:
        """Step of the inverse range, and image radius (Q,) tabulated over it."""
        inner, outer = self.camera.usable_radius_px
        top = float(self.camera.floor_range.inverse_range_per_m(inner))
        q = np.linspace(0.0, top, 1024)
        radius = self.camera.floor_range.radius_px(q)
        # a table does not reach the horizon: beyond its last range nothing is seen
        return float(q[1]), np.where(np.isfinite(radius), radius, outer)

    @cached_property
    def q_of_radius(self) -> tuple[float, float, FloatArray]:
        """Least image radius, its step, and inverse range (R,) tabulated over it."""
        inner, outer = self.camera.usable_radius_px
        radius = np.linspace(inner, outer, 512)
        q = self.camera.floor_range.inverse_range_per_m(radius)
        # nothing on the field is farther away than its own length
        nearest = 1.2 * float(np.ptp(self.field.floor_polygon, axis=0).max())
        return inner, float(radius[1] - radius[0]), np.maximum(np.nan_to_num(q), 1.0 / nearest)

    def scales(self, units: tuple[float, ...]) -> FloatArray:
        """Return widths of the weights, pixels, down to the edges' own accuracy."""
        return np.array([*(unit * self.unit_px for unit in units), self.noise.last_scale_px])

    def outline(self, radius_px: FloatArray, scales: FloatArray) -> kernels.FloorOutline:
        """Return an outline (K,) with the widths of its weights, pixels."""
        return kernels.FloorOutline(radius_px, *self.radius_of_q, scales, self.unit_px)

    @cached_property
    def lean_doubt(self) -> CameraDoubt:
        """A body that may lean, whose camera is as its file says."""
        return CameraDoubt(self.noise.edge_px, _SURE_PX, self.file_errors.sway_std_rad, True)

    @cached_property
    def file_doubt(self) -> CameraDoubt:
        """A camera whose centre and tilt may be off its file."""
        # without a viewpoint's height a tilt cannot be observed
        tilt_std_rad = self.file_errors.tilt_std_rad if self.camera.height_m is not None else _SURE_RAD
        return CameraDoubt(self.noise.edge_px, self.file_errors.center_std_units * self.unit_px, tilt_std_rad, False)

    @cached_property
    def _rules(self) -> UprightRules:
        noise = self.noise
        return plain(
            UprightRules(
                self.scene,
                *self.radius_of_q,
                self.unit_px,
                noise.inlier * self.unit_px,
                noise.few_groups,
                noise.systematic_px2,
                self.lean_doubt,
                self.file_doubt,
            )
        )

    def fit(self, start: Vector, radius_px: FloatArray, scales: FloatArray) -> tuple[OutlineFit, int]:
        """Fit an upright body's pose, from a start x, y, theta, to an outline (K,); with the number of its bearings."""
        lines, covariance = np.empty((2, len(radius_px))), np.empty((3, 3))
        fitted = fit_upright(start, radius_px, scales, self._rules, lines, covariance)
        pose, bearings, cost, inlier_ratio, rms_px, along_m, by_lean, by_file = fitted
        # estimates take a read-only array without a copy
        covariance.setflags(write=False)
        residual, predicted = lines
        fit = OutlineFit(
            pose, covariance, cost, inlier_ratio, rms_px, along_m, residual, predicted, (0.0, 0.0), by_lean, by_file
        )
        return fit, bearings
