"""Compiled look-up of a map's views in a camera's frustum, over the columns of a floor plan."""

from __future__ import annotations

import math

from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array


@njit(cache=True, nogil=True)
def views_in_frustum(
    pose: FloatArray,
    turn: FloatArray,
    viewpoint: FloatArray,
    focal: FloatArray,
    center: FloatArray,
    size: FloatArray,
    reach_m: float,
    view_reach_rad: float,
    positions: FloatArray,
    bearings: FloatArray,
    starts: Int64Array,
    columns: tuple[int, int],
    corner: FloatArray,
    cell_m: float,
    found: Int64Array,
    pixels: FloatArray,
    depth: FloatArray,
) -> int:
    """Write which entries are in view and were seen from about this side; return how many.

    Parameters
    ----------
    pose, turn, viewpoint, focal, center
        As in `landmark_fit.linearise`.
    size : (2,) float64
        Width and height of the image, pixels.
    reach_m : float
        Farthest distance looked up.
    view_reach_rad : float
        Most between an entry's bearing and the line of sight.
    positions, bearings : (E, 3), (E,) float64
        Of the entries, sorted by column: place, and line of sight it was seen along.
    starts : (C + 1,) int64
        First entry of each column of the floor plan, rows of y one after another.
    columns : (int, int)
        Number along x and along y.
    corner : (2,) float64
        Of the floor plan.
    cell_m : float
        Side of a column.
    found, pixels, depth : (E,), (E, 2), (E,)
        Written.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ex = pose[0] + c * viewpoint[0] - s * viewpoint[1]
    ey = pose[1] + s * viewpoint[0] + c * viewpoint[1]
    # the optical axis on the floor
    ax, ay = c * turn[0, 0] - s * turn[0, 1], s * turn[0, 0] + c * turn[0, 1]
    level = math.sqrt(ax * ax + ay * ay)
    half = math.atan(math.hypot(size[0], size[1]) / min(focal[0], focal[1]))
    count = 0
    low_i = max(int((ex - reach_m - corner[0]) / cell_m), 0)
    high_i = min(int((ex + reach_m - corner[0]) / cell_m), columns[0] - 1)
    low_j = max(int((ey - reach_m - corner[1]) / cell_m), 0)
    high_j = min(int((ey + reach_m - corner[1]) / cell_m), columns[1] - 1)
    for j in range(low_j, high_j + 1):
        for i in range(low_i, high_i + 1):
            first, last = starts[j * columns[0] + i], starts[j * columns[0] + i + 1]
            if first == last:
                continue
            mx, my = corner[0] + (i + 0.5) * cell_m - ex, corner[1] + (j + 0.5) * cell_m - ey
            away = math.sqrt(mx * mx + my * my)
            if away > reach_m + cell_m:
                continue
            # a level camera sees nothing behind itself; one that looks steeply up or down may
            if level > 0.8 and away > 2 * cell_m:
                aside = math.acos(min(max((ax * mx + ay * my) / (level * away), -1.0), 1.0))
                if aside > half + math.asin(min(cell_m / away, 1.0)):
                    continue
            for n in range(first, last):
                wx, wy, wz = positions[n, 0] - pose[0], positions[n, 1] - pose[1], positions[n, 2]
                rx, ry, rz = c * wx + s * wy - viewpoint[0], c * wy - s * wx - viewpoint[1], wz - viewpoint[2]
                x = turn[0, 0] * rx + turn[0, 1] * ry + turn[0, 2] * rz
                if x < 0.1 or x > reach_m:
                    continue
                y = turn[1, 0] * rx + turn[1, 1] * ry + turn[1, 2] * rz
                u = center[0] - focal[0] * y / x
                if u < 0 or u > size[0] - 1:
                    continue
                z = turn[2, 0] * rx + turn[2, 1] * ry + turn[2, 2] * rz
                v = center[1] - focal[1] * z / x
                if v < 0 or v > size[1] - 1:
                    continue
                off = math.atan2(positions[n, 1] - ey, positions[n, 0] - ex) - bearings[n]
                off = math.fabs(off - 2 * math.pi * math.floor(off / (2 * math.pi) + 0.5))
                if off > view_reach_rad:
                    continue
                found[count] = n
                pixels[count, 0], pixels[count, 1] = u, v
                depth[count] = x
                count += 1
    return count
