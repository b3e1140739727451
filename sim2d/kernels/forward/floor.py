"""Compiled: the floor in one tile of a forward camera's frame: light, lines, shade of balls, and the carpet's edge.

A pixel's footprint on the floor follows from how its ray changes with u and v; paint is averaged over it.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled
from sim2d.kernels.floor_paint import SHADE_REACH, is_inside, light_beside_ball, overlap
from sim2d.kernels.forward.outlines import EDGE
from sim2d.kernels.forward.values import Tile, View
from sim2d.kernels.things import RADIUS, X0, Y0

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_MIN_DROP = np.float32(1e-6)  # least downward component of a ray that meets the floor


@compiled(error_model="numpy")
def fill_floor(view: View, tile: Tile) -> None:
    """Fill a tile's `tone` with the light on the floor, without colour."""
    rays, eye, light, out = tile.rays, view.here, view.lit, tile.tone
    here = light[0] + light[1] * eye[0] + light[2] * eye[1]
    along_x, along_y, least, height = light[1], light[2], light[3], eye[2]
    dx, dy, dz = rays[0], rays[1], rays[2]
    for i in range(rays.shape[1]):
        scale = height / max(-dz[i], _MIN_DROP)
        out[i] = max(here + scale * (along_x * dx[i] + along_y * dy[i]), least)


@compiled(error_model="numpy")
def cover_line(view: View, number: int, part: tuple[int, int], tile: Tile) -> None:
    """Raise a tile's painted fractions to those of a straight line, which can only meet pixels part[0]:part[1]."""
    line, half_m, eye = view.paint.lines[number], view.paint.half_m, view.here
    rays, steps, covered = tile.rays, tile.steps, tile.covered
    tx, ty, height = np.float32(line[2]), np.float32(line[3]), eye[2]
    x, y = np.float32(line[0]) - eye[0], np.float32(line[1]) - eye[1]
    off_across, off_along = x * ty - y * tx, x * tx + y * ty
    long, half = np.float32(line[4]) * _HALF, np.float32(half_m)
    across_u = height * (np.float32(steps[0, 0]) * ty - np.float32(steps[0, 1]) * tx)
    across_v = height * (np.float32(steps[1, 0]) * ty - np.float32(steps[1, 1]) * tx)
    along_u = height * (np.float32(steps[0, 0]) * tx + np.float32(steps[0, 1]) * ty)
    along_v = height * (np.float32(steps[1, 0]) * tx + np.float32(steps[1, 1]) * ty)
    down_u, down_v = np.float32(steps[0, 2]), np.float32(steps[1, 2])
    start, stop = part
    dx, dy, dz, some = rays[0, start:stop], rays[1, start:stop], rays[2, start:stop], covered[start:stop]
    for i in range(len(some)):
        drop = max(-dz[i], _MIN_DROP)
        per_drop = _ONE / drop
        across = height * per_drop * (dx[i] * ty - dy[i] * tx)
        along = height * per_drop * (dx[i] * tx + dy[i] * ty)
        size_across = per_drop * (abs(across_u + across * down_u) + abs(across_v + across * down_v))
        size_along = per_drop * (abs(along_u + along * down_u) + abs(along_v + along * down_v))
        ratio = overlap(across - off_across, half, size_across)
        ratio *= overlap(along - off_along - long, long + half, size_along)
        some[i] = max(some[i], ratio if dz[i] < -_MIN_DROP else _ZERO)


@compiled(error_model="numpy")
def cover_arc(view: View, number: int, tile: Tile) -> None:
    """Raise a tile's painted fractions to those of an arc."""
    arc, half_m, eye = view.paint.arcs[number], view.paint.half_m, view.here
    rays, steps, covered = tile.rays, tile.steps, tile.covered
    x, y = np.float32(arc[0]) - eye[0], np.float32(arc[1]) - eye[1]
    radius, half = np.float32(arc[2]), np.float32(half_m)
    aim_x, aim_y, sweep, height = np.float32(arc[3]), np.float32(arc[4]), np.float32(arc[5]), eye[2]
    ux, uy, uz = np.float32(steps[0, 0]), np.float32(steps[0, 1]), np.float32(steps[0, 2])
    vx, vy, vz = np.float32(steps[1, 0]), np.float32(steps[1, 1]), np.float32(steps[1, 2])
    dx, dy, dz = rays[0], rays[1], rays[2]
    for i in range(rays.shape[1]):
        scale = height / max(-dz[i], _MIN_DROP)
        floor_x, floor_y = scale * dx[i], scale * dy[i]
        off_x, off_y = floor_x - x, floor_y - y
        away = max(np.float32(math.sqrt(off_x * off_x + off_y * off_y)), np.float32(1e-6))
        nx, ny = off_x / away, off_y / away
        per_drop = scale / height
        toward = nx * floor_x + ny * floor_y
        size = abs(scale * (nx * ux + ny * uy) + toward * per_drop * uz)
        size += abs(scale * (nx * vx + ny * vy) + toward * per_drop * vz)
        part = overlap(away - radius, half, size)
        is_on = dz[i] < -_MIN_DROP and off_x * aim_x + off_y * aim_y >= away * sweep
        covered[i] = max(covered[i], part if is_on else _ZERO)


