"""Compiled look-up of a map's views inside a camera's frustum, by the cells of a floor plan."""

from __future__ import annotations

import math
from typing import NamedTuple

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import PinholeView, ideal_pixel, point_in_camera


class FloorPlan(NamedTuple):
    """Views of landmarks, sorted by the cell of a floor plan in which they are.

    positions_m, bearings_rad : (E, 3), (E,) float64, each view's landmark, and the line of sight to it.
    starts : (C + 1,) int64, first view of each cell, in rows of y.
    columns : number of cells along x and along y.
    corner_m, cell_m : (2,) float64 corner of the floor plan, and side of a cell.
    """

    positions_m: FloatArray
    bearings_rad: FloatArray
    starts: Int64Array
    columns: tuple[int, int]
    corner_m: FloatArray
    cell_m: float


class InView(NamedTuple):
    """Views found by `views_in_frustum`: index (E,), pixel (E, 2) and depth (E,)."""

    number: Int64Array
    pixels: FloatArray
    depth_m: FloatArray


@compiled
def views_in_frustum(
    view: PinholeView,
    size_px: tuple[int, int],
    pose: FloatArray,
    plan: FloorPlan,
    reach_m: float,
    view_reach_rad: float,
    out: InView,
) -> int:
    """Write the views that are in the image and were seen from a similar direction; return their number.

    size_px : width and height of the image.
    pose : (3,) x, y, theta of the robot.
    reach_m : greatest distance.
    view_reach_rad : largest angle between a view's bearing and the line of sight.
    """
    turn, viewpoint, corner, cell_m = view.robot_to_camera, view.viewpoint_m, plan.corner_m, plan.cell_m
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ex = pose[0] + c * viewpoint[0] - s * viewpoint[1]
    ey = pose[1] + s * viewpoint[0] + c * viewpoint[1]
    # projection of the optical axis onto the floor
    ax, ay = c * turn[0, 0] - s * turn[0, 1], s * turn[0, 0] + c * turn[0, 1]
    level = math.sqrt(ax * ax + ay * ay)
    half = math.atan(math.hypot(size_px[0], size_px[1]) / min(view.focal_px[0], view.focal_px[1]))
    count = 0
    low_i = max(int((ex - reach_m - corner[0]) / cell_m), 0)
    high_i = min(int((ex + reach_m - corner[0]) / cell_m), plan.columns[0] - 1)
    low_j = max(int((ey - reach_m - corner[1]) / cell_m), 0)
    high_j = min(int((ey + reach_m - corner[1]) / cell_m), plan.columns[1] - 1)
    for j in range(low_j, high_j + 1):
        for i in range(low_i, high_i + 1):
            first, last = plan.starts[j * plan.columns[0] + i], plan.starts[j * plan.columns[0] + i + 1]
            if first == last:
                continue
            mx, my = corner[0] + (i + 0.5) * cell_m - ex, corner[1] + (j + 0.5) * cell_m - ey
            away = math.sqrt(mx * mx + my * my)
            if away > reach_m + cell_m:
                continue
            # only a camera that looks steeply up or down may see something behind itself
            if level > 0.8 and away > 2 * cell_m:
                aside = math.acos(min(max((ax * mx + ay * my) / (level * away), -1.0), 1.0))
                if aside > half + math.asin(min(cell_m / away, 1.0)):
                    continue
            for n in range(first, last):
                wx, wy, wz = plan.positions_m[n, 0], plan.positions_m[n, 1], plan.positions_m[n, 2]
                x, y, z = point_in_camera(view, c, s, wx - pose[0], wy - pose[1], wz)
                if x < 0.1 or x > reach_m:
                    continue
                u, v = ideal_pixel(view.focal_px[0], view.focal_px[1], view.center_px[0], view.center_px[1], x, y, z)
                if u < 0 or u > size_px[0] - 1 or v < 0 or v > size_px[1] - 1:
                    continue
                off = math.atan2(wy - ey, wx - ex) - plan.bearings_rad[n]
                off = math.fabs(off - 2 * math.pi * math.floor(off / (2 * math.pi) + 0.5))
                if off > view_reach_rad:
                    continue
                out.number[count] = n
                out.pixels[count, 0], out.pixels[count, 1] = u, v
                out.depth_m[count] = x
                count += 1
    return count
