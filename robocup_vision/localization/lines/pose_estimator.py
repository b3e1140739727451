"""Pose estimation by white line points, over the whole field without a prior, or near a start."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.fit import LineFitSettings, refine_by_lines, residuals_px
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import (
    LineCandidate,
    LineSearchSettings,
    one_per_patch,
    search_by_lines,
)
from robocup_vision.perception.line_points import FloorCamera, LineFinder, LinePoints


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Settings of `LinePoseEstimator`."""

    search: LineSearchSettings = LineSearchSettings()
    fit: LineFitSettings = LineFitSettings()
    min_inlier_ratio: float = 0.5  #: least ratio of all line points on lines of the pose
    #: the same of the points on the field's carpet or lines at that pose, because people and shelves around the field
    #: are not evidence
    min_carpet_ratio: float = 0.7
    #: least log-likelihood ratio for each point, against points uniform over the gate, if there are fewer line points
    #: than this: a few lie near lines by chance
    few_points: int = 300
    min_nats_of_few: float = 0.5
    #: least ratio of the runner-up's loss to the best one's, and least excess, for losses near zero
    rival_ratio: float = 1.35
    rival_excess: float = 0.15
    #: least ratio of lines on visible floor that were found
    min_support: float = 0.75
    #: greatest standard deviations of an accepted pose
    max_std_m: float = 0.25
    max_std_rad: float = math.radians(8.0)
    #: greatest distance of a followed pose from the start: half the distance between two modes of the search for usual
    #: distances of lines
    max_followed_m: float = 0.3
    max_followed_rad: float = math.radians(10.0)


