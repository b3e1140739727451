"""Compiled: what stands in a tile, drawn over its floor and room; by four rays where an edge crosses a pixel."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.forward.outlines import THING, THING_ROWS, overlaps
from sim2d.kernels.forward.rays import cast_corners, pixels_of
from sim2d.kernels.forward.values import Outlines
from sim2d.kernels.things import ID_BITS, KIND, meet_grid, meet_thing, row_of

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_FAR = np.float32(1e29)
# places of the four rays in a pixel, as `rays.sample_offsets(2)` has them
_SAMPLES_U = (-0.375, -0.125, 0.125, 0.375)
_SAMPLES_V = (-0.125, 0.375, -0.375, 0.125)


@compiled(error_model="numpy")
def draw_things(
    rows_of: Float32Array,
    paints: Float32Array,
    outlines: Outlines,
    seen: Int32Array,
    seen_count: Int64Array,
    of_tile: Float32Array,
    per_pixel: Float32Array,
    tile: tuple[int, int],
    rays: Float32Array,
    steps: FloatArray,
    here: Float32Array,
    lit: Float32Array,
    lamp: Float32Array,
    fine: UInt8Array,
    corner_rays: Float32Array,
    ids: Int32Array,
    depth: Float32Array,
    nearest: Float32Array,
    colors: Float32Array,
) -> None:
    """Draw things over a tile's floor and room; `nearest` keeps how far away they are, and their share of a pixel."""
    rows, columns = tile
    near, near_count, height = seen[THING], seen_count[THING], here[2]
    wide = columns + 1
    cast_corners(rays, tile, steps, corner_rays)
    for k in range(len(depth)):
        depth[k], ids[k] = _FAR, -1
    any_thin = False
    first_v, last_v, first_u, last_u = rows, -1, columns, -1
    half = per_pixel[0] * _HALF
    for n in range(near_count):
        outline = outlines.bounds[seen[THING_ROWS, n]]
        v0, v1, u0, u1 = pixels_of(outline, of_tile, per_pixel, tile)
        first_v, last_v, first_u, last_u = min(first_v, v0), max(last_v, v1), min(first_u, u0), max(last_u, u1)
        part = v0, v1 + 2, u0, u1 + 2
        meet_grid(rows_of[near[n]], np.int32(near[n] << ID_BITS), corner_rays, part, wide, height, lamp, depth, ids)
        if outlines.owners[seen[THING_ROWS, n], 2]:
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
                _draw_edge(rows_of, paints, near, near_count, rays, i, steps, here, lit, lamp, nearest, colors)
            elif first >= 0:
                dx, dy, dz = rays[0, i], rays[1, i], rays[2, i]
                row = row_of(rows_of, np.uintp(first >> ID_BITS))
                t, color, shade = meet_thing(row[KIND], row, dx, dy, dz, height, lamp)
                if t < _FAR:
                    nearest[0, i], nearest[1, i] = t, _ONE
                    bright = lit[0] + lit[1] * (here[0] + t * dx) + lit[2] * (here[1] + t * dy)
                    bright = shade * max(bright, lit[3])
                    colors[0, i], colors[1, i] = bright * paints[color, 0], bright * paints[color, 1]
                    colors[2, i] = bright * paints[color, 2]
    if any_thin:
        fine[:] = 0


@compiled(error_model="numpy")
def _draw_edge(
    rows_of: Float32Array,
    paints: Float32Array,
    near: Int32Array,
    near_count: int,
    rays: Float32Array,
    i: int,
    steps: FloatArray,
    here: Float32Array,
    lit: Float32Array,
    lamp: Float32Array,
    nearest: Float32Array,
    colors: Float32Array,
) -> None:
    """Draw things over a pixel by four rays."""
    ux, uy, uz = np.float32(steps[0, 0]), np.float32(steps[0, 1]), np.float32(steps[0, 2])
    vx, vy, vz = np.float32(steps[1, 0]), np.float32(steps[1, 1]), np.float32(steps[1, 2])
    blue, green, red, left, away = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    for sample in range(4):
        a, b = np.float32(_SAMPLES_U[sample]), np.float32(_SAMPLES_V[sample])
        dx, dy, dz = rays[0, i] + a * ux + b * vx, rays[1, i] + a * uy + b * vy, rays[2, i] + a * uz + b * vz
        met, found, shade = _FAR, np.int32(-1), _ZERO
        for n in range(near_count):
            row = row_of(rows_of, np.uintp(near[n]))
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
