"""Balls in a mirror camera's frame: rays from the mirror's axis outwards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.balls.ball import Ball, BallSettings
from robocup_vision.perception.balls.search import BallSearch
from robocup_vision.perception.polar_view import PolarView


class MirrorBallFinder(BallSearch):
    """Finds balls in frames of one mirror camera; holds scratch memory, so one object a thread.

    Parameters
    ----------
    field : Field
        Gives the ball's size and colour; a white ball cannot be distinguished from lines.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None = None,
        settings: BallSettings = BallSettings(),
    ) -> None:
        super().__init__(field, camera, mask, settings)
        self.camera = camera

    @property
    def _axis_px(self) -> tuple[float, float]:
        return self.camera.center_px

    @property
    def _white_ratios(self) -> tuple[float, ...]:
        return self.settings.mirror_white_ratios

    @property
    def _shape_std(self) -> float:
        if self._known_height_m is not None:
            return self.settings.mirror_shape_std
        # seen from lower, a ball is longer along the ray
        return math.hypot(self.settings.mirror_shape_std, self.settings.usual_height_std)

    @property
    def _body_px(self) -> float:
        return self.camera.usable_radius_px[0]

    @cached_property
    def _known_height_m(self) -> float | None:
        """Height of the mirror's viewpoint as the file says, or as its curve implies; None if no robot is so high.

        A curve fitted to a floor hardly says how high it is seen from, and may imply any height.
        """
        if self.camera.viewpoint_height_m is not None:
            return self.camera.viewpoint_height_m
        implied = self.camera.floor_range.implied_height_m
        return None if implied is None or implied > self.settings.max_height_radii * self.radius_m else implied

    @cached_property
    def _height_m(self) -> float:
        known = self._known_height_m
        return self.settings.usual_height_radii * self.radius_m if known is None else known

    def _place_covariance(self, x_m: float, y_m: float) -> FloatArray | None:
        """See `BallSearch._place_covariance`: what the height of a mirror leaves open that is not known."""
        if self._known_height_m is not None:
            return None
        # the ray falls by a radius less than to the floor: the nearer, the lower the mirror
        range_std = self.settings.usual_height_std / (self.settings.usual_height_radii - 1.0)
        return np.asarray(range_std**2 * np.outer((x_m, y_m), (x_m, y_m)))

    @cached_property
    def _sizes_px(self) -> tuple[FloatArray, FloatArray]:
        camera, height = self.camera, self._height_m
        inner, outer = camera.usable_radius_px
        radius = np.arange(math.ceil(outer) + 2, dtype=np.float64)
        q = np.full(len(radius), np.nan)
        q[1:] = camera.floor_range.inverse_range_per_m(radius[1:])
        depression = np.arctan(q * height)
        # at the horizon it is infinite
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (height - self.radius_m) / np.sin(depression)
            half = np.arcsin(np.where(self.radius_m < distance, self.radius_m / distance, np.nan))
        near = camera.floor_range.radius_px(np.tan(depression + half) / height)
        far = camera.floor_range.radius_px(np.tan(depression - half) / height)
        along = (far - near) / 2
        # a table ends where the near side of the first balls lies
        ends = ~np.isfinite(near) & (depression + half < math.pi / 2)
        along = np.where(ends, far - radius, along)
        across = radius * np.sin(half) / np.cos(depression)
        # a ball that reaches over the axis has no near side, and cannot lie there
        usable = (radius >= inner) & (radius <= outer) & (q > 0) & (along > 0)
        return np.where(usable, along, 0.0), np.where(usable, across, 0.0)

    @property
    def _seed_rows(self) -> list[FloatArray]:
        along, across = self._sizes_px
        inner, outer = self.camera.usable_radius_px
        min_px = self.settings.min_half * max(1.0, (outer - inner) / 86.0)
        rings: list[FloatArray] = []
        radius = inner + 1.0
        while radius < outer and across[round(radius)] >= min_px:
            pitch = self.settings.seed_pitch * across[round(radius)]
            angles = np.arange(0.0, math.tau, pitch / radius) + (len(rings) % 2) * pitch / radius / 2
            rings.append(self.camera.polar_to_pixel(angles, radius))
            radius += self.settings.seed_pitch * along[round(radius)]
        return rings

    def clear(self, ball: Ball, view: PolarView, marks: UInt8Array) -> None:
        """Let the ball and its shadow block nothing: the robot drives to it. Changes `marks` (K, M) in place."""
        u, v = ball.u_px - self.camera.center_px[0], ball.v_px - self.camera.center_px[1]
        radius = math.hypot(u, v)
        along, across = self._expected_px(ball.u_px, ball.v_px)
        bearing = math.atan2(v if self.camera.mirrored else -v, u) + self.camera.heading_rad
        row = bearing / math.tau * view.bearings
        # the shadow reaches about half a radius beyond the ball, the samples' blur a column
        half_px = 1.5 * along + view.step_px + 1.5
        half_rows = (1.5 * across + 1.5) / radius / math.tau * view.bearings + 1
        free_floor.clear_ball(row, radius, half_rows, half_px, half_px, view.is_ring, view.radius_px, marks)

    @cached_property
    def _rays(self) -> tuple[float, float, list[float], list[list[float]], list[float]]:
        inner, outer = self.camera.usable_radius_px
        radius = np.linspace(inner, outer, 4096)
        fall = self.camera.floor_range.inverse_range_per_m(radius) * float(self.camera.viewpoint_m[2])
        turn = self.camera.camera_to_robot.tolist()
        return inner, float(radius[1] - radius[0]), fall.tolist(), turn, self.camera.viewpoint_m.tolist()

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Where rays of pixels meet the plane of the ball's centre, robot frame; in plain floats, as points are few."""
        inner, step, fall, turn, (x0, y0, z0) = self._rays
        (center_u, center_v), heading_rad = self.camera.center_px, self.camera.heading_rad
        flip, last = 1.0 if self.camera.mirrored else -1.0, len(fall) - 1.001
        fallen = z0 - self.radius_m * (z0 / self._height_m)
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
