"""Compiled distances to the lines of a field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled

# value of `within2` in `nearest_line` that sets no bound
ANYWHERE2 = 1e30


@compiled
def nearest_line(
    x: float, y: float, lines: FloatArray, arcs: FloatArray, within2: float
) -> tuple[float, float, float, int]:
    """Return distance, unit normal (from the line towards the point) and index of the nearest line or arc.

    If none is closer than the root of `within2`, the distance is that root and the index -1.
    """
    best, foot_x, foot_y, index = within2, 0.0, 0.0, -1
    for i in range(lines.shape[0]):
        x0, y0 = lines[i, 0], lines[i, 1]
        dx, dy = lines[i, 2] - x0, lines[i, 3] - y0
        length2 = dx * dx + dy * dy
        aside = (x - x0) * dy - (y - y0) * dx
        # a line is never closer than its continuation
        if aside * aside >= best * length2 > 0.0:
            continue
        t = ((x - x0) * dx + (y - y0) * dy) / length2 if length2 > 0.0 else 0.0
        t = min(1.0, max(0.0, t))
        fx, fy = x0 + t * dx, y0 + t * dy
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, i
    for j in range(arcs.shape[0]):
        cx, cy, radius, start, sweep = arcs[j, 0], arcs[j, 1], arcs[j, 2], arcs[j, 3], arcs[j, 4]
        away = math.sqrt((x - cx) * (x - cx) + (y - cy) * (y - cy))
        # an arc is never closer than its circle
        if (away - radius) * (away - radius) >= best:
            continue
        if sweep < 0.0:
            start, sweep = start + sweep, -sweep
        angle = math.atan2(y - cy, x - cx)
        if sweep < 2.0 * math.pi:
            past = (angle - start) % (2.0 * math.pi)
            if past > sweep:
                # outside the sweep: the nearer end
                angle = start + sweep if past - sweep < 2.0 * math.pi - past else start
        fx, fy = cx + radius * math.cos(angle), cy + radius * math.sin(angle)
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, lines.shape[0] + j
    distance = math.sqrt(best)
    if index < 0:
        return distance, 0.0, 0.0, index
    if distance > 1e-9:
        return distance, (x - foot_x) / distance, (y - foot_y) / distance, index
    # a point on the line: any unit normal
    if index < lines.shape[0]:
        dx, dy = lines[index, 2] - lines[index, 0], lines[index, 3] - lines[index, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length > 0.0:
            return distance, -dy / length, dx / length, index
        return distance, 1.0, 0.0, index
    j = index - lines.shape[0]
    dx, dy = foot_x - arcs[j, 0], foot_y - arcs[j, 1]
    length = max(1e-12, math.sqrt(dx * dx + dy * dy))
    return distance, dx / length, dy / length, index


@compiled
def nearest_lines(points: FloatArray, lines: FloatArray, arcs: FloatArray) -> tuple[FloatArray, FloatArray, Int64Array]:
    """Find the nearest field line of each point (N, 2).

    Returns distance (N,), unit normal (N, 2) from the line towards the point, and index (N,): lines first, then arcs.
    """
    count = points.shape[0]
    distance, normal, index = np.empty(count), np.empty((count, 2)), np.empty(count, dtype=np.int64)
    for i in range(count):
        distance[i], normal[i, 0], normal[i, 1], index[i] = nearest_line(
            points[i, 0], points[i, 1], lines, arcs, ANYWHERE2
        )
    return distance, normal, index


class DistanceTable(NamedTuple):
    """Table of distances to the nearest line.

    Parameters
    ----------
    values : (H, W) uint8
        Distances in cells, rows along y.
    origin_m : (float, float)
        Middle of the first cell, metres.
    cell_m : float
        Side of a cell.
    far : int
        Value outside the table.
    """

    values: UInt8Array
    origin_m: tuple[float, float]
    cell_m: float
    far: int
