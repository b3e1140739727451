"""Compiled: where a ray meets the round wall behind a field, and the wall in one tile of a forward camera's frame.

The wall's picture consists of cells of one colour. A pixel is the mean over its footprint, at most one cell wide and
high, so it covers at most four cells. The three channels of a cell are in one integer and are averaged together.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt64Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.frame_values import WallPicture

# a channel is stored in quarters of a grey level, in lanes of 21 bits; weights are in 256ths
_QUARTERS, _BITS, _PARTS = 4.0, 21, 256.0
_MAX_STORED = 8191
_MASK = np.uint64((1 << 13) - 1)
_LANES = np.uint64(((1 << 13) - 1) * (1 + (1 << 21) + (1 << 42)))
_SHIFT, _GREEN, _RED = np.uint64(8), np.uint64(21), np.uint64(42)
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


def pack_cells(picture: Float32Array) -> UInt64Array:
    """Return the cells (H + 2, 3 W / 2), see `WallPicture`, of a picture (H, W, 3) BGR with values from 0 to 2047."""
    stored = np.rint(np.clip(picture * _QUARTERS, 0, _MAX_STORED)).astype(np.uint64)
    cells = stored[..., 0] | stored[..., 1] << _GREEN | stored[..., 2] << _RED
    return np.ascontiguousarray(np.pad(np.hstack([cells, cells[:, : cells.shape[1] // 2]]), ((1, 1), (0, 0)), "edge"))


@compiled(error_model="numpy")
def wall_point(cos: float, sin: float, x_m: float, y_m: float, wall: WallPicture) -> tuple[float, float]:
    """Return where a direction from a place, field frame, meets the wall: column of its picture, distance (m)."""
    toward = -(cos * x_m + sin * y_m)
    away2 = x_m * x_m + y_m * y_m
    distance = toward + math.sqrt(max(toward * toward + wall.radius_m * wall.radius_m - away2, 0.0))
    turn = math.atan2(y_m + distance * sin, x_m + distance * cos) / math.tau
    return turn * wall.turn, distance


@compiled(error_model="numpy", inline="always")
def cell_color(cell: np.uint64) -> tuple[np.float32, np.float32, np.float32]:
    """Return blue, green and red of a cell, or of the mean of several."""
    quarter = np.float32(1.0 / _QUARTERS)
    blue, green = np.float32(np.int32(cell & _MASK)), np.float32(np.int32((cell >> _GREEN) & _MASK))
    return blue * quarter, green * quarter, np.float32(np.int32((cell >> _RED) & _MASK)) * quarter


@compiled(error_model="numpy")
def draw_wall(
    corners: FloatArray,
    shape: tuple[int, int],
    wall: WallPicture,
    cells_of_wall: UInt64Array,
    places: Float32Array,
    cells: Int32Array,
    mixed: UInt64Array,
    colors: Float32Array,
) -> None:
    """Draw the round wall over a tile wherever it is nearer than the floor.

    Parameters
    ----------
    corners : (2, 3, 2) float64
        Column of the picture (not negative, continuous) and height (m) at the left, middle and right of the tile's
        upper and lower side; both are interpolated linearly.
    shape : (int, int)
        Rows and columns of pixels.
    cells_of_wall : (M,) uint64
        Cells of the wall's picture, one row after another.
    places : (N,) float32
        Column of each pixel in the tile, row by row.
    cells : (4, N) int32
        Working memory for the tile's pixels.
    mixed : (N,) uint64
        Likewise.
    colors : (3, N) float32
        Blue, green, red of each pixel, row by row; changed.
    """
    rows, columns = shape
    above_all, stride = np.float32(wall.cells.shape[0] - 2), np.int32(wall.cells.shape[1])
    pixels = rows * columns
    half = columns // 2
    per_u, per_v = 1.0 / half, 1.0 / rows
    wide = abs(corners[0, 1, 0] - corners[0, 0, 0]) * per_u + abs(corners[1, 0, 0] - corners[0, 0, 0]) * per_v
    tall = abs(corners[0, 1, 1] - corners[0, 0, 1]) * per_u + abs(corners[1, 0, 1] - corners[0, 0, 1]) * per_v
    per_up = np.float32(1.0 / max(tall, 1e-9))
    size_c = np.float32(min(max(wide, 1e-3), 1.0))
    size_r = np.float32(min(max(tall * wall.rows_per_m, 1e-3), 1.0))
    half_c, half_r = size_c * _HALF, size_r * _HALF
    per_c, per_r, per_row = np.float32(_PARTS) / size_c, np.float32(_PARTS) / size_r, np.float32(wall.rows_per_m)
    parts = np.float32(_PARTS)
    first, across, above, over = cells[0], cells[1], cells[2], cells[3]
    many = np.uintp(half)
    for v in range(rows):
        part = (v + 0.5) * per_v
        for side in range(2):
            upper_left, upper_right = corners[0, side], corners[0, side + 1]
            lower_left, lower_right = corners[1, side], corners[1, side + 1]
            left_c = upper_left[0] + part * (lower_left[0] - upper_left[0])
            right_c = upper_right[0] + part * (lower_right[0] - upper_right[0])
            left_up = upper_left[1] + part * (lower_left[1] - upper_left[1])
            right_up = upper_right[1] + part * (lower_right[1] - upper_right[1])
            step_c, step_up = np.float32((right_c - left_c) * per_u), np.float32((right_up - left_up) * per_u)
            start = np.uintp(v * columns + side * half)
            begin_c, begin_up = np.float32(left_c), np.float32(left_up)
            for k in range(many):
                place = places[k] + _HALF
                up, end_c = begin_up + step_up * place, begin_c + step_c * place + half_c
                # the picture has an additional row below
                end_r = min(max(up * per_row + _ONE, half_r), above_all) + half_r
                over[start + k] = np.int32(min(max((_HALF + up * per_up) * parts, _ZERO), parts))
                in_c, in_r = end_c - np.float32(np.int32(end_c)), end_r - np.float32(np.int32(end_r))
                across[start + k] = np.int32(in_c * per_c if in_c < size_c else _ZERO)
                above[start + k] = np.int32(in_r * per_r if in_r < size_r else _ZERO)
                first[start + k] = np.int32(end_r - size_r) * stride + np.int32(end_c - size_c)
    flat = cells_of_wall
    row_step, one = np.uint64(stride), np.uint64(1)
    for i in range(pixels):
        at, wc, wr = np.uint64(first[i]), np.uint64(across[i]), np.uint64(above[i])
        below, upper = flat[at], flat[at + row_step]
        # lanes of the differences may borrow from each other, but not those of the sum
        below = (((below << _SHIFT) + (flat[at + one] - below) * wc) >> _SHIFT) & _LANES
        upper = (((upper << _SHIFT) + (flat[at + row_step + one] - upper) * wc) >> _SHIFT) & _LANES
        mixed[i] = (((below << _SHIFT) + (upper - below) * wr) >> _SHIFT) & _LANES
    per_part = np.float32(1.0 / _PARTS)
    blue, green, red = colors[0], colors[1], colors[2]
    for i in range(pixels):
        fraction = np.float32(over[i]) * per_part
        wall_blue, wall_green, wall_red = cell_color(mixed[i])
        blue[i] += fraction * (wall_blue - blue[i])
        green[i] += fraction * (wall_green - green[i])
        red[i] += fraction * (wall_red - red[i])
