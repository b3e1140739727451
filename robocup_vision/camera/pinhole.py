"""The pinhole camera: pixels <-> rays <-> floor, with focal length, OpenCV's lens distortion and a mounting.

Camera frame: x ahead along the optical axis, y left, z up. Ideal pixels are those of a lens without distortion.
`pan_rad`, `tilt_rad` and `roll_rad` may be None if a neck moves between frames (`Mounting`): only the mappings to and
from the robot frame need the tilt. `kernels.algebra.pinhole` has the same equations for compiled code.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.camera.bounds import problem_of, require_bounds
from robocup_vision.geometry import Pose2

# least depth of a point with a pixel
_MIN_DEPTH_M = 1e-6
# allowed numbers of OpenCV's distortion coefficients
DISTORTION_LENGTHS = (0, 4, 5, 8)
_WIDEST_SLOPE = 8.0  # tangent of the greatest angle off the axis of a distorted lens: 83 degrees
# tolerance of the inverted distortion, as a slope
_DISTORTED_STEP = 1e-12
# standard deviation of tilt and roll of a walking robot about those at rest; and of an unknown roll: robots hold their
# cameras roughly upright
SWAY_STD_RAD, UPRIGHT_STD_RAD = 0.02, 0.1
# step of the numerical derivative of a fisheye's radius
_ANGLE_STEP_RAD = 1e-6
_LOOKS_AHEAD = read_only(np.eye(3))


def camera_rotation(pan_rad: npt.ArrayLike, tilt_rad: npt.ArrayLike, roll_rad: npt.ArrayLike) -> FloatArray:
    """Rotation (..., 3, 3) from the camera frame into that of the angles (...), Rz(pan) Ry(-tilt) Rx(roll).

    Both frames are x forward, y left, z up; a positive tilt is upwards. All three angles have the same shape.
    """
    cp, sp = np.cos(pan_rad), np.sin(pan_rad)
    ct, st = np.cos(tilt_rad), np.sin(tilt_rad)
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    rotation = np.empty((*np.shape(cp), 3, 3))
    rotation[..., 0, 0], rotation[..., 0, 1], rotation[..., 0, 2] = (
        cp * ct,
        -sp * cr - cp * st * sr,
        sp * sr - cp * st * cr,
    )
    rotation[..., 1, 0], rotation[..., 1, 1], rotation[..., 1, 2] = (
        sp * ct,
        cp * cr - sp * st * sr,
        -cp * sr - sp * st * cr,
    )
    rotation[..., 2, 0], rotation[..., 2, 1], rotation[..., 2, 2] = st, ct * sr, ct * cr
    return rotation


def project_ideal(
    focal_px: tuple[float | FloatArray, float | FloatArray], center_px: tuple[float, float], points_m: npt.ArrayLike
) -> FloatArray:
    """Ideal pixels (..., 2) of points (..., 3) of the camera frame, metres; NaN behind the camera."""
    points = np.asarray(points_m, dtype=np.float64)
    depth = np.where(points[..., 0] > _MIN_DEPTH_M, points[..., 0], np.nan)
    (fu, fv), (cu, cv) = focal_px, center_px
    return np.stack([cu - fu * points[..., 1] / depth, cv - fv * points[..., 2] / depth], axis=-1)


@dataclass(frozen=True, slots=True)
class Mounting:
    """Orientation and height of a pinhole camera in one frame; None stands for the camera file's value.

    The angles are those of the camera file: R = Rz(pan) Ry(-tilt) Rx(roll), robot frame, with a negative tilt
    downwards. A measured sway of the body is part of tilt and roll; an unmeasured one is in their standard deviations.

    Parameters
    ----------
    pan_rad, tilt_rad, roll_rad : float or None
        Orientation.
    height_m : float or None
        Height of the centre of projection above the floor.
    pan_std_rad, tilt_std_rad, roll_std_rad, height_std_m : float or None
        Standard deviations of these in this frame.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.
    """

    pan_rad: float | None = None
    tilt_rad: float | None = None
    roll_rad: float | None = None
    height_m: float | None = None
    pan_std_rad: float | None = None
    tilt_std_rad: float | None = None
    roll_std_rad: float | None = None
    height_std_m: float | None = None

    def __post_init__(self) -> None:
        for name, value in self.known.items():
            if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
                raise ArgumentError(f"a mounting's {name} must be a finite number, got {value!r}")
            problem = problem_of(name, value)
            if problem is not None:
                raise ArgumentError(f"a mounting's {name} {problem.what}, got {value!r}{problem.hint}")

    @property
    def known(self) -> dict[str, float]:
        """Values that are not None, by name."""
        return {name: value for name in MOUNTING_NAMES if (value := getattr(self, name)) is not None}

    @property
    def pans_only(self) -> bool:
        """Whether it contains only the pan and its standard deviation."""
        return not self.known.keys() - {"pan_rad", "pan_std_rad"}


# also the columns of frames.csv
MOUNTING_NAMES = tuple(field.name for field in dataclasses.fields(Mounting))
# lengths and angles, see `camera.bounds`
BOUNDED_KEYS = (*MOUNTING_NAMES, "offset_m", "focal_std_px", "readout_s")
_MOUNTING_BUT_PAN = tuple(name for name in MOUNTING_NAMES if not name.startswith("pan_"))


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """A forward-looking camera with one centre of projection.

    Robot frame: x forward, y left, z up, origin on the floor. Camera frame: the same axes translated to the centre of
    projection and rotated by pan, tilt and roll; the optical axis is its +x, image u increases towards its -y, v
    towards its -z. Image: u right, v down, pixel centres at integers.

    Parameters
    ----------
    size_px : (int, int)
        Width and height.
    focal_px : (float, float)
        Focal length in pixels along u and along v.
    center_px : (float, float)
        Image of the optical axis, u and v.
    height_m : float
        Height of the centre of projection above the floor.
    distortion : tuple of float
        OpenCV's coefficients k1, k2, p1, p2[, k3[, k4, k5, k6]]; empty for none.
    offset_m : (float, float)
        Centre of projection, forward and left of the robot's centre.
    pan_rad, tilt_rad, roll_rad : float or None
        Orientation in the robot frame, see `camera_rotation`; None if unknown.
    height_std_m, focal_std_px : float
        Standard deviations of `height_m` and `focal_px`.
    roll_std_rad : float or None
        Standard deviation of the roll about `roll_rad` (or 0); None if unknown.
    tilt_std_rad : float or None
        Standard deviation of the tilt about `tilt_rad`; None for that of the roll.
    pan_std_rad : float
        Standard deviation of the pan about `pan_rad`.
    readout_s : float
        Rolling shutter: time between readout of the first and the last row (`RollingShutter`).
    """

    size_px: tuple[int, int]
    focal_px: tuple[float, float]
    center_px: tuple[float, float]
    height_m: float
    distortion: tuple[float, ...] = ()
    offset_m: tuple[float, float] = (0.0, 0.0)
    pan_rad: float | None = None
    tilt_rad: float | None = None
    roll_rad: float | None = None
    height_std_m: float = 0.01
    focal_std_px: float = 0.0
    roll_std_rad: float | None = None
    tilt_std_rad: float | None = None
    pan_std_rad: float = 0.0
    readout_s: float = 0.0

    def __post_init__(self) -> None:
        for name, values in (
            ("size_px", self.size_px),
            ("focal_px", self.focal_px),
        ):
            if not all(value > 0 for value in values):
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)!r}")
        self._check_lens()

    def _check_lens(self) -> None:
        if len(self.distortion) not in DISTORTION_LENGTHS:
            raise ArgumentError(f"distortion must have 0, 4, 5 or 8 coefficients, got {len(self.distortion)}")
        require_bounds({name: getattr(self, name) for name in BOUNDED_KEYS})

    @property
    def known_orientation(self) -> bool:
        """Whether pixels can be mapped to the robot's floor, which needs the tilt (an unknown pan or roll is 0)."""
        return self.tilt_rad is not None

    def with_orientation(self, pan_rad: float | None, tilt_rad: float | None, roll_rad: float | None) -> PinholeCamera:
        """Return this camera with another orientation; None if unknown."""
        return self._with_mounting({"pan_rad": pan_rad, "tilt_rad": tilt_rad, "roll_rad": roll_rad})

    def held(self, mounting: Mounting) -> PinholeCamera:
        """Return this camera with the mounting of a frame."""
        return self._with_mounting(mounting.known)

    def held_as(self, other: PinholeCamera) -> PinholeCamera:
        """Return this camera with another one's pan, tilt, roll and height, and their standard deviations."""
        return self._with_mounting({name: getattr(other, name) for name in MOUNTING_NAMES})

    def is_held_as(self, other: PinholeCamera) -> bool:
        """Whether another camera has the same tilt, roll and height with the same standard deviations."""
        return all(getattr(self, name) == getattr(other, name) for name in _MOUNTING_BUT_PAN)

    def _with_mounting(self, values: Mapping[str, float | None]) -> PinholeCamera:
        # called at least once in every frame, so without checks; the cached tables of the lens are kept
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        vars(other).update(values)
        vars(other).pop("camera_to_robot", None)
        return other

    def as_fitted(
        self, tilt_rad: float, roll_rad: float, height_m: float, focal_px: tuple[float, float]
    ) -> PinholeCamera:
        """Return this camera with fitted orientation, height and focal length (positive); an unknown pan is 0."""
        other = self.with_orientation(self.pan_rad or 0.0, tilt_rad, roll_rad)
        vars(other).update(focal_px=focal_px, height_m=height_m)
        return other

    def in_size(self, size_px: tuple[int, int]) -> PinholeCamera:
        """Return the camera for the same pictures in another width and height."""
        if size_px == self.size_px:
            return self
        across, down = self.size_px[0] / size_px[0], self.size_px[1] / size_px[1]
        return replace(
            self,
            size_px=size_px,
            focal_px=(self.focal_px[0] / across, self.focal_px[1] / down),
            center_px=((self.center_px[0] + 0.5) / across - 0.5, (self.center_px[1] + 0.5) / down - 0.5),
            focal_std_px=self.focal_std_px / across,
        )

    @property
    def sway_std_rad(self) -> tuple[float, float]:
        """Standard deviations of tilt and roll about those at rest; of a walking robot where the file has none."""
        roll = SWAY_STD_RAD if self.roll_std_rad is None else self.roll_std_rad
        return roll if self.tilt_std_rad is None else self.tilt_std_rad, roll

    @property
    def camera_in_robot(self) -> Pose2:
        """The camera's foot on the floor and the heading of its axis, robot frame; an unknown pan is 0."""
        return Pose2(*self.offset_m, self.pan_rad or 0.0)

    @property
    def mount(self) -> FloatArray:
        """(3, 3) float64: rotation of directions from the camera frame into that of its mounting, which tilts."""
        return _LOOKS_AHEAD

    @cached_property
    def camera_to_robot(self) -> FloatArray:
        """(3, 3) float64: rotation of directions from the camera frame into the robot frame.

        An unknown pan or roll is 0.

        Raises
        ------
        ArgumentError
            If the tilt is unknown.
        """
        if self.tilt_rad is None:
            raise ArgumentError("the camera's tilt_rad is unknown, so its pixels have no place on the robot's floor")
        return read_only(camera_rotation(self.pan_rad or 0.0, self.tilt_rad, self.roll_rad or 0.0) @ self.mount)

    @property
    def viewpoint_m(self) -> FloatArray:
        """(3,) float64: centre of projection in the robot frame, metres."""
        return read_only([*self.offset_m, self.height_m])

    def pixel_to_camera_ray(self, pixels: npt.ArrayLike) -> FloatArray:
        """Return unit directions (..., 3) in the camera frame of pixels (..., 2); NaN outside the lens."""
        slopes = self.ideal_slopes(pixels)
        ray = np.empty((*slopes.shape[:-1], 3))
        ray[..., 0] = 1.0 / np.sqrt(1.0 + slopes[..., 0] ** 2 + slopes[..., 1] ** 2)
        ray[..., 1:] = -slopes * ray[..., :1]
        return ray

    @property
    def is_bent(self) -> bool:
        """Whether the lens has a distortion."""
        return any(self.distortion)

    @property
    def without_lens(self) -> PinholeCamera:
        """The camera without distortion, with the same focal length, centre and mounting."""
        return replace(self, distortion=()) if self.is_bent else self

    def ideal_slopes(self, pixels: npt.ArrayLike) -> FloatArray:
        """Slopes right and down (tangents) of rays at pixels (..., 2); NaN for rays that do not point ahead."""
        slopes = (np.asarray(pixels, dtype=np.float64) - self.center_px) / self.focal_px
        return self._undistort(slopes) if self.is_bent else slopes

    def ideal_pixels(self, pixels: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) mapped into `without_lens`; NaN outside the lens or not ahead."""
        points = np.asarray(pixels, dtype=np.float64)
        return np.asarray(self.ideal_slopes(points) * self.focal_px + self.center_px) if self.is_bent else points

    def pixel_slopes(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Return slopes right and down at a few pixels, as plain floats for speed."""
        if self.is_bent:
            return [(right, down) for right, down in self.ideal_slopes(pixels).tolist()]
        (center_u, center_v), (focal_u, focal_v) = self.center_px, self.focal_px
        return [((u - center_u) / focal_u, (v - center_v) / focal_v) for u, v in pixels]

    def camera_ray_to_pixel(self, rays: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of directions (..., 3) in the camera frame; NaN behind the camera or outside the lens."""
        ray = np.asarray(rays, dtype=np.float64)
        ahead = ray[..., :1] > 0
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            slopes = np.where(ahead, -ray[..., 1:] / np.where(ahead, ray[..., :1], 1.0), np.nan)
            if self.is_bent:
                slopes = self._distort(slopes)
        return np.asarray(slopes * self.focal_px + self.center_px)

    def pixel_to_ray(self, pixels: npt.ArrayLike) -> FloatArray:
        """Return unit directions (..., 3) in the robot frame of pixels (..., 2); NaN outside the lens."""
        return self.pixel_to_camera_ray(pixels) @ self.camera_to_robot.T

    def ray_to_pixel(self, directions: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of directions (..., 3) in the robot frame; NaN behind the camera or outside the lens."""
        return self.camera_ray_to_pixel(np.asarray(directions, dtype=np.float64) @ self.camera_to_robot)

    def pixel_to_floor(self, pixels: npt.ArrayLike) -> FloatArray:
        """Floor points (..., 2), robot frame, metres, at pixels (..., 2); NaN on and above the horizon."""
        slopes = self.ideal_slopes(pixels)
        right, down, turn = slopes[..., 0], slopes[..., 1], self.camera_to_robot
        rise = turn[2, 0] - turn[2, 1] * right - turn[2, 2] * down
        with np.errstate(divide="ignore", invalid="ignore"):
            depth_m = np.where(rise < -1e-9, -self.height_m / rise, np.nan)
        floor = np.empty(slopes.shape)
        for axis, offset_m in enumerate(self.offset_m):
            floor[..., axis] = offset_m + (turn[axis, 0] - turn[axis, 1] * right - turn[axis, 2] * down) * depth_m
        return floor

    def point_to_pixel(self, points_m: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of points (..., 3) in the robot frame, metres."""
        return self.ray_to_pixel(np.asarray(points_m, dtype=np.float64) - self.viewpoint_m)

    def floor_to_pixel(self, points_m: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of floor points (..., 2) in the robot frame, metres."""
        points = np.asarray(points_m, dtype=np.float64)
        return self.point_to_pixel(np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1))

    @property
    def coefficients(self) -> tuple[float, ...]:
        """All eight coefficients of `distortion`."""
        return (*self.distortion, *(0.0,) * (8 - len(self.distortion)))

    @property
    def tangential(self) -> tuple[float, float]:
        """OpenCV's p1 and p2."""
        _, _, p1, p2, *_ = self.coefficients
        return p1, p2

    def image_radius(self, angle_rad: FloatArray) -> FloatArray:
        """Radial distance (...) from the centre, in focal lengths, of rays at angles (...) off the axis."""
        slope = np.tan(angle_rad)
        return np.asarray(slope * self._radial(slope**2)[0])

    def angle_of_radius(self, radius: FloatArray) -> FloatArray:
        """Invert `image_radius`, within the lens."""
        slope, distorted = self._radial_table
        angle = np.arctan(np.interp(radius, distorted, slope))
        for _ in range(4):
            step = (self.image_radius(angle + _ANGLE_STEP_RAD) - self.image_radius(angle)) / _ANGLE_STEP_RAD
            angle = angle + (radius - self.image_radius(angle)) / step
        return np.asarray(angle)

    def _radial(self, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the radial factor and its derivative by the squared slope."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        top = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        bottom = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        top_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
        bottom_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6)
        return top / bottom, (top_slope - top / bottom * bottom_slope) / bottom

    @cached_property
    def _radial_table(self) -> tuple[FloatArray, FloatArray]:
        """Undistorted and distorted slopes, up to the first fold of the lens model."""
        slope = np.linspace(0.0, _WIDEST_SLOPE, 4097)
        factor, derivative = self._radial(slope**2)
        grows = (factor + 2.0 * slope**2 * derivative > 0) & (factor > 0)
        end = len(slope) if grows.all() else max(int(np.argmin(grows)), 2)
        return slope[:end], (slope * factor)[:end]

    @property
    def widest_slope(self) -> float:
        """Tangent of the greatest angle off the optical axis of a lens with distortion."""
        return float(self._radial_table[0][-1])

    def _distort(self, slopes: FloatArray) -> FloatArray:
        p1, p2 = self.tangential
        x, y = slopes[..., 0], slopes[..., 1]
        r2 = x * x + y * y
        # beyond the fold the polynomial would map rays into the image that the lens does not show
        factor = np.where(r2 <= self.widest_slope**2, self._radial(r2)[0], np.nan)
        cross = 2.0 * x * y
        return np.stack(
            [x * factor + p1 * cross + p2 * (r2 + 2 * x * x), y * factor + p1 * (r2 + 2 * y * y) + p2 * cross], axis=-1
        )

    def _undistort(self, distorted: FloatArray) -> FloatArray:
        """Invert `_distort` by Newton's method, from the tabulated inverse of the radial part."""
        p1, p2 = self.tangential
        undistorted_table, distorted_table = self._radial_table
        length = np.hypot(distorted[..., 0], distorted[..., 1])
        inverse = np.interp(length, distorted_table, undistorted_table)
        slopes = distorted * np.where(length > 0, inverse / np.where(length > 0, length, 1.0), 1.0)[..., None]
        for _ in range(8):
            missing = distorted - self._distort(slopes)
            x, y = slopes[..., 0], slopes[..., 1]
            factor, derivative = self._radial(x * x + y * y)
            a = factor + 2 * x * x * derivative + 2 * p1 * y + 6 * p2 * x
            b = 2 * x * y * derivative + 2 * p1 * x + 2 * p2 * y
            d = factor + 2 * y * y * derivative + 6 * p1 * y + 2 * p2 * x
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.stack(
                    [d * missing[..., 0] - b * missing[..., 1], a * missing[..., 1] - b * missing[..., 0]], axis=-1
                )
                slopes = slopes + step / (a * d - b * b)[..., None]
            if not np.nanmax(np.abs(missing), initial=0.0) > _DISTORTED_STEP:
                break
        reached = np.abs(distorted - self._distort(slopes)).max(axis=-1) < 1e-7
        return np.where(reached[..., None], slopes, np.nan)
