"""A robot's pose from white line points: searched over the whole field without any prior, or refined from a guess.

Search: one point per patch of floor, a distance table, a grid of poses, the best of them refined by Gauss-Newton with a
loss that narrows. Refinement: residuals in PIXELS across the line, because what errs is the image, and an error of one
pixel is a centimetre beside the robot and half a metre at the horizon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, wrap_angle
from robocup_vision.localization.line_map import LineMap
from robocup_vision.perception.kernels import refine_line_poses, score_pose_grid
from robocup_vision.perception.line_points import FloorCamera, FloorTone, LineFinder, LinePoints

# One point per patch of floor, so that a near line does not outvote a far one; patches grow until the points are few.
PATCH_M = 0.12
MOST_SEARCH_POINTS = 150
# Fewer patches than this show less than about 2 m of line, which fits in many places of any field.
LEAST_SEARCH_POINTS = 18
GRID_STEP_M = 0.2
GRID_STEP_RAD = math.radians(5.0)
STARTS = 24
SCALES_M = np.array([0.25, 0.25, 0.2, 0.16, 0.13, 0.1, 0.08, 0.06, 0.06, 0.06])
# Two refined poses closer than this are one mode.
SAME_POSE_M = 0.15
SAME_POSE_RAD = math.radians(4.0)
# A point agrees with a pose within this many pixels of a line.
INLIER_PX = 3.0
LEAST_INLIER_SHARE = 0.5
# The runner-up must leave at least this much more unexplained.
LEAST_RIVAL_RATIO = 1.35
# A calibrated camera's own error: no covariance claims to know more than this many pixels, however many points agree.
MODEL_ERROR_PX = 0.3
# Neighbours along a line share the errors of lens, carpet and paint over about this length of floor.
CORRELATION_M = 0.5
LARGEST_STD_M = 0.25
LARGEST_STD_RAD = math.radians(8.0)


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


def search_by_lines(points: LinePoints, line_map: LineMap, most: int = 6) -> list[LineCandidate]:
    """Search the whole field for poses that put the line points on the field's lines.

    Parameters
    ----------
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field. On a point-symmetric one only one of each pair of poses half a turn apart is searched and returned.
    most : int
        At most so many distinct poses.

    Returns
    -------
    list of LineCandidate
        Best first; empty where there are too few points.
    """
    thin = _one_per_patch(points, np.hypot(*(line_map.extent_m[1] - line_map.extent_m[0])))
    if len(thin) < LEAST_SEARCH_POINTS:
        return []
    floor_m = np.ascontiguousarray(thin.floor_m)
    starts = _best_of_grid(floor_m, line_map)
    noise_m = _metres_per_px(thin)
    cost = refine_line_poses(starts, floor_m, noise_m, thin.weight, line_map.lines, line_map.arcs, SCALES_M)
    low, high = line_map.extent_m
    slack = GRID_STEP_M
    kept: list[LineCandidate] = []
    for k in np.argsort(cost, kind="stable"):
        if len(kept) == most:
            break
        x, y, theta = starts[k]
        if not (math.isfinite(cost[k]) and low[0] - slack <= x <= high[0] + slack and low[1] - slack <= y <= high[1] + slack):
            continue
        pose = Pose2(float(x), float(y), float(theta))
        if any(_same(pose, other.pose, line_map.is_point_symmetric) for other in kept):
            continue
        distance = line_map.nearest(pose.transform(floor_m)).distance_m
        good = distance <= np.maximum(INLIER_PX * noise_m, 0.06)
        share = float(thin.weight[good].sum() / thin.weight.sum())
        residual = float(np.median(distance[good])) if good.any() else math.inf
        kept.append(LineCandidate(pose, float(cost[k]), share, residual))
    return kept


def refine_by_lines(
    pose: Pose2,
    points: LinePoints,
    line_map: LineMap,
    prior_covariance: FloatArray | None = None,
    *,
    start_px: float = 8.0,
) -> PoseEstimate | NotLocated:
    """Refine a pose by line points, with residuals in pixels across the lines.

    Parameters
    ----------
    pose : Pose2
        Where to start.
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field.
    prior_covariance : (3, 3) float64, optional
        How well `pose` is known beforehand; it then counts as a measurement of its own.
    start_px : float
        Residuals well beyond this are ignored from the first step on.
    """
    low, high = line_map.extent_m
    points = points.take(np.hypot(*points.floor_m.T) <= np.hypot(*(high - low)))
    if len(points) < LEAST_SEARCH_POINTS:
        return NotLocated(f"only {len(points)} line points")
    information = np.zeros((3, 3)) if prior_covariance is None else np.linalg.inv(prior_covariance)
    start = pose.array
    estimate = start.copy()
    scale = start_px
    for _ in range(15):
        residual, jacobian, _ = _pixel_residuals(estimate, points, line_map)
        weight = points.weight / (1 + (residual / scale) ** 2) ** 2
        sigma2 = max(_spread_px(residual, points.weight, scale), MODEL_ERROR_PX) ** 2
        offset = estimate - start
        offset[2] = wrap_angle(offset[2])
        hessian = (jacobian.T * weight) @ jacobian / sigma2 + information
        gradient = jacobian.T @ (weight * residual) / sigma2 + information @ offset
        try:
            step = np.linalg.solve(hessian + 1e-9 * np.trace(hessian) * np.eye(3), -gradient)
        except np.linalg.LinAlgError:
            return NotLocated("the lines in view do not fix the pose")
        estimate += step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        narrow = max(3 * math.sqrt(sigma2), 1.0)
        if scale <= narrow and float(np.abs(step).max()) < 1e-5:
            break
        scale = max(0.6 * scale, narrow) if scale > narrow else narrow
    return _estimate(estimate, points, line_map, information, scale)


class LineLocalizer:
    """Finds a robot's pose from the white lines one camera sees.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : FloorCamera
        What takes the frames.
    mask : (H, W) array, optional
        Non-zero pixels are never looked at.
    """

    def __init__(self, field: Field, camera: FloorCamera, mask: npt.NDArray[np.generic] | None = None) -> None:
        self.line_map = LineMap(field)
        self.finder = LineFinder(camera, field.line_width_m, mask)

    def locate(
        self,
        frame: npt.NDArray[np.uint8] | LinePoints,
        prior: PoseEstimate | None = None,
        tone: FloorTone | None = None,
    ) -> PoseEstimate | NotLocated:
        """Find the pose.

        Parameters
        ----------
        frame : (H, W, 3) uint8, or LinePoints
            BGR image, or the line points already found in it.
        prior : PoseEstimate, optional
            What is believed beforehand. Refined if the lines bear it out, otherwise the whole field is searched; it also
            says which of two symmetric halves comes first.
        tone : FloorTone, optional
            The floor's colour; learnt from the frame where absent.

        Returns
        -------
        PoseEstimate or NotLocated
            On a field whose lines are point-symmetric both candidates half a turn apart, `pose` first.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame, tone)
        if prior is not None:
            near = refine_by_lines(prior.pose, points, self.line_map, prior.covariance)
            if near and near.inlier_share >= max(0.8, LEAST_INLIER_SHARE) and _consistent(near.pose, prior):
                return self._with_candidates(near, prior)
        found = search_by_lines(points, self.line_map)
        if not found:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        best = found[0]
        if best.inlier_share < LEAST_INLIER_SHARE:
            return NotLocated(f"only {best.inlier_share:.0%} of the line points lie on lines of the best pose")
        if len(found) > 1 and found[1].cost < LEAST_RIVAL_RATIO * best.cost:
            other = found[1].pose
            return NotLocated(
                f"the lines fit two poses about equally well: ({best.pose.x_m:.2f}, {best.pose.y_m:.2f}) "
                f"and ({other.x_m:.2f}, {other.y_m:.2f})"
            )
        refined = refine_by_lines(best.pose, points, self.line_map)
        if not refined:
            return refined
        if refined.inlier_share < LEAST_INLIER_SHARE:
            return NotLocated(f"only {refined.inlier_share:.0%} of the line points lie on lines of the best pose")
        if not _same(refined.pose, best.pose, False):
            return NotLocated("the refinement left the pose that the search found")
        if max(refined.std[:2]) > LARGEST_STD_M or refined.std[2] > LARGEST_STD_RAD:
            return NotLocated("the lines in view do not fix the pose")
        return self._with_candidates(refined, prior)

    def _with_candidates(self, estimate: PoseEstimate, prior: PoseEstimate | None) -> PoseEstimate:
        if not self.line_map.is_point_symmetric:
            return estimate
        turned = estimate.half_turn()
        if prior is not None and _apart(turned.pose, prior.pose) < _apart(estimate.pose, prior.pose):
            estimate, turned = turned, estimate
        return PoseEstimate(
            estimate.pose,
            estimate.covariance,
            estimate.inlier_share,
            estimate.residual_px,
            (estimate.pose, turned.pose),
        )


