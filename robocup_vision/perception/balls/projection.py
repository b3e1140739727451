"""How a ball on the floor shows in a camera's picture: where, how large, and how well that tells its place."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Ball

# a mirror's viewpoint is no higher than so many radii of the ball, the rules see to that (0.225 m in the small-size
# league of 2001, 10.5 radii; 0.8 m in the middle-size league, 7.3)
_MAX_HEIGHT_RADII = 11.0
# its height, and the relative standard deviation of it, where neither file nor curve gives a possible one: four mirrors
# of known height have 5.5 to 7, an old one 9.5
_USUAL_HEIGHT_RADII, _USUAL_HEIGHT_STD = 6.3, 0.15
# tilt and roll of a forward camera whose file does not say how they sway: robots nod when they start and stop
_SWAY_STD_RAD = math.radians(1.0)
# from this far below a forward camera's picture, rays up it are nearly parallel, and circles are rows
_FAR_BELOW_PX = 20_000
# a ray that falls by less for each metre meets no floor in view
_LEVEL = -1e-3


def ball_sizes_px(
    camera: OmniCamera | PinholeCamera, height_m: float, radius_m: float, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return half the height and half the width (...) of balls on the floor with their centres at pixels (..., 2).

    Both are 0 where none can lie.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        With a known tilt.
    height_m : float
        Of its viewpoint.
    """
    ray = camera.pixel_to_ray(pixels)
    bearing, level = np.arctan2(ray[..., 1], ray[..., 0]), np.hypot(ray[..., 0], ray[..., 1])
    elevation = np.arctan2(ray[..., 2], level)

    def shown(bearing_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
        away = np.cos(elevation_rad)
        parts = [away * np.cos(bearing_rad), away * np.sin(bearing_rad), np.sin(elevation_rad)]
        return camera.ray_to_pixel(np.stack(parts, axis=-1))

    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (height_m - radius_m) / np.where(ray[..., 2] < -1e-6, -ray[..., 2], np.nan)
        sine = np.where(distance > radius_m, radius_m / distance, np.nan)
        half, aside = np.arcsin(sine), np.arcsin(sine / level)
    ends = [np.linalg.norm(shown(bearing, elevation + turn) - pixels, axis=-1) for turn in (half, -half)]
    # where a lens or a mirror's table ends within the ball, the other end tells its height
    high, low = (np.where(np.isfinite(end), end, other) for end, other in zip(ends, ends[::-1], strict=True))
    heights = (high + low) / 2
    widths = np.linalg.norm(shown(bearing + aside, elevation) - shown(bearing - aside, elevation), axis=-1) / 2
    known = np.isfinite(heights) & np.isfinite(widths)
    return np.where(known, heights, 0.0), np.where(known, widths, 0.0)


class BallProjection(ABC):
    """A camera's view of balls on the floor, along rays of the picture that lead away from the robot.

    Parameters
    ----------
    size_px : (int, int)
        Width and height of the picture.
    axis_px : (float, float)
        Where, in the picture's plane, the rays start.
    ahead : (float, float)
        Unit vector of one of the rays, in the picture.
    span_px : (float, float)
        Distances from the axis between which the picture shows floor.
    beyond_px : float
        How much farther to both sides the centre of a ball may lie that the picture cuts.
    """

    def __init__(
        self,
        radius_m: float,
        size_px: tuple[int, int],
        axis_px: tuple[float, float],
        ahead: tuple[float, float],
        span_px: tuple[float, float],
        beyond_px: float = 0.0,
    ) -> None:
        self.radius_m, self.size_px, self._beyond_px = radius_m, size_px, beyond_px
        self.axis_px, self.ahead, self.span_px = axis_px, ahead, span_px

    #: relative standard deviation of the viewpoint's height, which sizes depend on
    height_std = 0.0

    @abstractmethod
    def _sizes_at(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `ball_sizes_px`."""

    @property
    def sway_px(self) -> float:
        """How far along its ray a ball may be from where it seems to be by its size: the camera's sway."""
        return 0.0

    @cached_property
    def sizes_px(self) -> tuple[FloatArray, FloatArray]:
        """Half the ball's size along and across the ray, (R,) float64 each, by its centre's distance from the axis."""
        nearest, farthest = self.span_px[0] - self._beyond_px, self.span_px[1] + self._beyond_px
        place = np.arange(math.ceil(nearest), math.floor(farthest) + 1)
        along, across = np.zeros((2, math.ceil(farthest) + 2))
        sizes = self._sizes_at(np.array(self.axis_px) + place[:, None] * self.ahead)
        along[place], across[place] = sizes
        return along, across

    def size_px_at(self, u: float, v: float) -> tuple[float, float]:
        """Return half the size, along and across the ray, of a ball with its centre there."""
        (axis_u, axis_v), (along, across) = self.axis_px, self.sizes_px
        place = min(round(math.hypot(u - axis_u, v - axis_v)), len(along) - 1)
        return float(along[place]), float(across[place])

    def place(self, u: float, v: float, std_px: float, log_likelihood_ratio: float) -> Ball | None:
        """Place a ball on the floor; None where the ray of its centre does not meet it.

        Parameters
        ----------
        u, v, std_px : float
            Its centre in the picture, and the standard deviation of that.
        """
        (x, y), (x_right, y_right), (x_left, y_left), (x_down, y_down), (x_up, y_up) = self._on_plane(
            ((u, v), (u + 0.5, v), (u - 0.5, v), (u, v + 0.5), (u, v - 0.5))
        )
        if not math.isfinite(x):
            return None
        # in plain floats: products of arrays as small as these take longer than all the rest
        moves = [(x_right - x_left, y_right - y_left), (x_down - x_up, y_down - y_up)]
        xx = xy = yy = 0.0
        for std, (dx, dy) in [*((std_px, move) for move in moves), *self._camera_moves(x, y)]:
            dx, dy = std * dx, std * dy
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        covariance = np.array(((xx, xy), (xy, yy)))
        covariance.setflags(write=False)
        return Ball(x, y, covariance, u, v, log_likelihood_ratio)

    @abstractmethod
    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Where the rays of some pixels meet the plane of the ball's centre, robot frame; NaN where they do not."""

    @abstractmethod
    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, tuple[float, float]]]:
        """Return each of the camera's own errors, a standard deviation, and how far a unit of it moves a place."""


