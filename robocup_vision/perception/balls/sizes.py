"""Size of a ball on the floor in a camera's picture, and seeds of a search for balls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robocup_vision.arrays import FloatArray, Int32Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls.blobs import BallSize

# least half size of a ball in use: pixels, and in a small picture a ratio of the extent of its floor (one pixel in the
# pictures of Sekimori et al.)
_MIN_HALF_PX, _MIN_HALF_RATIO = 2.0, 1.0 / 86.0
# standard deviation of the logarithms of size and slenderness, due to shade and glare
_SHAPE_STD = 0.15
# standard deviation of a measured radius, relative
MEASURED_RADIUS_STD = 0.12
# bounds of a ball's radius in a row, standard deviations; rows between computed bounds
_SIGMAS, _ROWS = 3.0, 8


def ball_sizes_px(
    camera: OmniCamera | PinholeCamera, height_m: float, radius_m: float, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return half the height and half the width (...) of balls on the floor with centres at pixels (..., 2).

    Both are 0 where no ball can be.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        Must have a known tilt.
    height_m : float
        Height of its viewpoint.
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
    # where a lens or a mirror's table ends within the ball, the other end is used
    high, low = (np.where(np.isfinite(end), end, other) for end, other in zip(ends, ends[::-1], strict=True))
    heights = (high + low) / 2
    widths = np.linalg.norm(shown(bearing + aside, elevation) - shown(bearing - aside, elevation), axis=-1) / 2
    known = np.isfinite(heights) & np.isfinite(widths)
    return np.where(known, heights, 0.0), np.where(known, widths, 0.0)


@dataclass(frozen=True, eq=False)
class BallSizes:
    """Sizes of balls on the floor along rays of the picture that lead away from the robot."""

    camera: OmniCamera | PinholeCamera  #: camera with a known tilt
    height_m: float  #: height of its viewpoint
    radius_m: float  #: radius of the ball
    axis_px: tuple[float, float]  #: origin of the rays in the picture's plane
    ahead: tuple[float, float]  #: unit vector of one ray
    span_px: tuple[float, float]  #: distances from the axis between which the picture shows floor
    beyond_px: float  #: greatest distance outside that range of a ball's centre that the picture cuts
    height_std: float  #: relative standard deviation of the viewpoint's height
    sway_rad: float  #: standard deviation of the camera's tilt
    seed_pitch: float  #: distance between seeds, in half sizes of the ball

    @property
    def shape_std(self) -> float:
        """Standard deviation of the logarithms of size and slenderness: from a lower viewpoint a ball looks longer."""
        return math.hypot(_SHAPE_STD, self.height_std)

    @cached_property
    def along_across_px(self) -> tuple[FloatArray, FloatArray]:
        """Half the ball's size along and across the ray, (R,) float64 each, by its centre's distance from the axis."""
        nearest, farthest = self.span_px[0] - self.beyond_px, self.span_px[1] + self.beyond_px
        place = np.arange(math.ceil(nearest), math.floor(farthest) + 1)
        along, across = np.zeros((2, math.ceil(farthest) + 2))
        pixels = np.array(self.axis_px) + place[:, None] * self.ahead
        along[place], across[place] = ball_sizes_px(self.camera, self.height_m, self.radius_m, pixels)
        return along, across

    def at(self, u: float, v: float) -> tuple[float, float]:
        """Return half the size, along and across the ray, of a ball with this centre."""
        (axis_u, axis_v), (along, across) = self.axis_px, self.along_across_px
        place = min(round(math.hypot(u - axis_u, v - axis_v)), len(along) - 1)
        return float(along[place]), float(across[place])

    def are_cut(self, u: float, v: float) -> bool:
        """Whether a ball with this centre may extend beyond the picture."""
        reach = max(self.at(u, v)) - 0.5
        width, height = self.camera.size_px
        return not (reach <= u <= width - 1 - reach and reach <= v <= height - 1 - reach)

    @cached_property
    def row_radii_px(self) -> FloatArray:
        """(H, 2) float64: least and greatest measured radius of a ball with its centre in each row, forward cameras."""
        small, middle, large = self._swayed_radii_px()
        slack = _SIGMAS * MEASURED_RADIUS_STD * middle
        least = (middle - np.hypot(slack, middle - small)).min(axis=1)
        most = (middle + np.hypot(slack, large - middle)).max(axis=1)
        # bounds of the rows between are those of both neighbours
        bounds = np.stack([np.minimum(least[:-1], least[1:]), np.maximum(most[:-1], most[1:])], axis=1)
        return np.repeat(bounds, _ROWS, axis=0)[: self.camera.size_px[1]]

    def _swayed_radii_px(self) -> FloatArray:
        """Return radii (3, R, 3) at ends and middle of some rows, for a camera swayed up, held, and swayed down."""
        camera, slack_rad = self.camera, _SIGMAS * self.sway_rad
        assert isinstance(camera, PinholeCamera)
        width, height = camera.size_px
        rows = np.minimum(np.arange(0, height + _ROWS, _ROWS), height - 1)
        pixels = np.stack(np.meshgrid([0.0, (width - 1) / 2, width - 1.0], rows), axis=-1)
        held = [(camera.tilt_rad or 0.0) + off_rad for off_rad in (slack_rad, 0.0, -slack_rad)]
        tilted = (camera.with_orientation(camera.pan_rad, tilt_rad, camera.roll_rad) for tilt_rad in held)
        sizes = (ball_sizes_px(one, self.height_m, self.radius_m, pixels) for one in tilted)
        return np.array([np.sqrt(along * across) for along, across in sizes])

    @cached_property
    def table(self) -> BallSize:
        """The sizes in the format of the kernels."""
        along, across = self.along_across_px
        known = (along > 0) & (across > 0)
        size = np.log(np.where(known, along * across, 1.0)) / 2
        # no derivative along the ray at the ends of the range of known sizes
        change = np.abs(np.gradient(size)) * (known & np.roll(known, 1) & np.roll(known, -1))
        sway_px = self.sway_rad * self.camera.focal_px[1] if isinstance(self.camera, PinholeCamera) else 0.0
        # bounded, because any size is possible where the sway reaches the horizon
        log_std = np.hypot(self.shape_std, np.minimum(sway_px * change, 0.8))
        (axis_u, axis_v), body_px = self.axis_px, self.span_px[0]
        return plain(BallSize(float(axis_u), float(axis_v), float(body_px), along, across, log_std, self.shape_std))

    @cached_property
    def seeds(self) -> Int32Array:
        """Pixels (N, 2) int32, v and u, in rows so dense that a ball anywhere on the floor covers some."""
        (along, across), (width, height) = self.along_across_px, self.camera.size_px
        up_rad, reach_px = math.atan2(self.ahead[1], self.ahead[0]), math.hypot(width, height)
        min_half_px = min(_MIN_HALF_PX, _MIN_HALF_RATIO * (self.span_px[1] - self.span_px[0]))
        rows = [np.empty((0, 2))]
        place = self.span_px[0] + 1.0
        while place < self.span_px[1]:
            half_px = across[round(place)]
            if half_px < min_half_px:
                place += 1.0
                continue
            turn, step = min(reach_px / place, math.pi), self.seed_pitch * half_px / place
            turns = up_rad + np.arange(-turn, turn, step) + (len(rows) % 2) * step / 2
            rows.append(self.axis_px + place * np.stack([np.cos(turns), np.sin(turns)], axis=1))
            place += max(self.seed_pitch * along[round(place)], 1.0)
        pixels = np.rint(np.vstack(rows)).astype(np.int32)
        inside = (pixels >= 1).all(axis=1) & (pixels[:, 0] < width - 1) & (pixels[:, 1] < height - 1)
        # sorted by memory address
        return np.ascontiguousarray(np.unique(pixels[inside][:, ::-1], axis=0))