def _apart(pose: Pose2, other: Pose2) -> float:
    distance, angle = pose.error_to(other)
    return distance + angle


def _same(pose: Pose2, other: Pose2, symmetric: bool) -> bool:
    distance, angle = pose.error_to(other, symmetric=symmetric)
    return distance < SAME_POSE_M and angle < SAME_POSE_RAD


def _consistent(pose: Pose2, prior: PoseEstimate) -> bool:
    offset = pose.array - prior.pose.array
    offset[2] = wrap_angle(offset[2])
    # 3 degrees of freedom, 99.9 %
    return float(offset @ np.linalg.solve(prior.covariance, offset)) < 16.3


def _metres_per_px(points: LinePoints) -> FloatArray:
    """Of each point, in the image direction in which a pixel covers most floor: what one pixel of error may do."""
    j = points.floor_per_px
    total = (j**2).sum(axis=(1, 2))
    area = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
    return np.sqrt((total + np.sqrt(np.maximum(total**2 - 4 * area**2, 0))) / 2)


def _one_per_patch(points: LinePoints, reach_m: float) -> LinePoints:
    """At most `MOST_SEARCH_POINTS` points, one per patch of floor, those seen with floor on both sides first."""
    points = points.take(np.hypot(*points.floor_m.T) <= reach_m)
    order = np.argsort(-points.weight, kind="stable")
    patch_m = PATCH_M
    while True:
        cells = np.floor(points.floor_m[order] / patch_m).astype(np.int64)
        _, first = np.unique(cells[:, 0] * 100_003 + cells[:, 1], return_index=True)
        if len(first) <= MOST_SEARCH_POINTS:
            return points.take(order[np.sort(first)])
        patch_m *= max(1.1, math.sqrt(len(first) / MOST_SEARCH_POINTS) * 0.95)


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