class MirrorBallProjection(BallProjection):
    """Balls in a mirror camera's picture: rays lead from the mirror's axis outwards, all around."""

    def __init__(self, camera: OmniCamera, radius_m: float) -> None:
        super().__init__(radius_m, camera.size_px, camera.center_px, (1.0, 0.0), camera.usable_radius_px)
        self.camera = camera
        # a curve fitted to a floor hardly says how high it is seen from, and may imply any height
        implied = camera.floor_range.implied_height_m
        possible = implied is not None and implied <= _MAX_HEIGHT_RADII * radius_m
        known = camera.viewpoint_height_m or (implied if possible else None)
        self.height_m = _USUAL_HEIGHT_RADII * radius_m if known is None else known
        self.height_std = _USUAL_HEIGHT_STD if known is None else 0.0

    def _sizes_at(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        # all around alike: as a level mirror shows them
        level = replace(self.camera, tilt_rad=(0.0, 0.0), viewpoint_height_m=self.height_m)
        return ball_sizes_px(level, self.height_m, self.radius_m, pixels)

    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, tuple[float, float]]]:
        """See `BallProjection._camera_moves`: what the height leaves open that is not known."""
        if not self.height_std:
            return []
        # the ray falls by a radius less than to the floor: the nearer, the lower the mirror
        ratio = 1.0 / (_USUAL_HEIGHT_RADII - 1.0)
        return [(self.height_std, (ratio * x_m, ratio * y_m))]

    @cached_property
    def _rays(self) -> tuple[float, float, list[float], list[list[float]], list[float]]:
        inner, outer = self.camera.usable_radius_px
        radius = np.linspace(inner, outer, 4096)
        fall = self.camera.floor_range.inverse_range_per_m(radius) * float(self.camera.viewpoint_m[2])
        turn = self.camera.camera_to_robot.tolist()
        return inner, float(radius[1] - radius[0]), fall.tolist(), turn, self.camera.viewpoint_m.tolist()

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """See `BallProjection._on_plane`; in plain floats, as points are few and a look is short."""
        inner, step, fall, turn, (x0, y0, z0) = self._rays
        (center_u, center_v), heading_rad = self.camera.center_px, self.camera.heading_rad
        flip, last = 1.0 if self.camera.mirrored else -1.0, len(fall) - 1.001
        fallen = z0 - self.radius_m * (z0 / self.height_m)
        # written out: a ball takes five of these
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
        places = []
        for u, v in pixels:
            du, dv = u - center_u, v - center_v
            place = max(0.0, min(last, (math.hypot(du, dv) - inner) / step))
            cell = int(place)
            down = fall[cell] + (place - cell) * (fall[cell + 1] - fall[cell])
            bearing = math.atan2(flip * dv, du) + heading_rad
            along, aside = math.cos(bearing), math.sin(bearing)
            scale = fallen / max(-(zx * along + zy * aside - zz * down), 1e-9)
            x, y = xx * along + xy * aside - xz * down, yx * along + yy * aside - yz * down
            places.append((x0 + scale * x, y0 + scale * y))
        return places


