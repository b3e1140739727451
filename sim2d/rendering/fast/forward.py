"""Fast frames of a forward camera: one ray for each pixel, and four at edges.

It draws walls, goals with nets, beacons, boxes, bystanders, robots, ball and lines under light with a constant gradient
in front of the room's wall or a backdrop, like `render_pinhole`, but without texture, shadows, highlights, glare and
patches of sun.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.compiling.prepared_kernels import prepare
from sim2d.kernels.forward.outlines import ARC_PIECES
from sim2d.kernels.forward.tiles import draw_forward
from sim2d.kernels.forward.values import ForwardEye, ForwardLens, Outlines
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.fast.match_frames import MatchFrames
from sim2d.rendering.scene import Ball, Robot, Scene
from sim2d.rendering.sensor import Sensor

TILE_PX = (8, 32)  # rows and columns; tiles are wide, because most edges are horizontal


class EyeInField(NamedTuple):
    """A camera's centre of projection and orientation, field frame."""

    #: Centre of projection.
    x_m: float
    y_m: float
    height_m: float
    #: Orientation at the middle row; see `camera_rotation`.
    heading_rad: float
    tilt_rad: float
    roll_rad: float
    #: Rotation about its own axes (ahead, left, up) from the first row to the last.
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


class ForwardFrames(MatchFrames):
    """Draws for a pinhole or fisheye camera, whose place and orientation are not used; see `MatchFrames`.

    Parameters
    ----------
    backdrop : Backdrop, optional
        Replaces the scene's clutter on the room's wall.

    Raises
    ------
    ArgumentError
        As `MatchFrames`, or if the lens leaves part of the image without rays.
    """

    camera: PinholeCamera

    def __init__(
        self, scene: Scene, camera: PinholeCamera, sensor: Sensor, *, backdrop: Backdrop | None = None
    ) -> None:
        super().__init__(scene, camera, sensor, backdrop)
        prepare("forward_frames", "sim2d")
        width, height = camera.size_px
        self._lens = lens_table(camera, self._gain)
        self._planes = np.zeros((3, height, width), dtype=np.uint8)
        self._outlines = _empty_outlines(0)

    def draw(self, robots: tuple[Robot, ...], ball: Ball | None, eye: EyeInField) -> UInt8Array:
        """Draw a frame (H, W, 3) uint8 BGR with other robots and the ball, without blur and noise of the sensor."""
        things = self._things(robots, ball)
        floor = len(self._paint.edges) + len(self._paint.lines) + len(self._paint.arcs) * ARC_PIECES
        count = floor + len(things.rows) + 1 + len(self._nets.rows)
        if count > len(self._outlines.owners):
            self._outlines = _empty_outlines(count)
        rotation = np.ascontiguousarray(camera_rotation(eye.heading_rad, eye.tilt_rad, eye.roll_rad), dtype=np.float64)
        at = ForwardEye(float(eye.x_m), float(eye.y_m), float(eye.height_m), rotation, np.array(eye.turn_rad))
        seen = self._lens, at, self._paint, things, self._nets, self._light, self._wall
        draw_forward(*seen, self._outlines, TILE_PX, self._planes)
        return np.asarray(cv2.merge(list(self._planes)), dtype=np.uint8)


def _empty_outlines(count: int) -> Outlines:
    return Outlines(np.zeros((count, 10), dtype=np.float32), np.zeros((count, 3), dtype=np.int32))


def lens_table(camera: PinholeCamera, gain: Float32Array) -> ForwardLens:
    """Compute the slopes of a camera's pixels, and of its tiles.

    Parameters
    ----------
    camera : PinholeCamera
        Its orientation is not used.
    gain : (H, W) float32
        Relative light of each pixel.

    Raises
    ------
    ArgumentError
        If the lens leaves part of the image without rays.
    """
    width, height = camera.size_px
    tall, wide = TILE_PX
    rows, columns = -(-height // tall), -(-width // wide)
    # pixels of incomplete tiles outside the image are clipped, because a lens may not show anything there
    u, v = np.minimum(np.arange(columns * wide), width - 1), np.minimum(np.arange(rows * tall), height - 1)
    right, down = _slopes(camera, u, v)
    of_pixels = np.stack([right, down]).reshape(2, rows, tall, columns, wide)
    slopes = of_pixels.transpose(1, 3, 0, 2, 4).reshape(rows, columns, 2, tall * wide)
    gains = gain[np.ix_(v, u)].reshape(rows, tall, columns, wide).transpose(0, 2, 1, 3)
    u, v = np.arange(columns + 1) * wide - 0.5, np.arange(rows + 1) * tall - 0.5
    corners = np.stack(_slopes(camera, np.minimum(u, width - 0.5), np.minimum(v, height - 0.5)), axis=-1)
    u_in, v_in = np.diff(np.minimum(u, width - 0.5)), np.diff(np.minimum(v, height - 0.5))
    by_u = np.diff(corners, axis=1)
    by_u = (by_u[:-1] + by_u[1:]) / 2 / u_in[:, None]
    by_v = np.diff(corners, axis=0)
    by_v = (by_v[:, :-1] + by_v[:, 1:]) / 2 / v_in[:, None, None]
    per_pixel = np.stack([by_u[..., 0], by_v[..., 0], by_u[..., 1], by_v[..., 1]], axis=-1)
    margin = np.abs(by_u) + np.abs(by_v)
    low, high = slopes.min(axis=3) - margin, slopes.max(axis=3) + margin
    u = np.arange(2 * columns + 1) * (wide / 2) - 0.5
    corners = np.stack(_slopes(camera, np.minimum(u, width - 0.5), np.minimum(v, height - 0.5)), axis=-1)
    # interpolation between a tile's corners is extrapolated beyond the image
    corners += np.maximum(u - width + 0.5, 0.0)[:, None] * by_u[-1, -1]
    corners += np.maximum(v - height + 0.5, 0.0)[:, None, None] * by_v[-1, -1]
    return ForwardLens(
        np.ascontiguousarray(slopes if camera.is_bent else slopes[:0, :0], dtype=np.float32),
        np.ascontiguousarray(gains.reshape(rows, columns, tall * wide), dtype=np.float32),
        np.ascontiguousarray(corners),
        per_pixel.astype(np.float32),
        np.stack([low[..., 0], high[..., 0], low[..., 1], high[..., 1]], axis=-1).astype(np.float32),
        np.stack([np.tile(np.arange(wide), tall), np.repeat(np.arange(tall), wide)]).astype(np.float32),
    )


def _slopes(
    camera: PinholeCamera, u: npt.NDArray[np.float64] | npt.NDArray[np.int64], v: npt.NDArray[np.float64]
) -> tuple[FloatArray, FloatArray]:
    """Return the slopes right and down (V, U) of pixels at columns u (U,) and rows v (V,)."""
    ray = camera.pixel_to_camera_ray(np.stack(np.meshgrid(u, v), axis=-1))
    if not np.isfinite(ray).all():
        raise ArgumentError("the camera's lens distortion leaves part of the image without rays")
    return -ray[..., 1] / ray[..., 0], -ray[..., 2] / ray[..., 0]
