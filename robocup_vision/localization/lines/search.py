"""Global search for poses that put white line points on the field's lines, without a prior.

One point for each patch of floor, a table of distances and a grid of poses give starts, which Gauss-Newton refines with
a loss of decreasing scale, in metres. `localization.lines` refines the results in pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.lines.lines import PoseGrid, refine_line_poses, score_pose_grid
from robocup_vision.localization.distinct import Apart
from robocup_vision.localization.lines.line_map import CELL_M, LineMap
from robocup_vision.perception.line_points import LinePoints

# one point is used for each patch of floor, so that near lines do not dominate; patches grow until at most this
# number of points is left
PATCH_M = 0.12
_MAX_POINTS = 150
# number of points in a patch from which it has full weight, because fewer may be specks
POINTS_PER_PATCH = 3
# side of a window; a line crosses it in as many points, and a point with fewer than half of them in it is a speck
_WINDOW_PX = 9
MIN_POINTS = 18  # least number of patches: fewer show less than about 2 m of line, which fit in many places
# steps of the grid of poses
_GRID_STEP_M = 0.2
_GRID_STEP_RAD = math.radians(5.0)
_MAX_STARTS = 24  # greatest number of the grid's poses that are refined
# scale of the loss in each step
_SCALES_M = (0.25, 0.25, 0.2, 0.16, 0.13, 0.1, 0.08, 0.06, 0.06, 0.06)
APART = Apart(0.15, math.radians(4.0))  # least distance of two modes
NOISE_PX = 2.0  # noise in the search, including errors of the camera's calibration


@dataclass(frozen=True, slots=True)
class LineCandidate:
    """A pose that explains the line points."""

    pose: Pose2  #: robot in the field frame
    cost: float  #: mean robust loss of the points, comparable within one frame


def search_by_lines(
    points: LinePoints,
    line_map: LineMap,
    max_candidates: int = 12,
) -> list[LineCandidate]:
    """Search the whole field for poses that put the line points on the field's lines, best first.

    On a point-symmetric field one of two poses half a turn apart is returned. Empty if there are too few points.
    """
    thin = thinned(line_map.within_reach(points))
    if len(thin) < MIN_POINTS:
        return []
    floor_m = np.ascontiguousarray(thin.floor_m)
    starts = _best_of_grid(floor_m, line_map)
    noise_m = NOISE_PX * _metres_per_px(thin)
    cost = refine_line_poses(starts, floor_m, noise_m, thin.weight, line_map.lines, line_map.arcs, np.array(_SCALES_M))
    low, high = line_map.extent_m
    slack = _GRID_STEP_M
    is_near_field = ((starts[:, :2] >= low - slack) & (starts[:, :2] <= high + slack)).all(axis=1)
    order = np.argsort(cost, kind="stable")
    order = order[(np.isfinite(cost) & is_near_field)[order]]
    apart = replace(APART, twins=line_map.is_point_symmetric)
    kept = order[apart.first(starts[order], max_candidates)]
    return [LineCandidate(Pose2(*starts[k].tolist()), float(cost[k])) for k in kept]


def _metres_per_px(points: LinePoints) -> FloatArray:
    """Return the greatest error on the floor for one pixel in the image, for each point, metres."""
    total = (points.floor_per_px**2).sum(axis=(1, 2))
    return np.asarray(np.sqrt((total + np.sqrt(np.maximum(total**2 - 4 * points.floor_per_px2**2, 0))) / 2))


def has_continuation(pixels: FloatArray) -> BoolArray:
    """Return (N,) bool: which line points (N, 2), px, continue like a line; specks have few neighbours."""
    if not len(pixels):
        return np.zeros(0, dtype=np.bool_)
    u, v = (np.rint(pixels - pixels.min(axis=0)).astype(np.int64)).T
    window = _WINDOW_PX
    spots = np.zeros((int(v.max()) + 1, int(u.max()) + 1), dtype=np.uint8)
    spots[v, u] = 1
    neighbours = cv2.boxFilter(spots, cv2.CV_16S, (window, window), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(2 * neighbours[v, u] > window)


def thinned(points: LinePoints) -> LinePoints:
    """Return one point for each patch of floor, without specks unless too few points would be left."""
    thin = _one_per_patch(points.take(has_continuation(points.pixels)))
    return thin if len(thin) >= MIN_POINTS else _one_per_patch(points)


def _one_per_patch(points: LinePoints) -> LinePoints:
    """Return one point for each patch of floor, preferably with floor on both sides."""
    order = np.argsort(-points.weight, kind="stable")
    _, first, count = patches(points.floor_m[order])
    # a line crosses a patch in several points; a single point is more likely a speck
    thin = points.take(order[first])
    return replace(thin, weight=thin.weight * np.minimum(1.0, count / POINTS_PER_PATCH))


class Patches(NamedTuple):
    """Squares of floor, and which of N points are in each."""

    member: Int64Array  #: (N,) int64: patch of each point
    first: Int64Array  #: (P,) int64: first point of each patch
    points: Int64Array  #: (P,) int64: number of points in each patch


def patches(floor_m: FloatArray) -> Patches:
    """Return the patches of points (N, 2) on the floor."""
    patch_m = PATCH_M
    while True:
        cells = np.floor(floor_m / patch_m).astype(np.int64)
        index = cells[:, 0] * 100_003 + cells[:, 1]
        _, first, member, count = np.unique(index, return_index=True, return_inverse=True, return_counts=True)
        if len(count) <= _MAX_POINTS:
            return Patches(member.ravel(), first, count)
        patch_m *= max(1.1, math.sqrt(len(count) / _MAX_POINTS) * 0.95)


def _best_of_grid(floor_m: FloatArray, line_map: LineMap) -> FloatArray:
    """Return distinct best poses (K, 3) of the grid over the field, K <= `_MAX_STARTS`."""
    cell = CELL_M
    step = round(_GRID_STEP_M / cell)
    low, high = line_map.extent_m
    count_x, count_y = (np.floor((high - low) / (step * cell)).astype(int) + 1).tolist()
    if line_map.is_point_symmetric:  # the half x >= 0 stands for the other
        low = np.array([low[0] + (count_x // 2) * step * cell, low[1]])
        count_x -= count_x // 2
    headings = np.arange(0, math.tau - 1e-9, _GRID_STEP_RAD)
    first_x, first_y = np.round(low / cell).astype(int).tolist()
    grid = PoseGrid(headings, (first_x, first_y), step, (count_x, count_y))
    cost = score_pose_grid(floor_m, line_map.distances, grid)
    flat = cost.ravel()
    best = np.argpartition(flat, min(600, flat.size - 1))[:600]
    best = best[np.argsort(flat[best], kind="stable")]
    k, iy, ix = np.unravel_index(best, cost.shape)
    poses = np.stack([(first_x + ix * step) * cell, (first_y + iy * step) * cell, headings[k]], axis=1)
    apart = Apart(1.6 * _GRID_STEP_M, 1.6 * _GRID_STEP_RAD)
    return np.asarray(poses[apart.first(poses, _MAX_STARTS)])
