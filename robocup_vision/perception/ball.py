"""The ball on the floor: a blob of its colour, of the size it must have there, with floor around it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.floor import ball as kernel
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.color_table import Colors, ColorTable
from robocup_vision.perception.floor_color import PaintColor
from robocup_vision.perception.polar_view import PolarView

# a polar sample is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# points all over a disc of radius 1, and how often a ball that the picture cuts is moved until its part in it fits
_DISC = np.array([(x, y) for x in np.linspace(-1, 1, 33) for y in np.linspace(-1, 1, 33) if x * x + y * y <= 1])
_CUT_STEPS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """Where the ball is.

    Parameters
    ----------
    x_m, y_m : float
        Its centre in the robot frame, metres.
    covariance : (2, 2) float64
        Of its position, square metres.
    u_px, v_px : float
        Its centre in the frame.
    """

    x_m: float
    y_m: float
    covariance: FloatArray
    u_px: float
    v_px: float

    def turned(self, angle_rad: float) -> Ball:
        """Return the ball in a frame in which directions are larger by an angle."""
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        turn = np.array([[c, -s], [s, c]])
        x, y = (turn @ (self.x_m, self.y_m)).tolist()
        return replace(self, x_m=x, y_m=y, covariance=turn @ self.covariance @ turn.T)


@dataclass(frozen=True, slots=True)
class BallSettings:
    """What the search for a ball can be tuned by.

    Parameters
    ----------
    min_score : float
        Least ratio of floor before and beside the ball, less what has its own colour.
    min_level : float
        Brightness of the ball's shaded side, sum of its channels, as a ratio of the lit floor's.
    min_half : float
        Balls with a smaller half size, in units of 1/86 of the usable radius (the paper's pixels), are too far away.
    seed_pitch : float
        Distance between seeds, in half sizes of the ball: at 1 a ball covers at least two.
    min_signal : float
        Standard deviations by which a blob must differ from the floor.
    floor_stds : float
        Standard deviations by which floor seldom differs from itself: the ball's colour begins beyond.
    center_std_px : float
        Of the blob's centre.
    """

    min_score: float = 0.5
    min_level: float = 0.6
    min_half: float = 1.0
    seed_pitch: float = 1.0
    min_signal: float = 4.0
    floor_stds: float = 3.5
    center_std_px: float = 0.3


class BallSearch(ABC):
    """Search for the ball, the same for every camera: rows of seeds along rays, and the size it must have at each.

    Parameters
    ----------
    field, camera, mask, settings
        See `BallFinder`.
    """

    def __init__(
        self, field: Field, camera: OmniCamera | PinholeCamera, mask: UInt8Array | None, settings: BallSettings
    ) -> None:
        self._any_camera = camera
        self.settings = settings
        self.radius_m = field.ball_radius_m
        self.has_color = field.ball_color not in ("white", "black")
        width, height = camera.size_px
        self._mask = mask
        stamps = np.zeros((height, width), dtype=np.int32)
        if mask is not None:
            stamps[mask > 0] = kernel.NEVER
        self._scratch = kernel.Scratch(stamps, np.empty(height * width, dtype=np.int32))
        self._stamp = 0
        self._table: ColorTable | None = None
        self._color = kernel.BallColor(np.empty(3), np.empty(3), 0.0, 0.0, 0.0)
        self._floor_table = kernel.FloorTable(np.empty((3, 256), dtype=np.uint16), np.empty(0, dtype=np.int8))

    @property
    @abstractmethod
    def _axis_px(self) -> tuple[float, float]:
        """Where, in the picture's plane, rays from the robot outwards start."""

    @property
    def _body_px(self) -> float:
        """How near to there the picture shows the robot itself."""
        return 0.0

    @property
    @abstractmethod
    def _sizes_px(self) -> tuple[FloatArray, FloatArray]:
        """Half the ball's size along and across the ray, (R,) float64 each, by its centre's distance from there."""

    @cached_property
    def _size(self) -> kernel.BallSize:
        u, v = self._axis_px
        return kernel.BallSize(float(u), float(v), float(self._body_px), *self._sizes_px)

    @property
    @abstractmethod
    def _seed_rows(self) -> list[FloatArray]:
        """Pixels (N, 2) of each row of seeds."""

    @cached_property
    def _seeds(self) -> npt.NDArray[np.int32]:
        """Pixels (N, 2) int32, v and u, in rows so dense that a ball anywhere on the floor covers some of them."""
        rings = self._seed_rows
        width, height = self._any_camera.size_px
        pixels = np.rint(np.vstack(rings)).astype(np.int32) if rings else np.empty((0, 2), dtype=np.int32)
        inside = (pixels >= 1).all(axis=1) & (pixels[:, 0] < width - 1) & (pixels[:, 1] < height - 1)
        pixels = pixels[inside]
        if self._mask is not None:
            pixels = pixels[self._mask[pixels[:, 1], pixels[:, 0]] == 0]
        # in the order of memory
        return np.ascontiguousarray(np.unique(pixels[:, ::-1], axis=0))

    def find(self, frame: UInt8Array, table: ColorTable) -> Ball | None:
        """Find the ball in a frame (H, W, 3) uint8, or return None."""
        if not self.has_color:
            return None
        if self._table is not table:
            self._table = table
            self._color = _ball_color(table.colors, self.settings)
            self._floor_table = kernel.FloorTable(table.packing, table.floor_llr)
        out = np.empty(4)
        if self._stamp > kernel.NEVER // 2:
            self._scratch.stamps[self._scratch.stamps != kernel.NEVER] = 0
            self._stamp = 0
        score, self._stamp = kernel.find_ball(
            frame,
            self._seeds,
            self._scratch,
            self._stamp + 1,
            self._color,
            self._size,
            self._floor_table,
            out,
        )
        if score < self.settings.min_score:
            return None
        return self._place(*self._whole(out[:2])) if self._is_cut(out[0], out[1]) else self._place(out[:2])

    def _is_cut(self, u: float, v: float) -> bool:
        """Whether a ball with its centre there may reach beyond the picture; in plain floats, as it is once a frame."""
        axis_u, axis_v = self._axis_px
        along_px, across_px = self._sizes_px
        index = min(round(math.hypot(u - axis_u, v - axis_v)), len(along_px) - 1)
        reach = max(float(along_px[index]), float(across_px[index])) - 0.5
        width, height = self._any_camera.size_px
        return not (reach <= u <= width - 1 - reach and reach <= v <= height - 1 - reach)

    def _whole(self, blob_px: FloatArray) -> tuple[FloatArray, float]:
        """Centre (2,) of the whole ball whose part in the picture has this centre, and its visible ratio.

        Parameters
        ----------
        blob_px : (2,) float64
            Centre of what is shown.
        """
        axis, last = np.array(self._axis_px), np.array(self._any_camera.size_px) - 0.5
        along_px, across_px = self._sizes_px
        center, visible_ratio = blob_px.copy(), 1.0
        for _ in range(_CUT_STEPS):
            ray = center - axis
            radius = math.hypot(*ray)
            index = min(round(radius), len(along_px) - 1)
            along, across = float(along_px[index]), float(across_px[index])
            ray /= max(radius, 1e-9)
            points = center + _DISC @ np.array([along * ray, [-across * ray[1], across * ray[0]]])
            shown = points[((points >= -0.5) & (points <= last)).all(axis=1)]
            if not len(shown):
                break
            visible_ratio = len(shown) / len(points)
            center += blob_px - shown.mean(axis=0)
        return center, visible_ratio

    def _place(self, pixel: FloatArray, visible_ratio: float = 1.0) -> Ball:
        u, v = float(pixel[0]), float(pixel[1])
        x, y = self._on_plane(u, v)
        (x_right, y_right), (x_left, y_left) = self._on_plane(u + 0.5, v), self._on_plane(u - 0.5, v)
        (x_down, y_down), (x_up, y_up) = self._on_plane(u, v + 0.5), self._on_plane(u, v - 0.5)
        jacobian = np.array([[x_right - x_left, x_down - x_up], [y_right - y_left, y_down - y_up]])
        return Ball(x, y, read_only((self.settings.center_std_px / visible_ratio) ** 2 * jacobian @ jacobian.T), u, v)

    @abstractmethod
    def _on_plane(self, u: float, v: float) -> tuple[float, float]:
        """Where a pixel's ray meets the plane of the ball's centre, robot frame."""


class BallFinder(BallSearch):
    """Finds the ball in frames of one mirror camera; holds scratch memory, so one object a thread.

    Parameters
    ----------
    field : Field
        Gives the ball's size and colour; a white ball cannot be told from lines.
    camera : OmniCamera
        The camera.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    settings : BallSettings
        Thresholds of the search.
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
    def _body_px(self) -> float:
        return self.camera.usable_radius_px[0]

    @cached_property
    def _sizes_px(self) -> tuple[FloatArray, FloatArray]:
        camera = self.camera
        inner, outer = camera.usable_radius_px
        radius = np.arange(math.ceil(outer) + 2, dtype=np.float64)
        q = np.full(len(radius), np.nan)
        q[1:] = camera.floor_range.inverse_range_per_m(radius[1:])
        height = camera.height_m
        if height is None:
            # without a height its top is unknown: as on the floor, and round
            across = self.radius_m * q * radius
            along = across
        else:
            depression = np.arctan(q * height)
            distance = (height - self.radius_m) / np.sin(depression)
            with np.errstate(invalid="ignore"):
                half = np.arcsin(np.where(self.radius_m < distance, self.radius_m / distance, np.nan))
            near = camera.floor_range.radius_px(np.tan(depression + half) / height)
            far = camera.floor_range.radius_px(np.tan(depression - half) / height)
            along = (far - near) / 2
            across = radius * np.sin(half) / np.cos(depression)
        # a ball that reaches over the axis has no near side: it is none that could lie there
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
        along, across = (float(sizes[round(radius)]) for sizes in self._sizes_px)
        bearing = math.atan2(v if self.camera.mirrored else -v, u) + self.camera.heading_rad
        row = bearing / math.tau * view.bearings
        # the shadow reaches about half a radius beyond the ball, the samples' blur a column
        half_px = 1.5 * along + view.step_px + 1.5
        half_rows = (1.5 * across + 1.5) / radius / math.tau * view.bearings + 1
        free_floor.clear_ball(row, radius, half_rows, half_px, view.radius_px, marks)

    @cached_property
    def _rays(self) -> tuple[float, float, list[float], list[list[float]], list[float]]:
        inner, outer = self.camera.usable_radius_px
        radius = np.linspace(inner, outer, 4096)
        fall = self.camera.floor_range.inverse_range_per_m(radius) * float(self.camera.viewpoint_m[2])
        turn = self.camera.camera_to_robot.tolist()
        return inner, float(radius[1] - radius[0]), fall.tolist(), turn, self.camera.viewpoint_m.tolist()

    def _on_plane(self, u: float, v: float) -> tuple[float, float]:
        """Where a pixel's ray meets the plane of the ball's centre, robot frame; in plain floats, as points are few."""
        inner, step, fall, turn, (x0, y0, z0) = self._rays
        du, dv = u - self.camera.center_px[0], v - self.camera.center_px[1]
        place = max(0.0, min(len(fall) - 1.001, (math.hypot(du, dv) - inner) / step))
        cell = int(place)
        down = fall[cell] + (place - cell) * (fall[cell + 1] - fall[cell])
        bearing = math.atan2(dv if self.camera.mirrored else -dv, du) + self.camera.heading_rad
        ray = (math.cos(bearing), math.sin(bearing), -down)
        x, y, z = (row[0] * ray[0] + row[1] * ray[1] + row[2] * ray[2] for row in turn)
        # without a height the ball lies as flat as the floor
        fallen = z0 if self.camera.height_m is None else z0 - self.radius_m
        scale = fallen / max(-z, 1e-9)
        return x0 + scale * x, y0 + scale * y


def _ball_color(colors: Colors, settings: BallSettings) -> kernel.BallColor:
    """Planes that part the ball's colour from white and from the floor, and how bright and how clear it must be."""
    ball, floor, white = (_direction(color) for color in (colors.ball, colors.floor.lit, colors.line))
    raw_noise = _RAW_NOISE * colors.floor.noise
    # a small ball is mixed with floor all over: the plane lies as near to the floor's colour as its noise allows
    floor_counts = 4 * colors.floor.level / float(floor @ [1.0, 2.0, 1.0])
    apart = math.acos(min(1.0, float(ball @ floor)))
    ratio = min(0.5, max(1 / 3, settings.floor_stds * raw_noise / floor_counts / max(apart, 1e-3)))
    from_floor = _plane(ball, floor, ratio)
    min_level = settings.min_level * colors.floor.level
    on_dark_ball = min_level * float(from_floor @ ball / ball.sum())
    return kernel.BallColor(
        _plane(ball, white, 0.5), from_floor, min_level, on_dark_ball, settings.min_signal * raw_noise
    )


def _direction(color: PaintColor) -> FloatArray:
    """Return the unit vector (3,), B, G, R, of a colour."""
    vector = np.array([color.blue_ratio, 1.0, color.red_ratio])
    return np.asarray(vector / np.linalg.norm(vector))


def _plane(color: FloatArray, other: FloatArray, ratio: float) -> FloatArray:
    """Return the unit normal (3,) of a plane through black, at a ratio of the way from `other` to `color`."""
    within = other + ratio * (color - other)
    normal = color - float(color @ within) / float(within @ within) * within
    length = float(np.linalg.norm(normal))
    return np.asarray(normal / length) if length > 0 else normal
