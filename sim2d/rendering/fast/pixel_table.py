"""What a camera's pixels see of an empty floor, computed once: floor points, slopes, patches, bearings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from sim2d.kernels.floor_lines import GAIN, X, Y
from sim2d.kernels.frame_values import Bearings, PixelRays
from sim2d.rendering.mirror import BODY_BGR
from sim2d.rendering.rays import MirrorRays


@dataclass(frozen=True, eq=False)
class PixelTable:
    """A camera's pixels as the compiled loops take them (`kernels.match_pixels`)."""

    #: Of the viewpoint.
    height_m: float
    #: Of every pixel that shows the scene.
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
