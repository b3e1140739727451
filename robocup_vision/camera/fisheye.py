"""The fisheye camera: pixels <-> rays <-> floor, with an image radius that increases with the angle off the axis.

It is a `PinholeCamera` for all users of these. Its rays may be more than 90 degrees off the axis, but methods based on
edges in the picture use only those within `WIDEST_RAD`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera

Projection = Literal["kannala_brandt", "equidistant", "equisolid"]
PROJECTIONS: tuple[Projection, ...] = ("kannala_brandt", "equidistant", "equisolid")
# greatest angle off the axis of a ray with a useful slope
WIDEST_RAD = math.radians(84.0)
_TABLE = 2049
_ANGLE_STEP_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class FisheyeCamera(PinholeCamera):
    """A camera whose lens maps a ray at angle t off its axis to a radius of about f t.

    The other parameters are those of `PinholeCamera`; `focal_px` is f along u and along v.

    Parameters
    ----------
    distortion : tuple of float
        Coefficients k1 to k4 of OpenCV's fisheye model for "kannala_brandt", empty for all 0. Else empty.
    projection : {"kannala_brandt", "equidistant", "equisolid"}
        r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9); r = f t; r = 2 f sin(t / 2).
    usable_radius_px : (float, float) or None
        Inner and outer radius of the lens's image circle, along u; None for the whole range of the projection.

    Raises
    ------
    ArgumentError
        If the projection is unknown, has other coefficients, or its radius does not increase from the axis.
    """

    projection: Projection = "kannala_brandt"
    usable_radius_px: tuple[float, float] | None = None
    _sloping_rad: ClassVar[float] = WIDEST_RAD

    def _check_lens(self) -> None:
        if self.projection not in PROJECTIONS:
            raise ArgumentError(f"projection must be one of {', '.join(PROJECTIONS)}, got {self.projection!r}")
        needed = (0, 4) if self.projection == "kannala_brandt" else (0,)
        if len(self.distortion) not in needed:
            counts = " or ".join(map(str, needed))
            raise ArgumentError(
                f"distortion must have {counts} coefficients with projection '{self.projection}',"
                f" got {len(self.distortion)}"
            )
        if self.usable_radius_px is not None:
            inner, outer = self.usable_radius_px
            if not 0.0 <= inner < outer < math.inf:
                raise ArgumentError(f"usable_radius_px must be 0 <= inner < outer, got {self.usable_radius_px!r}")

    @property
    def is_bent(self) -> bool:
        """See `PinholeCamera.is_bent`."""
        return True

    @property
    def without_lens(self) -> PinholeCamera:
        """See `PinholeCamera.without_lens`."""
        mounting = {field.name: getattr(self, field.name) for field in fields(PinholeCamera)}
        return PinholeCamera(**(mounting | {"distortion": ()}))

    @property
    def tangential(self) -> tuple[float, float]:
        """See `PinholeCamera.tangential`: none."""
        return 0.0, 0.0

    @property
    def coefficients(self) -> tuple[float, ...]:
        """k1 to k4 of the radius as an odd polynomial of the angle; 0 for the other projections."""
        return self.distortion or (0.0,) * 4

    def image_radius(self, angle_rad: FloatArray) -> FloatArray:
        """Radial distance (...) from the centre, in focal lengths, of rays at angles (...) off the axis."""
        if self.projection == "equisolid":
            return np.asarray(2.0 * np.sin(0.5 * angle_rad))
        k1, k2, k3, k4 = self.coefficients
        squared = angle_rad * angle_rad
        return np.asarray(angle_rad * (1.0 + squared * (k1 + squared * (k2 + squared * (k3 + squared * k4)))))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Angles and radii, in the range in which the radius increases."""
        angle = np.linspace(0.0, math.pi, _TABLE)
        radius = self.image_radius(angle)
        grows = np.diff(radius) > 0.0
        end = len(angle) if grows.all() else int(np.argmin(grows)) + 1
        if end < 2:
            raise ArgumentError(f"distortion {self.distortion!r} makes the radius fall from the axis on")
        return angle[:end], radius[:end]

    @property
    def widest_rad(self) -> float:
        """The greatest visible angle off the axis."""
        angle, radius = self._table
        if self.usable_radius_px is None:
            return float(angle[-1])
        return float(np.interp(self.usable_radius_px[1] / self.focal_px[0], radius, angle))

    @property
    def widest_slope(self) -> float:
        """See `PinholeCamera.widest_slope`: at most that of `WIDEST_RAD`."""
        return math.tan(min(self.widest_rad, self._sloping_rad))

    def in_size(self, size_px: tuple[int, int]) -> PinholeCamera:
        """See `PinholeCamera.in_size`."""
        other = super().in_size(size_px)
        if self.usable_radius_px is None or other is self:
            return other
        inner, outer = (radius * size_px[0] / self.size_px[0] for radius in self.usable_radius_px)
        return replace(cast("FisheyeCamera", other), usable_radius_px=(inner, outer))

    def angle_of_radius(self, radius: FloatArray) -> FloatArray:
        """Invert `image_radius`; NaN outside the lens's circle."""
        angles, radii = self._table
        angle = np.interp(radius, radii, angles)
        for _ in range(3):
            step = (self.image_radius(angle + _ANGLE_STEP_RAD) - self.image_radius(angle)) / _ANGLE_STEP_RAD
            with np.errstate(divide="ignore", invalid="ignore"):
                angle = np.clip(angle + (radius - self.image_radius(angle)) / step, 0.0, math.pi)
        return np.where(angle <= self.widest_rad + 1e-9, np.where(radius <= radii[-1], angle, np.nan), np.nan)

    def pixel_to_camera_ray(self, pixels: npt.ArrayLike) -> FloatArray:
        """Return unit directions (..., 3) in the camera frame of pixels (..., 2); NaN outside the lens."""
        plane = (np.asarray(pixels, dtype=np.float64) - self.center_px) / self.focal_px
        radius = np.hypot(plane[..., 0], plane[..., 1])
        angle = self.angle_of_radius(radius)
        inner = 0.0 if self.usable_radius_px is None else self.usable_radius_px[0] / self.focal_px[0]
        angle = np.where(radius >= inner, angle, np.nan)
        across = np.where(radius > 0.0, np.sin(angle) / np.where(radius > 0.0, radius, 1.0), 1.0)
        return np.concatenate([np.cos(angle)[..., None], -plane * across[..., None]], axis=-1)

    def camera_ray_to_pixel(self, rays: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of directions (..., 3) in the camera frame; NaN outside the lens's circle."""
        ray = np.asarray(rays, dtype=np.float64)
        aside = np.hypot(ray[..., 1], ray[..., 2])
        angle = np.arctan2(aside, ray[..., 0])
        radius = np.where(angle <= self.widest_rad, self.image_radius(angle), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(aside > 0.0, radius / np.where(aside > 0.0, aside, 1.0), radius)
        return np.asarray(-ray[..., 1:] * scale[..., None] * self.focal_px + self.center_px)

    def ideal_slopes(self, pixels: npt.ArrayLike) -> FloatArray:
        """See `PinholeCamera.ideal_slopes`: NaN beyond `WIDEST_RAD` off the axis."""
        ray = self.pixel_to_camera_ray(pixels)
        ahead = np.where(ray[..., :1] >= math.cos(self._sloping_rad) - 1e-12, ray[..., :1], np.nan)
        return np.asarray(-ray[..., 1:] / ahead)

    def pixel_to_floor(self, pixels: npt.ArrayLike) -> FloatArray:
        """Floor points (..., 2), robot frame, metres, at pixels (..., 2); NaN on and above the horizon."""
        ray = self.pixel_to_ray(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(ray[..., 2] < -1e-9, -self.height_m / ray[..., 2], np.nan)
        return np.asarray(self.viewpoint_m[:2] + ray[..., :2] * scale[..., None])