def _pixel_residuals(
    pose: FloatArray, points: LinePoints, line_map: LineMap
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Distances in px (N,) to the nearest lines, their derivative (N, 3) by x, y, theta, and which line (N,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turned = points.floor_m @ np.array([[c, s], [-s, c]])
    near = line_map.nearest(turned + pose[:2])
    normal_in_robot = near.normal @ np.array([[c, -s], [s, c]])
    per_px = np.linalg.norm(np.einsum("ni,nij->nj", normal_in_robot, points.floor_per_px), axis=1)
    by_theta = near.normal[:, 1] * turned[:, 0] - near.normal[:, 0] * turned[:, 1]
    jacobian = np.column_stack([near.normal, by_theta]) / per_px[:, None]
    return near.distance_m / per_px, jacobian, near.index


def _spread_px(residual: FloatArray, weight: FloatArray, within: float) -> float:
    """Robust standard deviation of unsigned residuals, from those within a bound."""
    good = residual <= 2 * within
    return 1.48 * float(np.median(residual[good])) if good.any() else within


def _estimate(
    pose: FloatArray, points: LinePoints, line_map: LineMap, information: FloatArray, scale: float
) -> PoseEstimate | NotLocated:
    residual, jacobian, index = _pixel_residuals(pose, points, line_map)
    weight = points.weight / (1 + (residual / scale) ** 2) ** 2
    good = residual <= INLIER_PX
    if np.count_nonzero(good) < LEAST_SEARCH_POINTS:
        return NotLocated("too few line points lie on lines")
    sigma2 = max(_spread_px(residual, points.weight, scale), MODEL_ERROR_PX) ** 2
    fisher = (jacobian.T * weight) @ jacobian / sigma2
    # one group per line and stretch of floor: what errs there errs together
    patch = np.floor(points.floor_m / CORRELATION_M).astype(np.int64)
    keys = (index * 4001 + patch[:, 0]) * 4001 + patch[:, 1]
    groups, member = np.unique(keys, return_inverse=True)
    scores = np.zeros((len(groups), 3))
    np.add.at(scores, member.ravel(), jacobian * (weight * residual / sigma2)[:, None])
    # a shared model error of so many pixels over a whole stretch cannot be averaged away within it
    pulls = np.zeros((len(groups), 3))
    np.add.at(pulls, member.ravel(), jacobian * (weight / sigma2)[:, None])
    meat = scores.T @ scores * (len(groups) / max(len(groups) - 3, 1)) + MODEL_ERROR_PX**2 * pulls.T @ pulls + fisher
    try:
        bread = np.linalg.inv(fisher + information)
    except np.linalg.LinAlgError:
        return NotLocated("the lines in view do not fix the pose")
    covariance = bread @ (meat + information) @ bread
    if not (np.isfinite(covariance).all() and np.isfinite(pose).all() and (np.diag(covariance) > 0).all()):
        return NotLocated("the lines in view do not fix the pose")
    return PoseEstimate(
        Pose2(*pose.tolist()),
        (covariance + covariance.T) / 2,
        float(points.weight[good].sum() / points.weight.sum()),
        float(np.sqrt(np.mean(residual[good] ** 2))),
    )
