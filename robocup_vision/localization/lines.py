"""A robot's pose from white line points: searched over the whole field without any prior, or refined from a guess.

Residuals are in PIXELS across the line, because what errs is the image, and an error of one pixel is a centimetre
beside the robot and half a metre at the horizon.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, wrap_angle
from robocup_vision.localization.line_map import LineMap
from robocup_vision.localization.line_search import (
    INLIER_PX,
    LEAST_SEARCH_POINTS,
    PATCH_M,
    SEARCH_NOISE_PX,
    LineCandidate,
    one_per_patch,
    same_pose,
    search_by_lines,
)
from robocup_vision.perception.line_points import FloorCamera, FloorTone, LineFinder, LinePoints

LEAST_INLIER_SHARE = 0.6
# The runner-up's loss must exceed the best one's by this factor, and by this much where both are next to nothing.
RIVAL_RATIO, RIVAL_EXCESS = 1.35, 0.15
# Of poses that other evidence leaves, the lines take one whose points lie this many times nearer to them.
CLEARLY = 2.0
# Of the lines that a pose predicts on floor in plain sight, this share must have been seen.
LEAST_SUPPORT = 0.75
# No single point is better than this, however smooth the picture.
LEAST_NOISE_PX = 0.1
# A wrong centre or tilt shifts whole stretches of line together. The pose takes up most of such a shift, the residuals
# keep the rest: the shift is taken to be this many times what the stretches are off by on average.
HIDDEN_SHIFT = 2.0
# Neighbours along a line share the errors of lens, carpet and paint over about this length of floor.
CORRELATION_M = 0.5
LARGEST_STD_M = 0.25
LARGEST_STD_RAD = math.radians(8.0)


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
    information = np.zeros((3, 3)) if prior_covariance is None else np.asarray(np.linalg.inv(prior_covariance))
    start = pose.array
    estimate = start.copy()
    scale = start_px
    for _ in range(15):
        residual, jacobian, _, _ = _pixel_residuals(estimate, points, line_map)
        weight = points.weight / (1 + (residual / scale) ** 2) ** 2
        sigma2 = max(_spread_px(residual, scale), LEAST_NOISE_PX) ** 2
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
        self._model_points_m = field.line_points(PATCH_M)

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
            What is believed beforehand. Refined if the lines bear it out, otherwise the whole field is searched; it
            also says which of two symmetric halves comes first.
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
        start = self._choose(found, points)
        if isinstance(start, NotLocated):
            return start
        refined = refine_by_lines(start, points, self.line_map)
        if not refined:
            return refined
        if refined.inlier_share < LEAST_INLIER_SHARE:
            return NotLocated(f"only {refined.inlier_share:.0%} of the line points lie on lines of the best pose")
        support = self._support(refined.pose, points)
        if support < LEAST_SUPPORT:
            return NotLocated(f"only {support:.0%} of the lines that should be in plain sight were seen")
        if max(refined.std[:2]) > LARGEST_STD_M or refined.std[2] > LARGEST_STD_RAD:
            return NotLocated("the lines in view do not fix the pose")
        return self._with_candidates(refined, prior)

    def choose(self, frame: npt.NDArray[np.uint8], poses: list[Pose2]) -> int | None:
        """Tell which of several poses the lines in a frame (H, W, 3) uint8 bear out; None if they do not say.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        poses : list of Pose2
            The poses in question.

        Returns
        -------
        int or None
            Index of the pose whose lines run best through the line points, if it is clearly better than the first.
        """
        points = self.finder.find(frame)
        if len(points) < LEAST_SEARCH_POINTS:
            return None
        loss = [float(self.line_map.rough_distance_m(pose.transform(points.floor_m)).mean()) for pose in poses]
        best = int(np.argmin(loss))
        return best if CLEARLY * loss[best] < loss[0] else None

    def _choose(self, found: list[LineCandidate], points: LinePoints) -> Pose2 | NotLocated:
        """Refine the candidates that the search cannot tell apart in pixels, and take the best if it stands alone."""
        doubtful = [c.pose for c in found if c.cost <= RIVAL_RATIO * found[0].cost + RIVAL_EXCESS]
        if len(doubtful) == 1:
            return doubtful[0]
        if len(doubtful) == len(found):
            # where even the last of the list fits, poses that are not on it may fit as well
            return NotLocated("the lines in view fit many poses about equally well")
        thin = one_per_patch(points, math.inf)
        answers = [refine_by_lines(pose, thin, self.line_map) for pose in doubtful]
        poses = [answer.pose if answer else pose for answer, pose in zip(answers, doubtful, strict=True)]
        ranked = sorted((self._pixel_loss(pose, thin), i) for i, pose in enumerate(poses))
        ranked = [(loss, i) for loss, i in ranked if self._support(poses[i], points) >= LEAST_SUPPORT]
        if not ranked:
            return NotLocated("most of the lines that should be in plain sight were not seen")
        best = poses[ranked[0][1]]
        for loss, i in ranked[1:]:
            other = poses[i]
            if loss < RIVAL_RATIO * ranked[0][0] + RIVAL_EXCESS and not same_pose(
                other, best, self.line_map.is_point_symmetric
            ):
                return NotLocated(
                    f"the lines fit two poses about equally well: ({best.x_m:.2f}, {best.y_m:.2f}) "
                    f"and ({other.x_m:.2f}, {other.y_m:.2f})"
                )
        return best

    def _support(self, pose: Pose2, points: LinePoints) -> float:
        """Share of the predicted line points that were seen, of all that were seen or are bare floor instead."""
        if points.bare_floor is None:
            return 1.0
        height, width = points.bare_floor.shape
        spots = np.zeros((height, width), dtype=np.uint8)
        u, v = np.rint(points.pixels).astype(int).T
        spots[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] = 1
        seen = cv2.dilate(spots, np.ones((9, 9), dtype=np.uint8))
        pixels = self.finder.camera.floor_to_pixel(pose.inverse().transform(self._model_points_m))
        pixels = np.rint(pixels[np.isfinite(pixels).all(axis=1)])
        u, v = pixels[((pixels >= 0) & (pixels < (width, height))).all(axis=1)].astype(int).T
        agreed = seen[v, u] > 0
        missed = points.bare_floor[v, u] & ~agreed
        spoken = int(agreed.sum() + missed.sum())
        return int(agreed.sum()) / spoken if spoken else 1.0

    def _pixel_loss(self, pose: Pose2, points: LinePoints) -> float:
        residual = _pixel_residuals(pose.array, points, self.line_map)[0]
        return float(np.average(np.log1p((residual / SEARCH_NOISE_PX) ** 2), weights=points.weight))

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


def _consistent(pose: Pose2, prior: PoseEstimate) -> bool:
    offset = pose.array - prior.pose.array
    offset[2] = wrap_angle(offset[2])
    # 3 degrees of freedom, 99.9 %
    return float(offset @ np.linalg.solve(prior.covariance, offset)) < 16.3


def _pixel_residuals(
    pose: FloatArray, points: LinePoints, line_map: LineMap
) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """Measure line points against the field's lines in the image.

    Returns
    -------
    residual : (N,) float64
        Distances from the nearest lines, px, never negative.
    jacobian : (N, 3) float64
        Their derivatives by x, y (px/m) and theta (px/rad).
    normal_px : (N, 2) float64
        Unit normals in the image, from the line towards the point.
    index : (N,) int64
        Which line or arc.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turned = points.floor_m @ np.array([[c, s], [-s, c]])
    near = line_map.nearest(turned + pose[:2])
    normal_in_robot = near.normal @ np.array([[c, -s], [s, c]])
    slope = np.einsum("ni,nij->nj", normal_in_robot, points.floor_per_px)
    metres_per_px = np.maximum(np.hypot(slope[:, 0], slope[:, 1]), 1e-9)
    by_theta = near.normal[:, 1] * turned[:, 0] - near.normal[:, 0] * turned[:, 1]
    jacobian = np.column_stack([near.normal, by_theta]) / metres_per_px[:, None]
    return near.distance_m / metres_per_px, jacobian, slope / metres_per_px[:, None], near.index