@compiled(error_model="numpy")
def shade_floor(view: View, number: int, tile: Tile) -> None:
    """Darken the light on a tile's floor around a ball."""
    row, rays, height, tone = view.things[number], tile.rays, view.here[2], tile.tone
    x, y, radius = row[X0], row[Y0], row[RADIUS]
    per_radius2, reach2 = np.float32(1) / (radius * radius), (np.float32(SHADE_REACH) * radius) ** 2
    for i in range(rays.shape[1]):
        if rays[2, i] >= -_MIN_DROP:
            continue
        scale = -height / rays[2, i]
        off_x, off_y = scale * rays[0, i] - x, scale * rays[1, i] - y
        away2 = off_x * off_x + off_y * off_y
        if away2 < reach2:
            tone[i] *= light_beside_ball(away2, per_radius2)


@compiled(error_model="numpy")
def end_carpet(view: View, tile: Tile) -> None:
    """Fill `covered` with each pixel's fraction of carpet, in a tile that edges of the carpet may cross."""
    paint, eye, rays, steps, carpet = view.paint, view.here, tile.rays, tile.steps, tile.covered
    near, near_count = tile.seen[EDGE], tile.seen_count[EDGE]
    if not paint.is_convex:
        _end_any_carpet(view, tile)
        return
    dx, dy, dz = rays[0], rays[1], rays[2]
    for i in range(len(carpet)):
        carpet[i] = _ONE if dz[i] < -_MIN_DROP else _ZERO
    height = eye[2]
    for e in range(near_count):
        edge = paint.edges[near[e]]
        tx, ty = edge[2] - edge[0], edge[3] - edge[1]
        length = math.sqrt(tx * tx + ty * ty)
        t_x, t_y = np.float32(tx / length), np.float32(ty / length)
        off = (np.float32(edge[1]) - eye[1]) * t_x - (np.float32(edge[0]) - eye[0]) * t_y
        by_u = height * (np.float32(steps[0, 1]) * t_x - np.float32(steps[0, 0]) * t_y)
        by_v = height * (np.float32(steps[1, 1]) * t_x - np.float32(steps[1, 0]) * t_y)
        down_u, down_v = np.float32(steps[0, 2]), np.float32(steps[1, 2])
        for i in range(len(carpet)):
            per_drop = _ONE / max(-dz[i], _MIN_DROP)
            # the carpet lies to the left of its edges
            left = height * per_drop * (dy[i] * t_x - dx[i] * t_y)
            size = per_drop * (abs(by_u + left * down_u) + abs(by_v + left * down_v))
            inside = min(max(_HALF + (left - off) / size, _ZERO), _ONE)
            carpet[i] = min(carpet[i], inside)


@compiled(error_model="numpy")
def _end_any_carpet(view: View, tile: Tile) -> None:
    """As `end_carpet`, for a carpet of any shape."""
    edges, eye, rays, steps, carpet = view.paint.edges, view.here, tile.rays, tile.steps, tile.covered
    near, near_count = tile.seen[EDGE], tile.seen_count[EDGE]
    for i in range(len(carpet)):
        drop = -rays[2, i]
        if drop <= _MIN_DROP:
            carpet[i] = _ZERO
            continue
        x, y = eye[2] * rays[0, i] / drop, eye[2] * rays[1, i] / drop
        inside = is_inside(edges, float(x + eye[0]), float(y + eye[1]))
        nearest = _HALF
        for e in range(near_count):
            k = near[e]
            ax, ay = edges[k, 0] - eye[0], edges[k, 1] - eye[1]
            tx, ty = edges[k, 2] - eye[0] - ax, edges[k, 3] - eye[1] - ay
            length = math.sqrt(tx * tx + ty * ty)
            tx, ty = tx / length, ty / length
            along, across = (x - ax) * tx + (y - ay) * ty, (x - ax) * ty - (y - ay) * tx
            size = 0.0
            for axis in range(2):
                flat = eye[2] * (steps[axis, 0] * ty - steps[axis, 1] * tx)
                size += abs(flat + (x * ty - y * tx) * steps[axis, 2]) / drop
            if -size < along < length + size:
                nearest = min(nearest, np.float32(abs(across) / size))
        carpet[i] = _HALF + nearest if inside else _HALF - nearest
