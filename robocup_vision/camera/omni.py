"""The mirror camera: pixels <-> rays <-> floor, with one curve of the image radius, a centre and a small tilt."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.camera.bounds import require_bounds
from robocup_vision.camera.floor_range import FloorRange
from robocup_vision.geometry import Pose2

# lengths and angles, see `camera.bounds`
BOUNDED_KEYS = ("offset_m", "heading_rad", "tilt_rad", "viewpoint_height_m")
# number of inverse ranges with tabulated image radii, whose steps are below a pixel
_TABULATED = 1024


@dataclass(frozen=True, eq=False)
class OmniCamera:
    """A camera that looks up into a mirror of revolution, which shows the floor all around the robot.

    Robot frame: x forward, y left, z up, origin on the floor. Camera frame: the same axes translated to the effective
    viewpoint, then rotated by the tilt. Image: u right, v down, pixel centres at integers.

    Parameters
    ----------
    size_px : (int, int)
        Width and height.
    center_px : (float, float)
        Image of the mirror's axis, u and v.
    usable_radius_px : (float, float)
        Inner and outer image radius of visible floor.
    floor_range : FloorRange
        Inverse range on the floor (1/m) over the image radius (px), for an untilted camera; the code calls it q.
    mirrored : bool
        Whether bearings increase clockwise in the image instead of counter-clockwise.
    heading_rad : float
        Bearing, in the robot frame, of the image's +u direction.
    offset_m : (float, float)
        Mirror axis, relative to the robot's centre, forward and left.
    tilt_rad : (float, float)
        Right-handed rotation about the robot's x, then y axis.
    viewpoint_height_m : float or None
        Height of the effective viewpoint above the floor. None for the curve's implied height, if it has one.
    """

    size_px: tuple[int, int]
    center_px: tuple[float, float]
    usable_radius_px: tuple[float, float]
    floor_range: FloorRange
    mirrored: bool = False
    heading_rad: float = 0.0
    offset_m: tuple[float, float] = (0.0, 0.0)
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    viewpoint_height_m: float | None = None

    def __post_init__(self) -> None:
        if self.viewpoint_height_m is None and self.floor_range.implied_height_m is None and any(self.tilt_rad):
            raise ArgumentError("viewpoint_height_m is needed when the camera is tilted")
        require_bounds({name: getattr(self, name) for name in BOUNDED_KEYS})

    @property
    def height_m(self) -> float | None:
        """Height of the effective viewpoint above the floor, metres; None if it is unknown."""
        if self.viewpoint_height_m is not None:
            return self.viewpoint_height_m
        return self.floor_range.implied_height_m

    @property
    def camera_in_robot(self) -> Pose2:
        """The mirror axis' foot on the floor, robot frame; its heading is the robot's."""
        return Pose2(*self.offset_m, 0.0)

    @property
    def _height_or_one(self) -> float:
        # the height cancels in the mapping of an untilted camera from pixels to the floor, so any value is valid
        return self.height_m if self.height_m is not None else 1.0

    @cached_property
    def camera_to_robot(self) -> FloatArray:
        """(3, 3) float64: rotation of directions from the camera frame into the robot frame, Ry(ty) Rx(tx)."""
        tx, ty = self.tilt_rad
        about_x = np.array([[1, 0, 0], [0, math.cos(tx), -math.sin(tx)], [0, math.sin(tx), math.cos(tx)]])
        about_y = np.array([[math.cos(ty), 0, math.sin(ty)], [0, 1, 0], [-math.sin(ty), 0, math.cos(ty)]])
        return read_only(about_y @ about_x)

    @property
    def viewpoint_m(self) -> FloatArray:
        """(3,) float64: effective viewpoint in the robot frame, metres."""
        return read_only([*self.offset_m, self._height_or_one])

    def tabulated_radius_px(self) -> tuple[float, FloatArray]:
        """Return a step of the inverse range, 1/m, and the image radii (Q,) float64 at its multiples from 0.

        The last one is the inner usable radius; they are NaN where the curve is undefined, as a table at the horizon.
        """
        q = np.linspace(0.0, float(self.floor_range.inverse_range_per_m(self.usable_radius_px[0])), _TABULATED)
        return float(q[1]), self.floor_range.radius_px(q)

    def image_bearing_rad(self, pixels: npt.ArrayLike) -> FloatArray:
        """Bearing (...,) of pixels (..., 2) about the mirror axis in the camera frame, radians."""
        delta = np.asarray(pixels, dtype=np.float64) - self.center_px
        sign = 1.0 if self.mirrored else -1.0
        return np.arctan2(sign * delta[..., 1], delta[..., 0]) + self.heading_rad

    def polar_to_pixel(self, bearing_rad: npt.ArrayLike, radius_px: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) at camera-frame bearings and image radii (broadcast together)."""
        angle = np.asarray(bearing_rad, dtype=np.float64) - self.heading_rad
        sign = 1.0 if self.mirrored else -1.0
        radius = np.asarray(radius_px, dtype=np.float64)
        u = self.center_px[0] + radius * np.cos(angle)
        v = self.center_px[1] + sign * radius * np.sin(angle)
        return np.stack(np.broadcast_arrays(u, v), axis=-1)

    def pixel_to_ray(self, pixels: npt.ArrayLike) -> FloatArray:
        """Return unit directions (..., 3) in the robot frame of pixels (..., 2); NaN where the curve is undefined.

        If `height_m` is None, elevations assume a viewpoint 1 m high.
        """
        points = np.asarray(pixels, dtype=np.float64)
        radius = np.hypot(points[..., 0] - self.center_px[0], points[..., 1] - self.center_px[1])
        q = self.floor_range.inverse_range_per_m(radius)
        bearing = self.image_bearing_rad(points)
        ray = np.stack([np.cos(bearing), np.sin(bearing), -q * self._height_or_one], axis=-1)
        down = np.isposinf(q)
        ray[down] = (0.0, 0.0, -1.0)
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
        return ray @ self.camera_to_robot.T

    def ray_to_pixel(self, directions: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of directions (..., 3) in the robot frame; NaN outside the mirror."""
        ray = np.asarray(directions, dtype=np.float64) @ self.camera_to_robot
        horizontal = np.hypot(ray[..., 0], ray[..., 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            q = -ray[..., 2] / (horizontal * self._height_or_one)
        radius = np.where(np.isneginf(q), np.nan, self.floor_range.radius_px(q))
        return self.polar_to_pixel(np.arctan2(ray[..., 1], ray[..., 0]), radius)

    def pixel_to_floor(self, pixels: npt.ArrayLike) -> FloatArray:
        """Floor points (..., 2), robot frame, metres, at pixels (..., 2); NaN on and above the horizon."""
        ray = self.pixel_to_ray(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(ray[..., 2] < -1e-9, -self._height_or_one / ray[..., 2], np.nan)
        return np.asarray(self.offset_m + ray[..., :2] * scale[..., None])

    def point_to_pixel(self, points_m: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of points (..., 3) in the robot frame, metres.

        Raises
        ------
        ArgumentError
            If a point is above the floor and `height_m` is unknown.
        """
        points = np.asarray(points_m, dtype=np.float64)
        if self.height_m is None and np.any(points[..., 2] != 0):
            raise ArgumentError("viewpoint_height_m is needed to see points above the floor")
        return self.ray_to_pixel(points - self.viewpoint_m)

    def floor_to_pixel(self, points_m: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of floor points (..., 2) in the robot frame, metres."""
        points = np.asarray(points_m, dtype=np.float64)
        return self.point_to_pixel(np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1))