def _spread_px(residual: FloatArray, within: float) -> float:
    """Robust standard deviation of unsigned residuals, from those within a bound."""
    good = residual <= 2 * within
    return 1.48 * float(np.median(residual[good])) if good.any() else within


def _estimate(
    pose: FloatArray, points: LinePoints, line_map: LineMap, information: FloatArray, scale: float
) -> PoseEstimate | NotLocated:
    residual, jacobian, normal_px, index = _pixel_residuals(pose, points, line_map)
    good = residual <= INLIER_PX
    if np.count_nonzero(good) < LEAST_SEARCH_POINTS:
        return NotLocated("too few line points lie on lines")
    sigma2 = max(_spread_px(residual, scale), LEAST_NOISE_PX) ** 2
    weight = points.weight / (1 + (residual / scale) ** 2) ** 2 / sigma2
    fisher = (jacobian.T * weight) @ jacobian
    # one group per line and stretch of floor: what errs there errs together (a cluster-robust "sandwich")
    patch = np.floor(points.floor_m / CORRELATION_M).astype(np.int64)
    _, member = np.unique((index * 40_009 + patch[:, 0]) * 40_009 + patch[:, 1], return_inverse=True)
    count = np.bincount(member.ravel())
    scores = np.zeros((len(count), 3))
    np.add.at(scores, member.ravel(), jacobian * (weight * residual)[:, None])
    spread = scores.T @ scores * (len(count) / max(len(count) - 3, 1))
    shifts = np.zeros((len(count), 2))
    np.add.at(shifts, member.ravel(), normal_px * np.where(good, residual, 0.0)[:, None])
    long = count >= 5
    shift2_px2 = float(np.mean((shifts[long] / count[long, None]) ** 2)) * 2 if long.any() else sigma2
    pull = jacobian.T @ (normal_px * weight[:, None])
    meat = fisher + spread + HIDDEN_SHIFT**2 * shift2_px2 * (pull @ pull.T) + information
    try:
        bread = np.linalg.inv(fisher + information)
    except np.linalg.LinAlgError:
        return NotLocated("the lines in view do not fix the pose")
    covariance = bread @ meat @ bread
    if not (np.isfinite(covariance).all() and np.isfinite(pose).all() and (np.diag(covariance) > 0).all()):
        return NotLocated("the lines in view do not fix the pose")
    return PoseEstimate(
        Pose2(*pose.tolist()),
        (covariance + covariance.T) / 2,
        float(points.weight[good].sum() / points.weight.sum()),
        float(np.sqrt(np.mean(residual[good] ** 2))),
    )
