"""Projection of balls in a picture to the floor, with covariance, and the samples that a ball covers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.balls.ball import Ball, Sighting
from robocup_vision.perception.balls.sizes import BallSizes
from robocup_vision.perception.color_table import ColorTable
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView

# half sizes from a ball within which its shadow lies, and above its middle within which it hides the floor
_SHADOW_RATIO, _BEHIND_RATIO = 1.5, 1.15
# greatest height of a mirror's viewpoint, in radii of the ball, by the rules (0.225 m in the small-size league of 2001,
# 10.5 radii; 0.8 m in the middle-size league, 7.3)
_MAX_HEIGHT_RADII = 11.0
# height and its relative standard deviation if neither file nor curve gives a possible one: four mirrors of known
# height have 5.5 to 7, an old one 9.5
_USUAL_HEIGHT_RADII, _USUAL_HEIGHT_STD = 6.3, 0.15
# distance of the rays' origin below a forward camera's picture, so large that they are nearly parallel
_FAR_BELOW_PX = 20_000
# greatest upward component of a ray that meets the floor in view
_LEVEL = -1e-3


class BallProjection(ABC):
    """A camera's view of balls on the floor.

    Parameters
    ----------
    sizes : BallSizes
        Sizes of balls in the picture.
    """

    #: positions, from white to the ball's colour, at which the ball's colour begins; all are tested
    white_ratios: tuple[float, ...]

    def __init__(self, sizes: BallSizes) -> None:
        self.sizes = sizes

    def place(self, u: float, v: float, std_px: float, log_likelihood_ratio: float) -> Ball | None:
        """Place a ball on the floor; None if the ray of its centre does not meet it.

        Parameters
        ----------
        u, v, std_px : float
            Its centre in the picture, and the standard deviation of that.
        """
        places = self._on_plane(((u, v), (u + 0.5, v), (u - 0.5, v), (u, v + 0.5), (u, v - 0.5)))
        if not all(math.isfinite(x) for x, _ in places):
            return None
        (x, y), (x_right, y_right), (x_left, y_left), (x_down, y_down), (x_up, y_up) = places
        # plain floats, because products of such small arrays are slow
        moves = [(std_px, x_right - x_left, y_right - y_left), (std_px, x_down - x_up, y_down - y_up)]
        xx = xy = yy = 0.0
        for std, dx, dy in moves + self._camera_moves(x, y):
            dx, dy = std * dx, std * dy
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        covariance = np.array(((xx, xy), (xy, yy)))
        covariance.setflags(write=False)
        return Ball(x, y, covariance, u, v, log_likelihood_ratio)

    def clear(self, ball: Ball, view: PolarView | FloorView, marks: UInt8Array) -> None:
        """Mark the blocked samples of a ball and its shadow as BALL, in place, because the robot drives to it."""
        bearing, radius = view.from_pixel((ball.u_px, ball.v_px))
        along, across = self.sizes.at(ball.u_px, ball.v_px)
        row = (bearing - float(view.bearing_rad[0])) / view.row_step_rad
        column = min(int(view.radius_px.searchsorted(radius)), len(view.radius_px) - 1)
        row_px = view.row_step_rad * float(view.range_m[column] / view.across_m_per_px[column])
        # a shadow is in front of the ball and beside it, but an obstacle may be behind; blur extends by a column
        near_px, far_px = ((ratio * along + view.step_px + 1.5) for ratio in (_SHADOW_RATIO, _BEHIND_RATIO))
        half_rows = (_SHADOW_RATIO * across + 1.5) / row_px + 1
        free_floor.clear_ball(row, radius, half_rows, near_px, far_px, view.is_ring, view.radius_px, marks)

    @abstractmethod
    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Return where the rays of pixels meet the plane of the ball's centre, robot frame; NaN if they do not."""

    @abstractmethod
    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, float, float]]:
        """Return the camera's errors: a standard deviation, and the derivative of the place (x, y) by it."""