class LinePoseEstimator:
    """Estimates a robot's pose from the white lines of one camera; non-zero pixels of the mask (H, W) are not used."""

    def __init__(
        self,
        field: Field,
        camera: FloorCamera,
        mask: npt.NDArray[np.generic] | None = None,
        settings: LineSettings = LineSettings(),
    ) -> None:
        self.settings = settings
        self.line_map = LineMap(field)
        self.finder = LineFinder(camera, field.line_width_m, mask)
        self._model_points_m = field.line_points(self.settings.search.patch_m)

    def locate(
        self,
        frame: npt.NDArray[np.uint8] | LinePoints,
    ) -> PoseEstimate | NotLocated:
        """Estimate the pose from a BGR frame (H, W, 3), or its line points, over the whole field.

        If the field's lines are point-symmetric, the estimate has both candidates, half a turn apart.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        found = search_by_lines(points, self.line_map, settings=self.settings.search)
        if not found:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        start = self._choose(found, points)
        if isinstance(start, NotLocated):
            return start
        refined = self._refined(start, points)
        return self._with_candidates(refined, None) if refined else refined

    def follow(self, frame: npt.NDArray[np.uint8] | LinePoints, start: Pose2) -> PoseEstimate | NotLocated:
        """Estimate the pose near `start`, which is not used as evidence.

        Much faster than `locate`, but other explanations of the lines are not searched: call `locate` periodically.
        NotLocated if the lines lead away from the start.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        if len(points) < self.settings.search.min_points:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        refined = self._refined(start, points)
        if not refined:
            return refined
        if not self.is_near(refined, start):
            distance, angle = refined.pose.error_to(start)
            return NotLocated(f"the lines lead {distance:.2f} m and {math.degrees(angle):.0f} degrees away")
        return self._with_candidates(refined, start)

    def is_near(self, estimate: PoseEstimate, start: Pose2) -> bool:
        """Whether one of an estimate's candidates may be the same as another pose."""
        for pose in estimate.candidates:
            distance, angle = pose.error_to(start)
            if distance <= self.settings.max_followed_m and angle <= self.settings.max_followed_rad:
                return True
        return False

    def _refined(self, start: Pose2, points: LinePoints) -> PoseEstimate | NotLocated:
        """Refine a pose; NotLocated if the lines do not confirm it or do not determine it."""
        refined = refine_by_lines(start, points, self.line_map, settings=self.settings.fit)
        if not refined:
            return refined
        refined = self._judged(refined, points)
        if not refined:
            return refined
        if max(refined.std[:2]) > self.settings.max_std_m or refined.std[2] > self.settings.max_std_rad:
            return NotLocated("the lines in view do not fix the pose")
        return refined

    def _judged(self, estimate: PoseEstimate, points: LinePoints) -> PoseEstimate | NotLocated:
        """Return the estimate if the line points confirm it and its lines on visible floor were found."""
        if estimate.inlier_ratio < self.settings.min_inlier_ratio:
            return NotLocated(f"only {estimate.inlier_ratio:.0%} of the line points lie on lines of the best pose")
        if len(points) < self.settings.few_points and self._nats(estimate) < self.settings.min_nats_of_few:
            return NotLocated(f"{len(points)} line points lie near lines of the best pose no better than by chance")
        on_carpet = self._carpet_ratio(estimate.pose, points)
        if on_carpet < self.settings.min_carpet_ratio:
            return NotLocated(f"only {on_carpet:.0%} of the line points on the carpet lie on lines of the best pose")
        support = self._support(estimate.pose, points)
        if support < self.settings.min_support:
            return NotLocated(f"only {support:.0%} of the lines that should be in plain sight were seen")
        return estimate

    def _choose(self, found: list[LineCandidate], points: LinePoints) -> Pose2 | NotLocated:
        """Refine the candidates that the search does not separate, and return the best if it has no rival."""
        similar = [
            c.pose for c in found if c.cost <= self.settings.rival_ratio * found[0].cost + self.settings.rival_excess
        ]
        if len(similar) == 1:
            return similar[0]
        thin = one_per_patch(points, math.inf, self.settings.search)
        answers = [refine_by_lines(pose, thin, self.line_map, settings=self.settings.fit) for pose in similar]
        poses = [answer.pose if answer else pose for answer, pose in zip(answers, similar, strict=True)]
        ranked = sorted((self._pixel_loss(pose, thin), i) for i, pose in enumerate(poses))
        ranked = [(loss, i) for loss, i in ranked if self._support(poses[i], points) >= self.settings.min_support]
        if not ranked:
            return NotLocated("most of the lines that should be in plain sight were not seen")
        least = self.settings.min_carpet_ratio
        ranked = [(loss, i) for loss, i in ranked if self._carpet_ratio(poses[i], points) >= least]
        if not ranked:
            return NotLocated(f"no pose puts {least:.0%} of the line points on the carpet onto lines")
        best = poses[ranked[0][1]]
        apart = replace(self.settings.search.apart, twins=self.line_map.is_point_symmetric)
        for loss, i in ranked[1:]:
            other = poses[i]
            rivals = loss < self.settings.rival_ratio * ranked[0][0] + self.settings.rival_excess
            if rivals and not apart.is_one(other, best):
                return NotLocated(
                    f"the lines fit two poses about equally well: ({best.x_m:.2f}, {best.y_m:.2f}) "
                    f"and ({other.x_m:.2f}, {other.y_m:.2f})"
                )
        return best

    def _carpet_ratio(self, pose: Pose2, points: LinePoints) -> float:
        """Return the ratio of line points on lines to those on the field's carpet or lines at a pose."""
        residual = residuals_px(pose, points, self.line_map)
        is_on_line = residual <= self.settings.fit.inlier_px
        counts = self.line_map.counts(pose.transform(points.floor_m), is_on_line)
        return float(points.weight[is_on_line].sum() / max(points.weight[counts].sum(), 1e-9))

    def _nats(self, estimate: PoseEstimate) -> float:
        """Log-likelihood ratio for each point: a normal distribution of residuals to a uniform one over the gate."""
        chance_px = 2 * self.settings.fit.inlier_px / math.sqrt(math.tau * math.e)
        return estimate.inlier_ratio * math.log(chance_px / max(estimate.residual_px, 1e-3))

    def _support(self, pose: Pose2, points: LinePoints) -> float:
        """Return the ratio of predicted line points that were found to those found or bare floor."""
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
        residual = residuals_px(pose, points, self.line_map)
        return float(np.average(np.log1p((residual / self.settings.search.noise_px) ** 2), weights=points.weight))

    def _with_candidates(self, estimate: PoseEstimate, near: Pose2 | None) -> PoseEstimate:
        if not self.line_map.is_point_symmetric:
            return estimate
        turned = estimate.half_turn()
        if near is not None and sum(turned.pose.error_to(near)) < sum(estimate.pose.error_to(near)):
            estimate, turned = turned, estimate
        return replace(estimate, candidates=(estimate.pose, turned.pose))
