"""The ball on the floor: a blob of its colour, of the size it must have there, with floor around it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import FloatArray, read_only
from robocup_vision.kernels import ball as kernel
from robocup_vision.kernels import free_floor
from robocup_vision.perception.color_table import ColorTable
from robocup_vision.perception.floor_color import PaintColor
from robocup_vision.perception.polar_view import PolarView

UInt8Array = npt.NDArray[np.uint8]

# share of floor before and beside it, less what has its own colour
_LEAST_SCORE = 0.5
# the ball's shaded side, sum of its channels, by the brightness of the lit floor
_LEAST_LEVEL = 0.6
# of the blob's centre, pixels
_CENTER_STD_PX = 0.3


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


class BallFinder:
    """Finds the ball in frames of one camera; holds scratch memory, so one object a thread.

    Parameters
    ----------
    field : Field
        Says how big the ball is and which colour it has; a white ball has none that could be told from lines.
    camera : OmniCamera
        The camera.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    """

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None = None) -> None:
        self.camera = camera
        self.radius_m = field.ball_radius_m
        self.has_color = field.ball_color not in ("white", "black")
        width, height = camera.size_px
        self._mask = np.empty((0, 0), dtype=np.uint8) if mask is None else np.ascontiguousarray(mask)
        self._stamps = np.zeros((height, width), dtype=np.int32)
        self._stack = np.empty(height * width, dtype=np.int32)
        self._stamp = 0

    @cached_property
    def _half_sizes_px(self) -> tuple[FloatArray, FloatArray]:
        """Half the ball's size along and across the ray, (R,) float64 each, by its centre's image radius."""
        camera = self.camera
        inner, outer = camera.usable_radius_px
        radius = np.arange(math.ceil(outer) + 2, dtype=np.float64)
        q = np.full(len(radius), np.nan)
        q[1:] = camera.floor_range.inverse_range_per_m(radius[1:])
        height = camera.height_m
        if height is None:
            # without a height its top cannot be told: as on the floor, and round
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
        usable = (radius >= inner) & (radius <= outer) & (q > 0) & np.isfinite(along)
        return np.where(usable, along, 0.0), np.where(usable, across, 0.0)

    @cached_property
    def _search(self) -> tuple[tuple[float, float], int]:
        inner, outer = self.camera.usable_radius_px
        across = self._half_sizes_px[1]
        # as far out as the ball still covers three pixels; a quincunx of that pitch cannot miss it
        wide = np.flatnonzero(across >= 1.0)
        reach = min(outer, float(wide[-1]) if len(wide) else inner)
        smallest = 2 * float(across[min(int(reach), len(across) - 1)])
        return (inner, reach), max(1, int(smallest / 1.6))

    def find(self, frame: UInt8Array, table: ColorTable) -> Ball | None:
        """Find the ball in a frame (H, W, 3) uint8, or say None."""
        if not self.has_color:
            return None
        colors = table.colors
        radii, stride = self._search
        self._stamp += 1
        from_floor = _between(colors.ball, colors.floor.lit)
        ball = np.array([colors.ball.blue_ratio, 1.0, colors.ball.red_ratio])
        out = np.empty(4)
        score = kernel.find_ball(
            frame,
            self._mask,
            self._stamps,
            self._stamp,
            self._stack,
            *self.camera.center_px,
            radii,
            stride,
            _between(colors.ball, colors.line),
            from_floor,
            _LEAST_LEVEL * colors.floor.level,
            _LEAST_LEVEL * colors.floor.level * float(from_floor @ ball / ball.sum()),
            *self._half_sizes_px,
            table.packing,
            table.floor_llr,
            out,
        )
        return self._place(out[:2]) if score >= _LEAST_SCORE else None

    def clear(self, ball: Ball, view: PolarView, marks: UInt8Array) -> None:
        """Let the ball and its shadow block nothing: it is what one drives to. Changes `marks` (K, M) in place."""
        u, v = ball.u_px - self.camera.center_px[0], ball.v_px - self.camera.center_px[1]
        radius = math.hypot(u, v)
        along, across = (float(sizes[round(radius)]) for sizes in self._half_sizes_px)
        bearing = math.atan2(v if self.camera.mirrored else -v, u) + self.camera.heading_rad
        row = bearing / math.tau * view.bearings
        # the shadow reaches about half a radius beyond the ball, the samples' blur a column
        half_px = 1.5 * along + view.step_px + 1.5
        half_rows = (1.5 * across + 1.5) / radius / math.tau * view.bearings + 1
        free_floor.clear_ball(row, radius, half_rows, half_px, view.radius_px, marks)

    def _place(self, pixel: FloatArray) -> Ball:
        scale = 1.0 if self.camera.height_m is None else 1.0 - self.radius_m / self.camera.height_m
        offset = np.array(self.camera.offset_m)
        # the ray meets the plane at the height of the ball's centre on the way to the floor
        steps = np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
        places = offset + scale * (self.camera.pixel_to_floor(pixel + steps) - offset)
        jacobian = np.stack([places[1] - places[2], places[3] - places[4]], axis=1)
        covariance = _CENTER_STD_PX**2 * jacobian @ jacobian.T
        return Ball(float(places[0, 0]), float(places[0, 1]), read_only(covariance), float(pixel[0]), float(pixel[1]))


def _between(color: PaintColor, other: PaintColor) -> FloatArray:
    """Return the normal (3,) of the plane through black half-way between two colours: positive on the first's side."""
    first = np.array([color.blue_ratio, 1.0, color.red_ratio])
    second = np.array([other.blue_ratio, 1.0, other.red_ratio])
    return np.asarray(first / np.linalg.norm(first) - second / np.linalg.norm(second))
