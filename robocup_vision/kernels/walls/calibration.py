"""Compiled loop of the mirror camera's calibration: pixels to homogeneous floor points, as often as derivatives ask."""

from __future__ import annotations

import math
from typing import NamedTuple

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


class MirrorView(NamedTuple):
    """A mirror camera on its robot.

    Parameters
    ----------
    center_px : (float, float)
        Image of the mirror's axis, u and v.
    sign : float
        1 if bearing grows clockwise in the image as shown, else -1.
    heading_rad : float
        Bearing of the image's +u direction.
    camera_to_robot : (3, 3) float64
        Rotation of directions.
    viewpoint_m : (float, float, float)
        The viewpoint, robot frame.
    """

    center_px: tuple[float, float]
    sign: float
    heading_rad: float
    camera_to_robot: FloatArray
    viewpoint_m: tuple[float, float, float]


@compiled
def floor_points(pixels: FloatArray, inverse_range: FloatArray, view: MirrorView, out: FloatArray) -> None:
    """Homogeneous floor points X, Y, W of pixels, robot frame: the floor point is (X, Y) / W, W <= 0 above the horizon.

    Parameters
    ----------
    pixels : (N, 2) float64
    inverse_range : (N,) float64
        1/r at the pixels' image radii; not finite where the curve says nothing.
    view : MirrorView
        The camera.
    out : (N, 3) float64
        Filled; -1, -1, -1 where the curve says nothing.
    """
    (center_u, center_v), to_robot = view.center_px, view.camera_to_robot
    offset_x, offset_y, height = view.viewpoint_m
    cos_h, sin_h = math.cos(view.heading_rad), math.sin(view.heading_rad)
    for i in range(pixels.shape[0]):
        du, dv = pixels[i, 0] - center_u, view.sign * (pixels[i, 1] - center_v)
        radius = math.sqrt(du * du + dv * dv)
        q = inverse_range[i]
        if not (radius > 0.0 and math.isfinite(q)):
            out[i, 0], out[i, 1], out[i, 2] = -1.0, -1.0, -1.0
            continue
        # not too large near the centre, where q is
        scale = 1.0 / math.sqrt(1.0 + q * q * height * height)
        x = (cos_h * du - sin_h * dv) / radius * scale
        y = (sin_h * du + cos_h * dv) / radius * scale
        z = -q * height * scale
        w = -(to_robot[2, 0] * x + to_robot[2, 1] * y + to_robot[2, 2] * z) / height
        out[i, 0] = to_robot[0, 0] * x + to_robot[0, 1] * y + to_robot[0, 2] * z + w * offset_x
        out[i, 1] = to_robot[1, 0] * x + to_robot[1, 1] * y + to_robot[1, 2] * z + w * offset_y
        out[i, 2] = w
