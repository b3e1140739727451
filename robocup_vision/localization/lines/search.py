"""The global search: poses, anywhere on the field and without any prior, that put white line points on its lines.

One point per patch of floor, a distance table, a grid of poses, and the best of them refined by Gauss-Newton with a
loss that narrows: in metres, good enough for `localization.lines` to refine in pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.lines.lines import refine_line_poses, score_pose_grid
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints

# One point per patch of floor, so that a near line does not outvote a far one; patches grow until the points are few.
PATCH_M = 0.12
MAX_SEARCH_POINTS = 150
POINTS_PER_PATCH = 3
# Fewer patches than this show less than about 2 m of line, which fits in many places of any field.
MIN_SEARCH_POINTS = 18
GRID_STEP_M = 0.2
GRID_STEP_RAD = math.radians(5.0)
STARTS = 24
SCALES_M = np.array([0.25, 0.25, 0.2, 0.16, 0.13, 0.1, 0.08, 0.06, 0.06, 0.06])
# Two refined poses closer than this are one mode.
SAME_POSE_M = 0.15
SAME_POSE_RAD = math.radians(4.0)
# A point agrees with a pose within this many pixels of a line.
INLIER_PX = 3.0
# In the search a camera may be off by this much; what is finer is left to the refinement.
SEARCH_NOISE_PX = 2.0


@dataclass(frozen=True, slots=True)
class LineCandidate:
    """One pose that explains the line points.

    Parameters
    ----------
    pose : Pose2
        Robot in the field frame.
    cost : float
        Mean robust loss of the points, lower is better; comparable within one frame.
    inlier_share : float
        Share of the points, one per patch of floor, that lie on a line.
    residual_m : float
        Median distance of those points to their lines, metres.
    """

    pose: Pose2
    cost: float
    inlier_share: float
    residual_m: float


def search_by_lines(points: LinePoints, line_map: LineMap, most: int = 12) -> list[LineCandidate]:
    """Search the whole field for poses that put the line points on the field's lines.

    Parameters
    ----------
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field. On a point-symmetric one only one of each two poses half a turn apart is searched and returned.
    most : int
        At most so many distinct poses.

    Returns
    -------
    list of LineCandidate
        Best first; empty where there are too few points.
    """
    thin = one_per_patch(points, np.hypot(*(line_map.extent_m[1] - line_map.extent_m[0])))
    if len(thin) < MIN_SEARCH_POINTS:
        return []
    floor_m = np.ascontiguousarray(thin.floor_m)
    starts = _best_of_grid(floor_m, line_map)
    noise_m = SEARCH_NOISE_PX * _metres_per_px(thin)
    cost = refine_line_poses(starts, floor_m, noise_m, thin.weight, line_map.lines, line_map.arcs, SCALES_M)
    low, high = line_map.extent_m
    slack = GRID_STEP_M
    kept: list[LineCandidate] = []
    for k in np.argsort(cost, kind="stable"):
        if len(kept) == most:
            break
        x, y, theta = starts[k]
        if not (
            math.isfinite(cost[k]) and low[0] - slack <= x <= high[0] + slack and low[1] - slack <= y <= high[1] + slack
        ):
            continue
        pose = Pose2(float(x), float(y), float(theta))
        if any(same_pose(pose, other.pose, line_map.is_point_symmetric) for other in kept):
            continue
        distance = line_map.nearest(pose.transform(floor_m)).distance_m
        good = distance <= np.maximum(INLIER_PX / SEARCH_NOISE_PX * noise_m, 0.06)
        share = float(thin.weight[good].sum() / thin.weight.sum())
        residual = float(np.median(distance[good])) if good.any() else math.inf
        kept.append(LineCandidate(pose, float(cost[k]), share, residual))
    return kept


def same_pose(pose: Pose2, other: Pose2, symmetric: bool) -> bool:
    """Tell whether two poses are one mode; `symmetric`: modulo a half turn about the field's centre."""
    distance, angle = pose.error_to(other, symmetric=symmetric)
    return distance < SAME_POSE_M and angle < SAME_POSE_RAD


def _metres_per_px(points: LinePoints) -> FloatArray:
    """Of each point, in the image direction in which a pixel covers most floor: what one pixel of error may do."""
    j = points.floor_per_px
    total = (j**2).sum(axis=(1, 2))
    area = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
    return np.asarray(np.sqrt((total + np.sqrt(np.maximum(total**2 - 4 * area**2, 0))) / 2))


def one_per_patch(points: LinePoints, reach_m: float) -> LinePoints:
    """At most `MAX_SEARCH_POINTS` points, one per patch of floor, those seen with floor on both sides first."""
    points = points.take(np.hypot(*points.floor_m.T) <= reach_m)
    order = np.argsort(-points.weight, kind="stable")
    patch_m = PATCH_M
    while True:
        cells = np.floor(points.floor_m[order] / patch_m).astype(np.int64)
        _, first, count = np.unique(cells[:, 0] * 100_003 + cells[:, 1], return_index=True, return_counts=True)
        if len(first) <= MAX_SEARCH_POINTS:
            # a line crosses a patch in several points; a point on its own is more likely a speck
            thin = points.take(order[first])
            return replace(thin, weight=thin.weight * np.minimum(1.0, count / POINTS_PER_PATCH))
        patch_m *= max(1.1, math.sqrt(len(first) / MAX_SEARCH_POINTS) * 0.95)


def _best_of_grid(floor_m: FloatArray, line_map: LineMap) -> FloatArray:
    """Distinct best poses (K, 3) of the grid over the field, K <= STARTS."""
    cell, origin = line_map.cell_m, line_map.table_origin_m
    step = round(GRID_STEP_M / cell)
    low, high = line_map.extent_m
    count_x, count_y = (np.floor((high - low) / (step * cell)).astype(int) + 1).tolist()
    if line_map.is_point_symmetric:  # the half x >= 0 stands for the other
        low = np.array([low[0] + (count_x // 2) * step * cell, low[1]])
        count_x -= count_x // 2
    headings = np.arange(0, math.tau - 1e-9, GRID_STEP_RAD)
    first_x, first_y = np.round(low / cell).astype(int).tolist()
    cost = score_pose_grid(
        floor_m, headings, line_map.table, origin[0], origin[1], cell, first_x, first_y, step, count_x, count_y, 255
    )
    flat = cost.ravel()
    best = np.argpartition(flat, min(600, flat.size - 1))[:600]
    best = best[np.argsort(flat[best], kind="stable")]
    k, iy, ix = np.unravel_index(best, cost.shape)
    poses = np.stack([(first_x + ix * step) * cell, (first_y + iy * step) * cell, headings[k]], axis=1)
    kept: list[FloatArray] = []
    for pose in poses:
        if len(kept) == STARTS:
            break
        if not any(
            math.hypot(pose[0] - o[0], pose[1] - o[1]) < 1.6 * GRID_STEP_M
            and abs(wrap_angle(pose[2] - o[2])) < 1.6 * GRID_STEP_RAD
            for o in kept
        ):
            kept.append(pose)
    return np.array(kept)
