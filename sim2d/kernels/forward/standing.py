"""Compiled: draws things and nets over a tile's floor and room, with four rays per pixel at edges."""

from __future__ import annotations

import numpy as np

from robocup_vision.compiling.loops import compiled
from sim2d.kernels.forward.outlines import NET, NET_ROWS, THING, THING_ROWS, overlaps
from sim2d.kernels.forward.rays import cast_corners, pixels_of
from sim2d.kernels.forward.values import Tile, View
from sim2d.kernels.nets import along_axes, cover, from_eye
from sim2d.kernels.things import ID_BITS, KIND, meet_grid, meet_thing, row_of

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_FAR = np.float32(1e29)
# places of the four rays in a pixel, as in `rays.sample_offsets(2)`
_SAMPLES_U = (-0.375, -0.125, 0.125, 0.375)
_SAMPLES_V = (-0.125, 0.375, -0.375, 0.125)


@compiled(error_model="numpy")
def draw_things(view: View, tile: Tile) -> None:
    """Draw things over a tile's floor and room; `nearest` gets their distance and their fraction of each pixel."""
    (rows, columns), height, outlines = tile.shape, view.here[2], view.outlines
    near, near_rows, near_count = tile.seen[THING], tile.seen[THING_ROWS], tile.seen_count[THING]
    rays, of_tile, per_pixel, colors, nearest = tile.rays, tile.slopes, tile.per_pixel, tile.colors, tile.nearest
    ids, depth, fine, here, lit = tile.ids, tile.depth, tile.fine, view.here, view.lit
    wide = columns + 1
    cast_corners(tile)
    for k in range(len(depth)):
        depth[k], ids[k] = _FAR, -1
    any_thin = False
    first_v, last_v, first_u, last_u = rows, -1, columns, -1
    half = per_pixel[0] * _HALF
    for n in range(near_count):
        outline = outlines.bounds[near_rows[n]]
        v0, v1, u0, u1 = pixels_of(outline, tile)
        first_v, last_v, first_u, last_u = min(first_v, v0), max(last_v, v1), min(first_u, u0), max(last_u, u1)
        part = v0, v1 + 2, u0, u1 + 2
        row, first_id = view.things[near[n]], np.int32(near[n] << ID_BITS)
        meet_grid(row, first_id, tile.corner_rays, part, wide, height, view.lamp, depth, ids)
        if outlines.owners[near_rows[n], 2]:
            any_thin = True
            for v in range(v0, v1 + 1):
                for u in range(u0, u1 + 1):
                    right, down = of_tile[0, v * columns + u], of_tile[1, v * columns + u]
                    if overlaps(outline, right - half, right + half, down - half, down + half):
                        fine[v * columns + u] = 1
    for v in range(first_v, last_v + 1):
        for u in range(first_u, last_u + 1):
            k, i = v * wide + u, v * columns + u
            first = ids[k]
            if fine[i] or first != ids[k + 1] or first != ids[k + wide] or first != ids[k + wide + 1]:
                _draw_edge(view, tile, i)
            elif first >= 0:
                dx, dy, dz = rays[0, i], rays[1, i], rays[2, i]
                met = row_of(view.things, np.uintp(first >> ID_BITS))
                t, color, shade = meet_thing(met[KIND], met, dx, dy, dz, height, view.lamp)
                if t < _FAR:
                    nearest[0, i], nearest[1, i] = t, _ONE
                    bright = lit[0] + lit[1] * (here[0] + t * dx) + lit[2] * (here[1] + t * dy)
                    bright = shade * max(bright, lit[3])
                    for channel in range(3):
                        colors[channel, i] = bright * view.colors[color, channel]
    if any_thin:
        fine[:] = 0


@compiled(error_model="numpy")
def _draw_edge(view: View, tile: Tile, i: int) -> None:
    """Draw things over a pixel with four rays."""
    near, near_count, rays, steps = tile.seen[THING], tile.seen_count[THING], tile.rays, tile.steps
    here, lit, lamp, paints, colors, nearest = view.here, view.lit, view.lamp, view.colors, tile.colors, tile.nearest
    ux, uy, uz = np.float32(steps[0, 0]), np.float32(steps[0, 1]), np.float32(steps[0, 2])
    vx, vy, vz = np.float32(steps[1, 0]), np.float32(steps[1, 1]), np.float32(steps[1, 2])
    blue, green, red, left, away = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    for sample in range(4):
        a, b = np.float32(_SAMPLES_U[sample]), np.float32(_SAMPLES_V[sample])
        dx, dy, dz = rays[0, i] + a * ux + b * vx, rays[1, i] + a * uy + b * vy, rays[2, i] + a * uz + b * vz
        met, found, shade = _FAR, np.int32(-1), _ZERO
        for n in range(near_count):
            row = row_of(view.things, np.uintp(near[n]))
            t, color, shade_there = meet_thing(row[KIND], row, dx, dy, dz, here[2], lamp)
            if t < met:
                met, found, shade = t, color, shade_there
        if found < 0:
            left += _ONE
            continue
        away += met
        bright = lit[0] + lit[1] * (here[0] + met * dx) + lit[2] * (here[1] + met * dy)
        bright = shade * max(bright, lit[3])
        blue += bright * paints[found, 0]
        green += bright * paints[found, 1]
        red += bright * paints[found, 2]
    quarter = np.float32(0.25)
    nearest[0, i], nearest[1, i] = away / max(np.float32(4.0) - left, _ONE), _ONE - quarter * left
    colors[0, i] = quarter * (blue + left * colors[0, i])
    colors[1, i] = quarter * (green + left * colors[1, i])
    colors[2, i] = quarter * (red + left * colors[2, i])


@compiled(error_model="numpy")
def draw_net(view: View, tile: Tile, n: int) -> None:
    """Draw the nth of the nets that may be visible in a tile."""
    here, lit, color, steps, colors = view.here, view.lit, view.nets.color, tile.steps, tile.colors
    v0, v1, u0, u1 = pixels_of(view.outlines.bounds[tile.seen[NET_ROWS, n]], tile)
    axes, start, sizes = from_eye(view.nets.rows[tile.seen[NET, n]], here)
    by_u = along_axes(axes, np.float32(steps[0, 0]), np.float32(steps[0, 1]), np.float32(steps[0, 2]))
    by_v = along_axes(axes, np.float32(steps[1, 0]), np.float32(steps[1, 1]), np.float32(steps[1, 2]))
    level, per_x, per_y, least = lit[0] + lit[1] * here[0] + lit[2] * here[1], lit[1], lit[2], lit[3]
    cord_b, cord_g, cord_r = color[0], color[1], color[2]
    blue, green, red = colors[0], colors[1], colors[2]
    ray_x, ray_y, ray_z, depth, fraction = tile.rays[0], tile.rays[1], tile.rays[2], tile.nearest[0], tile.nearest[1]
    many = np.uintp(max(u1 - u0 + 1, 0))
    for v in range(v0, v1 + 1):
        first = np.uintp(v * tile.shape[1] + u0)
        for u in range(many):
            i = first + u
            x, y = ray_x[i], ray_y[i]
            t, covered = cover(start, sizes, along_axes(axes, x, y, ray_z[i]), by_u, by_v)
            covered *= _ONE - (fraction[i] if depth[i] < t else _ZERO)
            bright = max(level + t * (per_x * x + per_y * y), least)
            blue[i] += covered * (bright * cord_b - blue[i])
            green[i] += covered * (bright * cord_g - green[i])
            red[i] += covered * (bright * cord_r - red[i])
