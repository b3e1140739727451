"""Balls in a pinhole camera's frame: the mirror camera's search, along the picture's own up and down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.balls.blobs import ACROSS, ALONG, U, V
from robocup_vision.kernels.balls.upright import count_upright
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.balls.ball import Ball, BallSettings
from robocup_vision.perception.balls.search import BallSearch, SearchMemory
from robocup_vision.perception.floor_view import FloorView

# a ball's shadow lies within this many half sizes of it, and what hides behind it within this many above its middle
_SHADOW_RATIO, _BEHIND_RATIO = 1.5, 1.15
# from this far below the picture, rays up it are nearly parallel, and circles are rows
_FAR_BELOW_PX = 20_000


class PinholeBallFinder(BallSearch):
    """Finds balls in frames of one pinhole camera; holds scratch memory, so one object a thread.

    Parameters
    ----------
    field : Field
        Gives the ball's size and colour; a white ball cannot be distinguished from lines.
    camera : PinholeCamera
        With a known tilt.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    memory : SearchMemory, optional
        Of the camera's frames, where finders for other orientations look at them, too.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        mask: UInt8Array | None = None,
        settings: BallSettings = BallSettings(),
        memory: SearchMemory | None = None,
    ) -> None:
        super().__init__(field, camera, mask, settings, memory)
        self.camera = camera
        self._held, self._sway_std_rad = camera, self._any_sway_rad

    @property
    def _any_sway_rad(self) -> tuple[float, float]:
        return self.camera.sway_std_rad(self.settings.sway_std_rad)

    def hold(self, camera: PinholeCamera, sway_std_rad: tuple[float, float] | None = None) -> None:
        """Place the balls of the frames to come by the camera as it is held then.

        Parameters
        ----------
        camera : PinholeCamera
            The finder's camera in another orientation.
        sway_std_rad : (float, float), optional
            Standard deviations of its tilt and roll; without them those of a body that sways.
        """
        self._held, self._sway_std_rad = camera, sway_std_rad or self._any_sway_rad

    @cached_property
    def _down(self) -> tuple[float, float]:
        """Unit direction in the picture in which the floor comes nearer."""
        _, y, z = (float(v) for v in self.camera.camera_to_robot[2])
        length = math.hypot(y, z)
        # image u grows to the camera's right, v downwards; its own down is minus the robot's up
        return (y / length, z / length) if length > 1e-6 else (0.0, 1.0)

    @cached_property
    def _axis_px(self) -> tuple[float, float]:
        (u, v), (down_u, down_v) = self.camera.center_px, self._down
        return u + _FAR_BELOW_PX * down_u, v + _FAR_BELOW_PX * down_v

    @property
    def _white_ratios(self) -> tuple[float, ...]:
        return self.settings.pinhole_white_ratios

    @property
    def _shape_std(self) -> float:
        return self.settings.pinhole_shape_std

    @property
    def _sway_px(self) -> float:
        return self._any_sway_rad[0] * self.camera.focal_px[1]

    @cached_property
    def _reach_px(self) -> int:
        return math.ceil(math.hypot(*self.camera.size_px))

    @cached_property
    def _sizes_px(self) -> tuple[FloatArray, FloatArray]:
        place = np.arange(_FAR_BELOW_PX + self._reach_px + 2, dtype=np.float64)
        along, across = np.zeros(len(place)), np.zeros(len(place))
        near = np.abs(place - _FAR_BELOW_PX) <= self._reach_px
        pixels = np.array(self._axis_px) - place[near, None] * np.array(self._down)
        ray = self.camera.pixel_to_ray(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (self.camera.height_m - self.radius_m) / np.where(ray[:, 2] < -1e-6, -ray[:, 2], np.nan)
            half = np.arcsin(np.where(distance > self.radius_m, self.radius_m / distance, np.nan))
        bearing = np.arctan2(ray[:, 1], ray[:, 0])
        elevation = np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1]))

        def shown(bearing_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
            level = np.cos(elevation_rad)
            directions = [level * np.cos(bearing_rad), level * np.sin(bearing_rad), np.sin(elevation_rad)]
            return self.camera.ray_to_pixel(np.stack(directions, axis=1))

        heights = np.hypot(*(shown(bearing, elevation + half) - shown(bearing, elevation - half)).T) / 2
        aside = half / np.maximum(np.cos(elevation), 1e-6)
        widths = np.hypot(*(shown(bearing + aside, elevation) - shown(bearing - aside, elevation)).T) / 2
        known = np.isfinite(heights) & np.isfinite(widths)
        along[near], across[near] = np.where(known, heights, 0.0), np.where(known, widths, 0.0)
        return along, across

    @property
    def _seed_rows(self) -> list[FloatArray]:
        along, across = self._sizes_px
        down_u, down_v = self._down
        rows: list[FloatArray] = []
        # from the picture's rim on, which cuts balls; beyond it a lens with distortion may show any size
        (right, low), (axis_u, axis_v) = self.camera.size_px, self._axis_px
        corners = [math.hypot(u - axis_u, v - axis_v) for u in (0, right - 1) for v in (0, low - 1)]
        place, last = min(corners) + 2.0, max(corners)
        settings, pitch = self.settings, self.settings.pinhole_seed_pitch
        while place <= last:
            half_px = across[round(place)]
            if half_px < settings.min_half_px:
                place += 1.0
                continue
            aside = np.arange(-self._reach_px, self._reach_px, pitch * half_px) + (len(rows) % 2) * pitch * half_px / 2
            middle = np.array(self._axis_px) - place * np.array([down_u, down_v])
            rows.append(middle + aside[:, None] * np.array([down_v, -down_u]))
            place += max(pitch * along[round(place)], 1.0)
        return rows

    def _on_plane(self, pixels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """See `BallSearch._on_plane`."""
        depth, (x0, y0) = self._held.height_m - self.radius_m, self._held.offset_m
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._held.camera_to_robot.tolist()
        places = []
        for right, down in self._held.pixel_slopes(pixels):
            scale = depth / max(zy * right + zz * down - zx, 1e-9)
            places.append((x0 + scale * (xx - xy * right - xz * down), y0 + scale * (yx - yy * right - yz * down)))
        return places

    def _place_covariance(self, x_m: float, y_m: float) -> FloatArray:
        """See `BallSearch._place_covariance`: what tilt, roll and height of the camera leave open."""
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
        xx = xy = yy = 0.0
        for std, (along, across) in zip((*self._sway_std_rad, camera.height_std_m), moves, strict=True):
            x, y = std * (c * along - s * across), std * (s * along + c * across)
            xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
        return np.array(((xx, xy), (xy, yy)))

    def _upright_evidence(self, frame: UInt8Array, blob: list[float]) -> float:
        """See `BallSearch._upright_evidence`: a band of a beacon or post has the next band above, and below.

        Such a band is as wide as the blob, of one colour, and another than what lies to both sides. A ball has floor at
        its foot; a line that runs towards it is narrower, one across it goes on to both sides.
        """
        settings, middle, (down_u, down_v) = self.settings, (blob[U], blob[V]), self._down
        # glare and shade leave a part of a ball its colour: what goes on must go on beyond the whole of it
        along, across = self._expected_px(*middle)
        halves = max(blob[ALONG], along), max(blob[ACROSS], across)
        step, spreads = settings.min_upright_step, settings.upright_spreads
        count = count_upright(frame, middle, halves, (-down_u, -down_v), self._floor_table, step, spreads)
        return int(count) * settings.upright_nats

    def clear(self, ball: Ball, view: FloorView, marks: UInt8Array) -> None:
        """Let the ball and its shadow block nothing: the robot drives to it. Changes `marks` (K, M) in place."""
        bearing, radius = view.from_pixel((ball.u_px, ball.v_px))
        along, across = self._expected_px(ball.u_px, ball.v_px)
        row = (bearing - float(view.bearing_rad[0])) / view.row_step_rad
        column = int(np.argmin(np.abs(view.radius_px - radius)))
        row_px = view.row_step_rad * float(view.range_m[column] / view.across_m_per_px[column])
        # a shadow lies before the ball and beside it; behind it may stand somebody
        near_px, far_px = ((ratio * along + view.step_px + 1.5) for ratio in (_SHADOW_RATIO, _BEHIND_RATIO))
        half_rows = (_SHADOW_RATIO * across + 1.5) / row_px + 1
        free_floor.clear_ball(row, radius, half_rows, near_px, far_px, view.is_ring, view.radius_px, marks)
