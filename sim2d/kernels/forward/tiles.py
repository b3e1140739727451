"""Compiled renderer of a forward camera's frame, tile by tile: first the floor and the room, then what stands there.

A tile's pixels stay in the processor's cache. One ray through each corner of a pixel shows whether an edge crosses the
pixel. Only such pixels get the four rays that the slow renderer gives every pixel.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.floor_paint import is_inside
from sim2d.kernels.forward.floor import cover_arc, cover_line, end_carpet, fill_floor, shade_floor
from sim2d.kernels.forward.outlines import (
    ARC,
    EDGE,
    LINE,
    LINE_ROWS,
    NET,
    NET_ROWS,
    SHADE,
    THING,
    THING_ROWS,
    outline_floor,
    outline_nets,
    outline_things,
    overlaps,
)
from sim2d.kernels.forward.rays import camera_ray, cast, fill_slopes, pixels_of, turn_bounds, turn_slopes, turned
from sim2d.kernels.forward.standing import draw_net, draw_things
from sim2d.kernels.forward.values import ForwardEye, ForwardLens, Outlines, Tile, View
from sim2d.kernels.frame_values import FloorPaint, Lighting, Nets, UprightThings, WallPicture
from sim2d.kernels.room import draw_wall, wall_point
from sim2d.kernels.things import rows_from_eye

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_MOST = np.float32(255.0)
_ON_FLOOR, _IN_ROOM, _BOTH = range(3)
FloorTone = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]


@compiled(error_model="numpy")
def draw_forward(
    lens: ForwardLens,
    eye: ForwardEye,
    paint: FloorPaint,
    things: UprightThings,
    nets: Nets,
    light: Lighting,
    wall: WallPicture,
    outlines: Outlines,
    shape: tuple[int, int],
    planes: UInt8Array,
) -> None:
    """Draw a frame.

    Parameters
    ----------
    light : Lighting
        The light on everything except the wall.
    outlines : Outlines
        Memory for the outlines of all objects; overwritten.
    shape : (int, int)
        Number of pixel rows and columns of a tile.
    planes : (3, H, W) uint8
        Blue, green and red of the frame; overwritten.
    """
    here = np.array([eye.x_m, eye.y_m, eye.height_m], dtype=np.float32)
    lit = np.array([light.level, light.per_m_x, light.per_m_y, light.min_level], dtype=np.float32)
    lamp = np.array([math.cos(light.lamp_rad), math.sin(light.lamp_rad)], dtype=np.float32)
    view = View(paint, nets, rows_from_eye(things, eye.x_m, eye.y_m), things.colors, outlines, here, lit, lamp)
    tile_rows, tile_columns, _ = lens.bounds.shape
    thin = 2.0 * float(lens.per_pixel[tile_rows // 2, tile_columns // 2, 0])
    count = outline_things(things, eye, thin, outline_floor(paint, eye, thin, outlines), outlines)
    count = outline_nets(nets, eye, count, outlines)
    at_corners = _wall_at_corners(lens, eye, wall, planes.shape[1], shape[0])

    tile = _new_tile(shape, len(outlines.owners))
    size_px, flat, cells_of_wall = planes.shape[1:], planes.reshape((3, -1)), wall.cells.reshape(-1)
    tone_of_floor = _tone_of_floor(eye.rotation, here, lit)
    cells, mixed = np.empty((4, len(tile.tone)), dtype=np.int32), np.empty(len(tile.tone), dtype=np.uint64)
    corners, seen_count = np.empty((2, 3, 2)), tile.seen_count
    is_turning = (eye.turn_rad != 0).any()
    bounds = lens.bounds[0].copy()
    shutter = (eye.turn_rad[0], eye.turn_rad[1], eye.turn_rad[2], 1.0 / max(planes.shape[1] - 1, 1))
    active = np.empty(len(outlines.owners), dtype=np.int32)
    for row in range(tile_rows):
        bounds[:] = lens.bounds[row]
        if is_turning:
            turn_bounds(bounds, shutter, row * shape[0], shape[0])
        upper, lower = bounds[:, 2].min(), bounds[:, 3].max()
        active_count = 0
        for n in range(count):
            if outlines.bounds[n, 2] <= lower and outlines.bounds[n, 3] >= upper:
                active[active_count] = n
                active_count += 1
        for column in range(tile_columns):
            _find_owners(bounds[column], outlines, active[:active_count], tile)
            kind = _wall_corners(at_corners, row, column, wall.turn, corners)
            if kind == _ON_FLOOR and not is_turning and not seen_count.any():
                color = _floor_color(lens, row, column, paint, eye)
                _store_floor(lens, shape, row, column, tone_of_floor, color, size_px, flat)
                continue
            if kind != _IN_ROOM or seen_count[THING] or seen_count[NET]:
                fill_slopes(lens, row, column, tile)
                if is_turning:
                    turn_slopes(tile, lens.places[1], row * shape[0], shutter)
                cast(eye.rotation, tile)
            if kind != _IN_ROOM:
                _draw_floor(view, tile)
            if kind != _ON_FLOOR:
                draw_wall(corners, shape, wall, cells_of_wall, lens.places[0], cells, mixed, tile.colors)
            if seen_count[NET]:
                tile.nearest[1] = _ZERO
            if seen_count[THING]:
                draw_things(view, tile)
            for n in range(seen_count[NET]):
                draw_net(view, tile, n)
            _store(lens, row, column, tile, size_px, flat)


@compiled(error_model="numpy")
def _new_tile(shape: tuple[int, int], owners: int) -> Tile:
    pixels, corners = shape[0] * shape[1], (shape[0] + 1) * (shape[1] + 1)
    return Tile(
        shape,
        np.empty((NET_ROWS + 1, owners), dtype=np.int32),
        np.empty(NET_ROWS + 1, dtype=np.int64),
        np.empty((2, pixels), dtype=np.float32),
        np.empty(4, dtype=np.float32),
        np.empty((3, pixels), dtype=np.float32),
        np.empty((2, 3)),
        np.empty(pixels, dtype=np.float32),
        np.empty(pixels, dtype=np.float32),
        np.zeros((3, pixels), dtype=np.float32),
        np.zeros((2, pixels), dtype=np.float32),
        np.empty((3, corners), dtype=np.float32),
        np.empty(corners, dtype=np.int32),
        np.empty(corners, dtype=np.float32),
        np.zeros(pixels, dtype=np.uint8),
    )


@compiled(error_model="numpy")
def _wall_at_corners(lens: ForwardLens, eye: ForwardEye, wall: WallPicture, tall_px: int, tile_px: int) -> FloatArray:
    """Return where the rays through the tiles' corners meet the wall, (rows, columns, 2): wall column and height, m.

    Columns are NaN at corners that only belong to tiles which certainly show nothing but floor.
    """
    rotation, turn = eye.rotation, eye.turn_rad
    is_turning = turn[0] != 0 or turn[1] != 0 or turn[2] != 0
    tall, wide, _ = lens.corner_slopes.shape
    at_corners, rays = np.empty((tall, wide, 2)), np.empty((tall, wide, 3))
    on_floor = np.empty((tall, wide), dtype=np.bool_)
    surely_m = 0.9 * (wall.radius_m - math.sqrt(eye.x_m * eye.x_m + eye.y_m * eye.y_m))
    reach2 = (eye.height_m / max(surely_m, 1e-9)) ** 2
    for row in range(tall):
        part = (row * tile_px - 0.5) / max(tall_px - 1, 1) - 0.5
        for column in range(wide):
            right, down = lens.corner_slopes[row, column, 0], lens.corner_slopes[row, column, 1]
            if is_turning:
                right, down = turned(right, down, part, turn[0], turn[1], turn[2])
            dx, dy, dz = camera_ray(rotation, right, down)
            rays[row, column, 0], rays[row, column, 1], rays[row, column, 2] = dx, dy, dz
            on_floor[row, column] = dz < 0 and dz * dz > reach2 * (1 + right * right + down * down)
            at_corners[row, column, 0], at_corners[row, column, 1] = math.nan, -math.inf
    for row in range(tall - 1):
        for tile in range(wide // 2):
            left = 2 * tile
            is_floor = on_floor[row, left] and on_floor[row, left + 1] and on_floor[row, left + 2]
            below = row + 1
            if is_floor and on_floor[below, left] and on_floor[below, left + 1] and on_floor[below, left + 2]:
                continue
            for corner in range(6):
                v, u = row + corner // 3, left + corner % 3
                if math.isnan(at_corners[v, u, 0]):
                    dx, dy, dz = rays[v, u, 0], rays[v, u, 1], rays[v, u, 2]
                    flat = math.sqrt(dx * dx + dy * dy)
                    place, distance = wall_point(dx / flat, dy / flat, eye.x_m, eye.y_m, wall)
                    at_corners[v, u, 0], at_corners[v, u, 1] = place, eye.height_m + distance * dz / flat
    return at_corners


@compiled(error_model="numpy")
def _find_owners(bounds: Float32Array, outlines: Outlines, active: Int32Array, tile: Tile) -> None:
    """List the objects that a tile may show in `tile.seen`, by kind, each once."""
    seen, seen_count = tile.seen, tile.seen_count
    seen_count[:] = 0
    left, right, upper, lower = bounds[0], bounds[1], bounds[2], bounds[3]
    for n in active:
        if overlaps(outlines.bounds[n], left, right, upper, lower):
            kind, number = outlines.owners[n, 0], outlines.owners[n, 1]
            at = seen_count[kind]
            if at == 0 or seen[kind, at - 1] != number:
                seen[kind, at] = number
                seen_count[kind] = at + 1
            if kind == THING:
                seen[THING_ROWS, at] = n
            elif kind == LINE:
                seen[LINE_ROWS, at] = n
            elif kind == NET:
                seen[NET_ROWS, at] = n


@compiled(error_model="numpy")
def _wall_corners(at_corners: FloatArray, row: int, column: int, turn: int, corners: FloatArray) -> int:
    """Fill `corners` with where a tile's corners and the middles of its upper and lower side meet the wall.

    The columns are unwrapped, so that they do not jump by a turn. Returns whether the tile shows floor, room or both.
    """
    low, high, least = math.inf, -math.inf, math.inf
    first = at_corners[row, 2 * column, 0]
    for v in range(2):
        for u in range(3):
            place, up = at_corners[row + v, 2 * column + u, 0], at_corners[row + v, 2 * column + u, 1]
            place += turn * np.rint((first - place) / turn)
            corners[v, u, 0], corners[v, u, 1] = place, up
            low, high, least = min(low, up), max(high, up), min(least, place)
    if high == -math.inf:
        return _ON_FLOOR
    turns = turn * math.floor(least / turn)
    for v in range(2):
        for u in range(3):
            corners[v, u, 0] -= turns
    margin = (high - low) / 8 if low > -math.inf else 0.0
    return _IN_ROOM if low > margin else _ON_FLOOR if high < -margin else _BOTH


@compiled(error_model="numpy")
def _floor_color(lens: ForwardLens, row: int, column: int, paint: FloorPaint, eye: ForwardEye) -> Float32Array:
    """Return the colour, carpet or ground, of a tile that shows only floor without any edge."""
    right, down = lens.corner_slopes[row, 2 * column + 1, 0], lens.corner_slopes[row, 2 * column + 1, 1]
    dx, dy, dz = camera_ray(eye.rotation, right, down)
    scale = -eye.height_m / dz
    is_carpet = is_inside(paint.edges, eye.x_m + scale * dx, eye.y_m + scale * dy)
    color: Float32Array = paint.colors[0] if is_carpet else paint.colors[2]
    return color


@compiled(error_model="numpy")
def _tone_of_floor(rotation: FloatArray, here: Float32Array, lit: Float32Array) -> FloorTone:
    """Return the coefficients that give the floor's brightness by a ray's slopes.

    The first three are coefficients, of 1 and the slopes right and down, of the numerator in `fill_floor`; the next
    three of the ray's downward component. Then come the level at the eye's foot and the smallest level.
    """
    along = np.empty(3)
    for axis in range(3):
        along[axis] = float(here[2]) * (lit[1] * rotation[0, axis] + lit[2] * rotation[1, axis])
    return (
        np.float32(along[0]),
        np.float32(along[1]),
        np.float32(along[2]),
        np.float32(-rotation[2, 0]),
        np.float32(-rotation[2, 1]),
        np.float32(-rotation[2, 2]),
        lit[0] + lit[1] * here[0] + lit[2] * here[1],
        lit[3],
    )


@compiled(error_model="numpy")
def _store_floor(
    lens: ForwardLens,
    shape: tuple[int, int],
    row: int,
    column: int,
    tone_of_floor: FloorTone,
    color: Float32Array,
    size_px: tuple[int, int],
    planes: UInt8Array,
) -> None:
    """Write a tile of plain floor into the frame: `fill_floor` and `_store` in one pass."""
    height, width = size_px
    v0, u0 = row * shape[0], column * shape[1]
    rows, many = min(shape[0], height - v0), np.uintp(min(shape[1], width - u0))
    per_pixel, gain = lens.per_pixel[row, column], lens.gains[row, column]
    a0, a1, a2, d0, d1, d2, level, least = tone_of_floor
    blue, green, red = color[0], color[1], color[2]
    of_blue, of_green, of_red = planes[0], planes[1], planes[2]
    is_bent = len(lens.slopes) > 0
    right, down = lens.places[0], lens.places[1]
    by_u, by_v = per_pixel[0], per_pixel[3]
    first_right = np.float32(lens.corner_slopes[row, 2 * column, 0]) + by_u * _HALF
    first_down = np.float32(lens.corner_slopes[row, 2 * column, 1]) + by_v * _HALF
    if is_bent:
        right, down = lens.slopes[row, column, 0], lens.slopes[row, column, 1]
        first_right, first_down, by_u, by_v = _ZERO, _ZERO, _ONE, _ONE
    # the same coefficients, for the values that `right` and `down` contain
    a0, a1, a2 = a0 - a1 * first_right - a2 * first_down, a1 * by_u, a2 * by_v
    d0, d1, d2 = d0 - d1 * first_right - d2 * first_down, d1 * by_u, d2 * by_v
    for v in range(rows):
        start, put = np.uintp(v * shape[1]), np.uintp((v0 + v) * width + u0)
        for u in range(many):
            i, k = start + u, put + u
            drop = d0 - d1 * right[i] - d2 * down[i]
            tone = max(level + (a0 - a1 * right[i] - a2 * down[i]) / drop, least) * gain[i]
            of_blue[k] = np.uint8(np.int32(min(tone * blue + _HALF, _MOST)))
            of_green[k] = np.uint8(np.int32(min(tone * green + _HALF, _MOST)))
            of_red[k] = np.uint8(np.int32(min(tone * red + _HALF, _MOST)))


@compiled(error_model="numpy")
def _draw_floor(view: View, tile: Tile) -> None:
    """Fill a tile with carpet, lines and ground."""
    paint, here, columns, rays, seen_count = view.paint, view.here, tile.shape[1], tile.rays, tile.seen_count
    tone, covered, colors, pixels = tile.tone, tile.covered, tile.colors, len(tile.tone)
    fill_floor(view, tile)
    for n in range(seen_count[SHADE]):
        shade_floor(view, tile.seen[SHADE, n], tile)
    base, over = paint.colors[0], paint.colors[1]
    if seen_count[LINE] or seen_count[ARC]:
        covered[:pixels] = _ZERO
        for n in range(seen_count[LINE]):
            v0, v1, _, _ = pixels_of(view.outlines.bounds[tile.seen[LINE_ROWS, n]], tile)
            if v1 >= v0:
                cover_line(view, tile.seen[LINE, n], (v0 * columns, (v1 + 1) * columns), tile)
        for n in range(seen_count[ARC]):
            cover_arc(view, tile.seen[ARC, n], tile)
        for channel in range(3):
            first, more, of_channel = base[channel], over[channel] - base[channel], colors[channel]
            for i in range(pixels):
                of_channel[i] = tone[i] * (first + covered[i] * more)
    else:
        for channel in range(3):
            first, of_channel = base[channel], colors[channel]
            for i in range(pixels):
                of_channel[i] = tone[i] * first
    is_carpet = True
    if seen_count[EDGE]:
        end_carpet(view, tile)
        is_carpet = False
    else:
        for i in (0, pixels - 1):  # if the tile shows any floor, then at one of these pixels
            if rays[2, i] < _ZERO:
                scale = -here[2] / rays[2, i]
                x, y = here[0] + scale * rays[0, i], here[1] + scale * rays[1, i]
                is_carpet = is_inside(paint.edges, float(x), float(y))
        if not is_carpet:
            covered[:pixels] = _ZERO
    if not is_carpet:
        ground = paint.colors[2]
        for channel in range(3):
            of_channel, beside = colors[channel], ground[channel]
            for i in range(pixels):
                other = tone[i] * beside
                of_channel[i] = other + covered[i] * (of_channel[i] - other)


@compiled(error_model="numpy")
def _store(lens: ForwardLens, row: int, column: int, tile: Tile, size_px: tuple[int, int], planes: UInt8Array) -> None:
    """Write a tile into the frame, with the lens's gain at each pixel."""
    (height, width), (tall, wide), colors = size_px, tile.shape, tile.colors
    v0, u0 = row * tall, column * wide
    rows, many = min(tall, height - v0), np.uintp(min(wide, width - u0))
    gain = lens.gains[row, column]
    for channel in range(3):
        of_channel, plane = colors[channel], planes[channel]
        for v in range(rows):
            start, put = np.uintp(v * wide), np.uintp((v0 + v) * width + u0)
            for u in range(many):
                plane[put + u] = np.uint8(np.int32(min(of_channel[start + u] * gain[start + u] + _HALF, _MOST)))