class MirrorBallProjection(BallProjection):
    """Balls in a mirror camera's picture, in which rays lead from the mirror's axis outwards."""

    # half-way, because of pale objects beside the ball
    white_ratios = (0.5,)
    # so that a ball covers at least two seeds
    _SEED_PITCH = 1.0

    def __init__(self, camera: OmniCamera, radius_m: float) -> None:
        self.camera, self._radius_m = camera, radius_m
        # a curve that is fitted to a floor hardly determines the height, and may imply any
        implied = camera.floor_range.implied_height_m
        possible = implied is not None and implied <= _MAX_HEIGHT_RADII * radius_m
        known = camera.viewpoint_height_m or (implied if possible else None)
        self._height_m = _USUAL_HEIGHT_RADII * radius_m if known is None else known
        self._height_std = _USUAL_HEIGHT_STD if known is None else 0.0
        super().__init__(
            BallSizes(
                # sizes of a level mirror, the same all around
                replace(camera, tilt_rad=(0.0, 0.0), viewpoint_height_m=self._height_m),
                self._height_m,
                radius_m,
                camera.center_px,
                (1.0, 0.0),
                camera.usable_radius_px,
                beyond_px=0.0,
                height_std=self._height_std,
                sway_rad=0.0,
                seed_pitch=self._SEED_PITCH,
            )
        )
        inner, outer = camera.usable_radius_px
        radius, viewpoint_m = np.linspace(inner, outer, 4096), camera.viewpoint_m.tolist()
        fall = (camera.floor_range.inverse_range_per_m(radius) * viewpoint_m[2]).tolist()
        self._rays = inner, float(radius[1] - radius[0]), fall, camera.camera_to_robot.tolist(), viewpoint_m

    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, float, float]]:
        """See `BallProjection._camera_moves`: the error of an assumed height."""
        if not self._height_std:
            return []
        # the plane is a radius above the floor, which has more effect for a lower mirror
        ratio = 1.0 / (_USUAL_HEIGHT_RADII - 1.0)
        return [(self._height_std, ratio * x_m, ratio * y_m)]

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """See `BallProjection._on_plane`; in plain floats, which are faster for few points."""
        inner, step, fall, turn, (x0, y0, z0) = self._rays
        (center_u, center_v), heading_rad = self.camera.center_px, self.camera.heading_rad
        flip, last = 1.0 if self.camera.mirrored else -1.0, len(fall) - 1.001
        fallen = z0 - self._radius_m * (z0 / self._height_m)
        # unpacked, because a ball needs five points
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
    """Balls in a forward camera's picture, in which rays lead up, away from the nearer floor.

    Parameters
    ----------
    camera : PinholeCamera
        Must have a known tilt.
    sway_std_rad : (float, float), optional
        Standard deviations of its tilt and roll; by default those of its file, or of a body that sways.
    """

    # blur and compression leave a third of the colour of a far ball under a lamp
    white_ratios = (0.5, 0.2)
    # a quarter of a far ball under a lamp has its colour
    _SEED_PITCH = 0.5

    def __init__(self, camera: PinholeCamera, radius_m: float, sway_std_rad: tuple[float, float] | None = None) -> None:
        _, y, z = camera.camera_to_robot[2].tolist()
        length = math.hypot(y, z)
        # image u increases to the camera's right, v downwards; the camera's down is minus the robot's up
        down_u, down_v = (y / length, z / length) if length > 1e-6 else (0.0, 1.0)
        u, v = camera.center_px
        axis_u, axis_v = u + _FAR_BELOW_PX * down_u, v + _FAR_BELOW_PX * down_v
        # a lens with distortion may give any size beyond the picture's corners
        right, low = camera.size_px
        corners = [math.hypot(u - axis_u, v - axis_v) for u in (0, right - 1) for v in (0, low - 1)]
        self._radius_m, self._held = radius_m, camera
        file_std_rad = camera.sway_std_rad
        #: standard deviations of tilt and roll
        self.sway_std_rad = sway_std_rad or file_std_rad
        super().__init__(
            BallSizes(
                camera,
                camera.height_m,
                radius_m,
                (axis_u, axis_v),
                (-down_u, -down_v),
                (min(corners), max(corners)),
                beyond_px=math.hypot(right, low),
                height_std=0.0,
                sway_rad=file_std_rad[0],
                seed_pitch=self._SEED_PITCH,
            )
        )

    def held(self, camera: PinholeCamera, sway_std_rad: tuple[float, float] | None = None) -> PinholeBallProjection:
        """Return the same sizes with places by the camera as held in a frame."""
        other = copy(self)
        other._held = camera
        other.sway_std_rad = sway_std_rad or camera.sway_std_rad
        return other

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """See `BallProjection._on_plane`."""
        depth, (x0, y0) = self._held.height_m - self._radius_m, self._held.offset_m
        places = []
        for x, y, z in self._held.pixel_to_ray(pixels).tolist():
            scale = depth / -z if z < _LEVEL else math.nan
            places.append((x0 + scale * x, y0 + scale * y))
        return places

    def _camera_moves(self, x_m: float, y_m: float) -> list[tuple[float, float, float]]:
        """See `BallProjection._camera_moves`: errors of tilt, roll and height."""
        camera = self._held
        depth, pan = camera.height_m - self._radius_m, camera.pan_rad or 0.0
        c, s = math.cos(pan), math.sin(pan)
        x, y = x_m - camera.offset_m[0], y_m - camera.offset_m[1]
        ahead, aside = c * x + s * y, c * y - s * x
        level, down = math.cos(camera.tilt_rad or 0.0), math.sin(camera.tilt_rad or 0.0)
        # derivatives of the foot of a ray (ahead, aside, -depth) by a rotation about the horizontal axis across the
        # lens, and about the lens' own axis (level, 0, down); an error of the height scales the floor
        moves = (
            (depth + ahead * ahead / depth, ahead * aside / depth),
            (level * ahead * aside / depth - down * aside, level * (depth + aside * aside / depth) + down * ahead),
            (ahead / depth, aside / depth),
        )
        stds = *self.sway_std_rad, camera.height_std_m
        return [
            (std, c * along - s * across, s * along + c * across)
            for std, (along, across) in zip(stds, moves, strict=True)
        ]


def ball_projection(camera: OmniCamera | PinholeCamera, radius_m: float) -> BallProjection:
    """Return the projection of balls of a radius for a camera."""
    if isinstance(camera, OmniCamera):
        return MirrorBallProjection(camera, radius_m)
    return PinholeBallProjection(camera, radius_m)


class BallFrame(NamedTuple):
    """A frame to be searched for balls, with what is known of it."""

    frame: UInt8Array  #: (H, W, 3) uint8, BGR
    camera: OmniCamera | PinholeCamera  #: the camera as held in the frame; its tilt may be unknown
    projection: BallProjection | None = None  #: projection of balls; if None a finder makes it, if the tilt is known
    table: ColorTable | None = None  #: the colours; None if not learnt yet
    #: mean log-likelihood ratio of the floor near the robot
    near_floor_nats: float = 0.0
    t_s: float | None = None  #: time when it was taken


#: sightings, the most likely first, and the projection to place them by: the frame's, or one estimated from balls
Sightings = tuple[list[Sighting], BallProjection | None]
