"""Where the middle of a line is whose two edges the picture shows: perspective puts it nearer than their middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.perception.line_points import FloorCamera, LinePoints
from robocup_vision.perception.markings.settings import MarkingSettings
from robocup_vision.perception.markings.straight import Straight, stretch_of


def middle_shifts_m(camera: FloorCamera, places_m: FloatArray, normals: FloatArray, line_width_m: float) -> FloatArray:
    """Return how far (P, 2) the pixels midway between a line's edges lie from its middle on the floor, metres.

    Parameters
    ----------
    camera : FloorCamera
        That shows the line.
    places_m, normals : (P, 2) float64
        Of the line's middle, and the directions across it, robot frame.
    line_width_m : float
        From edge to edge.
    """
    half = 0.5 * line_width_m * normals
    midway = 0.5 * (camera.floor_to_pixel(places_m + half) + camera.floor_to_pixel(places_m - half))
    return np.asarray(np.nan_to_num(camera.pixel_to_floor(midway) - places_m))


def fit_middles(
    points: LinePoints, lines: list[Straight], camera: FloorCamera, line_width_m: float, settings: MarkingSettings
) -> tuple[LinePoints, list[Straight]]:
    """Return line points on the middles of the lines that they lie on, and the lines through these."""
    floor = points.floor_m.copy()
    for line in lines:
        places = floor[line.points]
        normals = np.broadcast_to(line.normal, places.shape)
        floor[line.points] -= middle_shifts_m(camera, places, normals, line_width_m)
    points = replace(points, floor_m=floor)
    return points, [stretch_of(points, line.points, line.angle_rad, settings) for line in lines]
