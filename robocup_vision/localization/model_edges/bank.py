"""Prepares a bank of poses all over a field, and the tables by which they are scored."""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.kernels.model_edges.find import Bank
from robocup_vision.kernels.model_edges.sightings import Uprights
from robocup_vision.localization.model_edges.field_edges import MIN_CHROMA

_CELL_M = 0.04
_MARGIN_M = 0.6  # margin of the table of distances beyond the outer lines
_CUT_OFF_M = 1.2
# weights of bearing and size of a beacon, and of a post, in line points
_BEACON_WEIGHT, _POST_WEIGHT = 8.0, 2.0


def prepare_bank(field: Field, spacing_m: float, heading_step_rad: float) -> Bank:
    """Prepare a bank; on a field whose halves look alike, of one half only."""
    half_x, half_y = field.length_m / 2 + 0.2, field.width_m / 2 + 0.2
    low_x = -half_x if field.shows_half else 0.0
    columns = np.arange(low_x + spacing_m / 2, half_x, spacing_m)
    rows = np.arange(-half_y + spacing_m / 2, half_y, spacing_m)
    origin = np.array([-field.length_m / 2 - _MARGIN_M, -field.width_m / 2 - _MARGIN_M])
    places = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    places = np.rint((places - origin) / _CELL_M) * _CELL_M + origin
    count = math.ceil(math.tau / heading_step_rad)
    headings = np.linspace(0.0, math.tau, count, endpoint=False)
    shape = (round(-2 * origin[1] / _CELL_M) + 1, round(-2 * origin[0] / _CELL_M) + 1)
    distance = _distances(field.line_points(_CELL_M / 2), origin, shape)
    return Bank(np.ascontiguousarray(places), headings, distance, origin, _CELL_M)


def with_walls(bank: Bank, field: Field) -> Bank:
    """Return a bank of the same poses, with distances from the floor's walls."""
    steps = [
        np.linspace(row[:2], row[2:], 2 + math.ceil(2 * math.dist(row[:2], row[2:]) / _CELL_M)) for row in field.walls
    ]
    distance = _distances(np.vstack(steps), bank.origin_m, bank.distance_m.shape)
    return bank._replace(distance_m=distance)


def _distances(points_m: FloatArray, origin_m: FloatArray, shape: tuple[int, ...]) -> Float32Array:
    """Return distances (R, C), metres, of cells from points (N, 2), limited; points beside the table are left out."""
    away = np.full(shape, 255, dtype=np.uint8)
    column, row = np.rint((points_m - origin_m) / _CELL_M).astype(np.intp).T
    inside = (row >= 0) & (column >= 0) & (row < shape[0]) & (column < shape[1])
    away[row[inside], column[inside]] = 0
    distance = np.asarray(cv2.distanceTransform(away, cv2.DIST_L2, 5), dtype=np.float32) * np.float32(_CELL_M)
    return np.asarray(np.minimum(distance, _CUT_OFF_M), dtype=np.float32)


def prepare_uprights(field: Field) -> Uprights:
    """Prepare what `kernels.model_edges.sightings` looks for: posts and panels of goals, beacons of two bands."""
    names: list[str] = []
    paints: list[FloatArray] = []
    places: list[list[float]] = []
    paint: list[list[int]] = []
    sizes: list[list[float]] = []

    def index(name: str) -> int:
        if name not in names:
            color = np.array(COLOR_NAMES[name], dtype=np.float64)
            if np.ptp(color) < MIN_CHROMA:
                return -1
            names.append(name)
            paints.append(np.asarray((color - color.mean()) / np.linalg.norm(color - color.mean())))
        return names.index(name)

    for beacon in field.beacons:
        for lower, upper in itertools.pairwise(beacon.colors):
            if index(lower) >= 0 and index(upper) >= 0:
                places.append([beacon.x_m, beacon.y_m] * 2)
                paint.append([index(upper), index(lower)])
                sizes.append([2 * beacon.height_m / len(beacon.colors), 2 * beacon.radius_m, _BEACON_WEIGHT])
    for goal in field.goals:
        if goal.kind == "recess" or index(goal.color) < 0:
            continue
        half = goal.width_m / 2
        paint.append([index(goal.color), -1])
        if goal.kind == "posts":
            places.append([goal.line_x_m, -half, goal.line_x_m, half])
            sizes.append([goal.height_m + goal.post_radius_m, 2 * goal.post_radius_m, _POST_WEIGHT])
        else:
            # the back panel is the part that is entirely visible from most places
            places.append([goal.back_x_m, 0.0] * 2)
            sizes.append([goal.height_m, goal.width_m, _POST_WEIGHT])
    size = np.array(sizes, dtype=np.float64).reshape(-1, 3)
    return Uprights(
        np.array(paints, dtype=np.float64).reshape(-1, 3),
        np.array(places, dtype=np.float64).reshape(-1, 4),
        np.array(paint, dtype=np.int64).reshape(-1, 2),
        np.ascontiguousarray(size[:, 0]),
        np.ascontiguousarray(size[:, 1]),
        np.ascontiguousarray(size[:, 2]),
    )
