"""Compiled: the rays of a tile's pixels, with the lens and the camera's rotation while its rows are read."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.forward.values import ForwardLens, Tile

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@compiled(error_model="numpy", inline="always")
def turned(right: float, down: float, part: float, tx: float, ty: float, tz: float) -> tuple[float, float]:
    """Return a ray's slopes in the axes of the middle row, if the camera has rotated by `part` of (tx, ty, tz)."""
    ahead = 1.0 + part * (tz * right - ty * down)
    return (right - part * (tz + tx * down)) / ahead, (down + part * (tx * right + ty)) / ahead


@compiled(error_model="numpy", inline="always")
def camera_ray(rotation: FloatArray, right: float, down: float) -> tuple[float, float, float]:
    """Return the ray with slopes to the right and down, field axes."""
    dx = rotation[0, 0] - rotation[0, 1] * right - rotation[0, 2] * down
    dy = rotation[1, 0] - rotation[1, 1] * right - rotation[1, 2] * down
    dz = rotation[2, 0] - rotation[2, 1] * right - rotation[2, 2] * down
    return dx, dy, dz


@compiled(error_model="numpy")
def turn_bounds(bounds: Float32Array, shutter: tuple[float, float, float, float], v0: int, rows: int) -> None:
    """Rotate the bounds of a row of tiles, which begins in pixel row v0, as the slopes of its pixels are rotated."""
    tx, ty, tz, per_row = shutter
    for column in range(len(bounds)):
        left, right, upper, lower = bounds[column]
        bounds[column, 0], bounds[column, 2] = math.inf, math.inf
        bounds[column, 1], bounds[column, 3] = -math.inf, -math.inf
        for corner in range(8):
            part = (v0 + (rows if corner & 1 else -1)) * per_row - 0.5
            u, v = turned(right if corner & 2 else left, lower if corner & 4 else upper, part, tx, ty, tz)
            bounds[column, 0], bounds[column, 1] = min(bounds[column, 0], u), max(bounds[column, 1], u)
            bounds[column, 2], bounds[column, 3] = min(bounds[column, 2], v), max(bounds[column, 3], v)


@compiled(error_model="numpy")
def turn_slopes(tile: Tile, rows: Float32Array, v0: int, shutter: tuple[float, float, float, float]) -> None:
    """Apply the camera's rotation during readout to the slopes of a tile, and to their change per pixel."""
    slopes, per_pixel = tile.slopes, tile.per_pixel
    tx, ty, tz = np.float32(shutter[0]), np.float32(shutter[1]), np.float32(shutter[2])
    per_row, first = np.float32(shutter[3]), np.float32(v0 * shutter[3] - 0.5)
    right, down = slopes[0], slopes[1]
    u, v = right[len(right) // 2], down[len(down) // 2]
    per_pixel[1] -= per_row * (tz + tx * v + u * (tz * u - ty * v))
    per_pixel[3] += per_row * (tx * u + ty - v * (tz * u - ty * v))
    for i in range(len(right)):
        part, a, b = first + per_row * rows[i], right[i], down[i]
        per_ahead = _ONE / (_ONE + part * (tz * a - ty * b))
        right[i] = (a - part * (tz + tx * b)) * per_ahead
        down[i] = (b + part * (tx * a + ty)) * per_ahead


@compiled(error_model="numpy")
def fill_slopes(lens: ForwardLens, row: int, column: int, tile: Tile) -> None:
    """Fill in the slopes of a tile's pixels, and their change per pixel."""
    tile.per_pixel[:] = lens.per_pixel[row, column]
    per_pixel, right, down = tile.per_pixel, tile.slopes[0], tile.slopes[1]
    if len(lens.slopes):
        right[:], down[:] = lens.slopes[row, column, 0], lens.slopes[row, column, 1]
        return
    # the middle of the first pixel is half a pixel inside the tile's corner
    by_u, by_v, places_u, places_v = per_pixel[0], per_pixel[3], lens.places[0], lens.places[1]
    first_right = np.float32(lens.corner_slopes[row, 2 * column, 0]) + by_u * _HALF
    first_down = np.float32(lens.corner_slopes[row, 2 * column, 1]) + by_v * _HALF
    for i in range(len(right)):
        right[i], down[i] = first_right + by_u * places_u[i], first_down + by_v * places_v[i]


@compiled(error_model="numpy")
def cast(rotation: FloatArray, tile: Tile) -> None:
    """Fill in the rays of a tile from its slopes, and their change per pixel."""
    right, down, per_pixel, rays, steps = tile.slopes[0], tile.slopes[1], tile.per_pixel, tile.rays, tile.steps
    for axis in range(3):
        ahead, left, up = rotation[axis, 0], rotation[axis, 1], rotation[axis, 2]
        steps[0, axis] = -left * per_pixel[0] - up * per_pixel[2]
        steps[1, axis] = -left * per_pixel[1] - up * per_pixel[3]
        a, b, c = np.float32(ahead), np.float32(left), np.float32(up)
        of_axis = rays[axis]
        for i in range(len(of_axis)):
            of_axis[i] = a - b * right[i] - c * down[i]


@compiled(error_model="numpy")
def cast_corners(tile: Tile) -> None:
    """Fill in the rays through the corners of a tile's pixels, from those through their middles."""
    (rows, columns), rays, steps, corner_rays = tile.shape, tile.rays, tile.steps, tile.corner_rays
    wide = columns + 1
    for axis in range(3):
        by_u, by_v = np.float32(steps[0, axis]), np.float32(steps[1, axis])
        of_axis, of_corner = rays[axis], corner_rays[axis]
        for v in range(rows + 1):
            # the last row and column are extrapolated from the last pixels
            below = v == rows
            back = (by_u + by_v) * _HALF - (by_v if below else _ZERO)
            start, put, many = np.uintp((v - below) * columns), np.uintp(v * wide), np.uintp(columns)
            for u in range(many):
                of_corner[put + u] = of_axis[start + u] - back
            of_corner[put + many] = of_corner[put + many - np.uintp(1)] + by_u


@compiled(error_model="numpy")
def pixels_of(bounds: Float32Array, tile: Tile) -> tuple[int, int, int, int]:
    """Return the first and last row, first and last column of a tile that an outline may cover, with a margin."""
    (rows, columns), per_pixel = tile.shape, tile.per_pixel
    across_v = abs(per_pixel[1]) * rows + per_pixel[0]  # a lens bends columns and rows
    across_u = abs(per_pixel[2]) * columns + per_pixel[3]
    right, down = tile.slopes[0, 0], tile.slopes[1, 0]
    u0 = math.floor((bounds[0] - across_v - right) / per_pixel[0]) - 1
    u1 = math.ceil((bounds[1] + across_v - right) / per_pixel[0]) + 1
    v0 = math.floor((bounds[2] - across_u - down) / per_pixel[3]) - 1
    v1 = math.ceil((bounds[3] + across_u - down) / per_pixel[3]) + 1
    return max(int(v0), 0), min(int(v1), rows - 1), max(int(u0), 0), min(int(u1), columns - 1)