class PinholeBallProjection(BallProjection):
    """Balls in a forward camera's picture: rays lead up it, against the direction in which the floor comes nearer.

    Parameters
    ----------
    camera : PinholeCamera
        With a known tilt.
    sway_std_rad : (float, float), optional
        Standard deviations of its tilt and roll; without them those of its file, or of a body that sways.
    """

    def __init__(self, camera: PinholeCamera, radius_m: float, sway_std_rad: tuple[float, float] | None = None) -> None:
        _, y, z = camera.camera_to_robot[2].tolist()
        length = math.hypot(y, z)
        # image u grows to the camera's right, v downwards; its own down is minus the robot's up
        down_u, down_v = (y / length, z / length) if length > 1e-6 else (0.0, 1.0)
        u, v = camera.center_px
        axis_u, axis_v = u + _FAR_BELOW_PX * down_u, v + _FAR_BELOW_PX * down_v
        # beyond the picture's corners a lens with distortion may show any size
        right, low = camera.size_px
        corners = [math.hypot(u - axis_u, v - axis_v) for u in (0, right - 1) for v in (0, low - 1)]
        super().__init__(
            radius_m,
            camera.size_px,
            (axis_u, axis_v),
            (-down_u, -down_v),
            (min(corners), max(corners)),
            math.hypot(right, low),
        )
        self.camera, self._held = camera, camera
        self._sway_std_rad = sway_std_rad or camera.sway_std_rad(_SWAY_STD_RAD)

    def held(self, camera: PinholeCamera, sway_std_rad: tuple[float, float] | None = None) -> PinholeBallProjection:
        """Return the same sizes, with places by the camera as it is held in a frame."""
        other = copy(self)
        other._held = camera
        other._sway_std_rad = sway_std_rad or self.camera.sway_std_rad(_SWAY_STD_RAD)
        return other

    @property
    def sway_px(self) -> float:
        """See `BallProjection.sway_px`."""
        return self.camera.sway_std_rad(_SWAY_STD_RAD)[0] * self.camera.focal_px[1]

    def _sizes_at(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        return ball_sizes_px(self.camera, self.camera.height_m, self.radius_m, pixels)

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """See `BallProjection._on_plane`."""
        depth, (x0, y0) = self._held.height_m - self.radius_m, self._held.offset_m
        places = []
        for x, y, z in self._held.pixel_to_ray(pixels).tolist():
            scale = depth / -z if z < _LEVEL else math.nan
            places.append((x0 + scale * x, y0 + scale * y))
        return places

    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, tuple[float, float]]]:
        """See `BallProjection._camera_moves`: what tilt, roll and height leave open."""
        camera = self._held
        depth, pan = camera.height_m - self.radius_m, camera.pan_rad or 0.0
        c, s = math.cos(pan), math.sin(pan)
        x, y = x_m - camera.offset_m[0], y_m - camera.offset_m[1]
        ahead, aside = c * x + s * y, c * y - s * x
        level, down = math.cos(camera.tilt_rad or 0.0), math.sin(camera.tilt_rad or 0.0)
        # a ray (ahead, aside, -depth) that turns about the level axis across the lens, or about the lens's own axis
        # (level, 0, down), moves its foot so much a radian; the height stretches the floor
        moves = (
            (depth + ahead * ahead / depth, ahead * aside / depth),
            (level * ahead * aside / depth - down * aside, level * (depth + aside * aside / depth) + down * ahead),
            (ahead / depth, aside / depth),
        )
        turned = ((c * along - s * across, s * along + c * across) for along, across in moves)
        return list(zip((*self._sway_std_rad, camera.height_std_m), turned, strict=True))


def ball_projection(camera: OmniCamera | PinholeCamera, radius_m: float) -> BallProjection:
    """Return how balls of a radius show in a camera's picture."""
    if isinstance(camera, OmniCamera):
        return MirrorBallProjection(camera, radius_m)
    return PinholeBallProjection(camera, radius_m)
