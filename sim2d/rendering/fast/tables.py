"""What no frame changes, as the compiled loops take it: a field's paint, and what each pixel sees."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera, PinholeCamera
from sim2d.kernels.floor_lines import GAIN, X, Y
from sim2d.kernels.forward.values import ForwardLens
from sim2d.kernels.frame_values import Bearings, PixelRays
from sim2d.rendering.mirror import BODY_BGR
from sim2d.rendering.rays import MirrorRays


def line_rows(field: Field) -> FloatArray:
    """Lines (N, 5): start x, y, unit direction x, y, length."""
    return np.array([_line(*row) for row in field.painted_lines.tolist()], dtype=np.float64).reshape(-1, 5)


def arc_rows(field: Field) -> FloatArray:
    """Arcs (M, 6): centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle)."""
    return np.array([_arc(*row) for row in field.painted_arcs.tolist()], dtype=np.float64).reshape(-1, 6)


def _line(x0: float, y0: float, x1: float, y1: float) -> list[float]:
    length = math.hypot(x1 - x0, y1 - y0)
    return [x0, y0, (x1 - x0) / length, (y1 - y0) / length, length]


def _arc(x: float, y: float, radius: float, start: float, sweep: float) -> list[float]:
    middle = start + sweep / 2
    cosine = -2.0 if abs(sweep) > math.tau - 1e-9 else math.cos(sweep / 2)
    return [x, y, radius, math.cos(middle), math.sin(middle), cosine]


@dataclass(frozen=True, eq=False)
class PixelTable:
    """A camera's pixels as the compiled loops take them (`kernels.match_pixels`)."""

    #: Height of the viewpoint.
    height_m: float
    #: Rays of every pixel that shows the scene.
    rays: PixelRays
    #: Over a full turn.
    bearings: Bearings
    #: (3, H * W) float32: floor point and gain of every pixel in the order of the image; 0 where no ray goes.
    floor: npt.NDArray[np.float32]
    #: (3, H * W) uint8: the picture where no ray goes: the robot's own body, and black.
    body: npt.NDArray[np.uint8]


def mirror_pixels(camera: OmniCamera, gain: npt.NDArray[np.float32], farthest_m: float) -> PixelTable:
    """Compute a mirror camera's pixels.

    Parameters
    ----------
    camera : OmniCamera
        With a known viewpoint height.
    gain : (H, W) float32
        Light that each pixel gets, relative.
    farthest_m : float
        Floor points farther away are moved to this distance.
    """
    drawn = MirrorRays(camera, 1)
    per_turn = round(math.tau * camera.usable_radius_px[1])  # as many bearings as the rim has pixels
    pixel = drawn.pixel_index
    width = camera.size_px[0]
    low, high = _slope_range(camera, np.stack([pixel % width, pixel // width], axis=-1).astype(np.float64))
    place = np.rint(np.arctan2(drawn.sin, drawn.cos) * per_turn / math.tau).astype(np.int32) % per_turn
    along = np.minimum(drawn.floor_m, farthest_m)
    on_floor = drawn.floor_m < farthest_m
    order = np.lexsort((low, place))
    rows = np.stack(
        [
            along * drawn.cos,
            along * drawn.sin,
            low,
            high,
            gain.ravel()[pixel],
            drawn.radial_m,
            drawn.tangential_m,
            along - drawn.radial_m / 2,
            along + drawn.radial_m / 2,
        ]
    )
    rays = np.ascontiguousarray(rows[:, order], dtype=np.float32)
    pixel = pixel[order]
    angle = np.arange(per_turn) * math.tau / per_turn
    image = np.zeros((3, gain.size), dtype=np.float32)
    image[:, pixel] = rays[[X, Y, GAIN]]
    body = (drawn.body_part * gain).reshape(1, -1) * np.array(BODY_BGR)[:, None]
    body[:, pixel] = 0
    directions = np.stack([angle, np.cos(angle), np.sin(angle)], axis=1)
    return PixelTable(
        drawn.height_m,
        PixelRays(
            rays,
            pixel.astype(np.uint32),
            np.searchsorted(place[order], np.arange(per_turn + 1)).astype(np.int32),
            directions,
            _spread(along[on_floor], drawn.tangential_m[on_floor] / 2 + along[on_floor] * math.pi / per_turn),
        ),
        Bearings(directions, per_turn),
        image,
        np.rint(np.clip(body, 0, 255)).astype(np.uint8),
    )


def _spread(along: FloatArray, reach: FloatArray) -> FloatArray:
    """Return a straight line (constant, per metre of distance) above every reach (N,) to the side."""
    near, far = np.argmin(along), np.argmax(along)
    per_m = max(0.0, float(reach[far] - reach[near]) / max(float(along[far] - along[near]), 1e-9))
    return np.array([float((reach - per_m * along).max()), per_m])


def _slope_range(camera: OmniCamera, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and greatest slope (N,) over each pixel (N, 2), by the gradient half a pixel away."""

    def slope(du: float, dv: float) -> FloatArray:
        ray = camera.pixel_to_ray(pixels + np.array([du, dv]))
        return np.asarray(ray[:, 2] / np.maximum(np.hypot(ray[:, 0], ray[:, 1]), 1e-9))

    middle = slope(0.0, 0.0)
    half = np.hypot(slope(0.25, 0.0) - slope(-0.25, 0.0), slope(0.0, 0.25) - slope(0.0, -0.25))
    half = np.maximum(np.nan_to_num(half), 1e-6)  # a table's curve may end beside the pixel
    return middle - half, middle + half


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
