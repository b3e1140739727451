"""What a pinhole camera's lens makes of its image, computed once and cut into tiles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from sim2d.kernels.forward.values import ForwardLens

TILE_PX = (8, 32)  # rows and columns: most edges run across the image


def lens_table(camera: PinholeCamera, gain: npt.NDArray[np.float32]) -> ForwardLens:
    """Compute the slopes of a camera's pixels, and of its tiles.

    Parameters
    ----------
    camera : PinholeCamera
        Its orientation does not matter.
    gain : (H, W) float32
        Light that each pixel gets, relative.

    Raises
    ------
    ArgumentError
        If the lens leaves part of the image without rays.
    """
    width, height = camera.size_px
    tall, wide = TILE_PX
    rows, columns = -(-height // tall), -(-width // wide)
    # the pixels of a last tile that is not whole lie outside the image, where a lens need not show anything
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
    # what is interpolated between a tile's corners goes on beyond the image at the same rate
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
    """Slopes right and down (V, U) of pixels at columns u (U,) and rows v (V,)."""
    ray = camera.pixel_to_camera_ray(np.stack(np.meshgrid(u, v), axis=-1))
    if not np.isfinite(ray).all():
        raise ArgumentError("the camera's lens distortion leaves part of the image without rays")
    return -ray[..., 1] / ray[..., 0], -ray[..., 2] / ray[..., 0]
