"""Pose estimation by white line points, over the whole field without a prior, or near a start."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.evidence import LinePointEvidence
from robocup_vision.localization.lines.fit import refine_by_lines
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import (
    APART,
    MIN_POINTS,
    PATCH_M,
    LineCandidate,
    search_by_lines,
    thinned,
)
from robocup_vision.perception.line_points import FloorCamera, LineFinder, LinePoints

# least log-likelihood ratio of a pose against clutter, and against every other place
_MIN_LOG_ODDS = 15.0
_MIN_LEAD = 7.0
# least ratio of lines on visible floor that were found
_MIN_SUPPORT = 0.75
# greatest standard deviations of an accepted pose
_MAX_STD_M = 0.25
_MAX_STD_RAD = math.radians(8.0)
# greatest distance of a followed pose from the start: half the distance between two modes of the search for usual
# distances of lines
_MAX_FOLLOWED_M = 0.3
_MAX_FOLLOWED_RAD = math.radians(10.0)


class LinePoseEstimator:
    """Estimates a robot's pose from the white lines of one camera; non-zero pixels of the mask (H, W) are not used."""

    def __init__(
        self,
        field: Field,
        camera: FloorCamera,
        mask: npt.NDArray[np.generic] | None = None,
    ) -> None:
        self.line_map = LineMap(field)
        self.finder = LineFinder(camera, field.line_width_m, mask)
        self._model_points_m = field.line_points(PATCH_M)

    def locate(
        self,
        frame: npt.NDArray[np.uint8] | LinePoints,
    ) -> PoseEstimate | NotLocated:
        """Estimate the pose from a BGR frame (H, W, 3), or its line points, over the whole field.

        If the field's lines are point-symmetric, the estimate has both candidates, half a turn apart.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        found = search_by_lines(points, self.line_map)
        if not found:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        evidence = self._evidence(points)
        start = self._choose(found, points, evidence)
        if isinstance(start, NotLocated):
            return start
        refined = self._refined(start, points, evidence)
        return self._with_candidates(refined, None) if refined else refined

    def follow(self, frame: npt.NDArray[np.uint8] | LinePoints, start: Pose2) -> PoseEstimate | NotLocated:
        """Estimate the pose near `start`, which is not used as evidence.

        Much faster than `locate`, but other explanations of the lines are not searched: call `locate` periodically.
        NotLocated if the lines lead away from the start.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        if len(points) < MIN_POINTS:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        refined = self._refined(start, points, self._evidence(points))
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
            if distance <= _MAX_FOLLOWED_M and angle <= _MAX_FOLLOWED_RAD:
                return True
        return False

    def _refined(self, start: Pose2, points: LinePoints, evidence: LinePointEvidence) -> PoseEstimate | NotLocated:
        """Refine a pose; NotLocated if the lines do not confirm it or do not determine it."""
        refined = refine_by_lines(start, points, self.line_map)
        if not refined:
            return refined
        log_odds = evidence.log_odds(refined.pose)
        if log_odds < _MIN_LOG_ODDS:
            agree = f"{refined.inlier_ratio:.0%} of {len(points)} line points lie on lines of the best pose"
            return NotLocated(f"{agree}, log odds {log_odds:.0f} of {_MIN_LOG_ODDS:.0f}")
        support = self._support(refined.pose, points)
        if support < _MIN_SUPPORT:
            return NotLocated(f"only {support:.0%} of the lines that should be in plain sight were seen")
        if max(refined.std[:2]) > _MAX_STD_M or refined.std[2] > _MAX_STD_RAD:
            return NotLocated("the lines in view do not fix the pose")
        return refined

    def _choose(
        self, found: list[LineCandidate], points: LinePoints, evidence: LinePointEvidence
    ) -> Pose2 | NotLocated:
        """Refine the candidates, and return the likeliest if it has no rival."""
        thin = thinned(points)
        answers = [refine_by_lines(one.pose, thin, self.line_map) for one in found]
        poses = [answer.pose if answer else one.pose for answer, one in zip(answers, found, strict=True)]
        log_odds = np.array([evidence.log_odds(pose) for pose in poses])
        order = np.argsort(-log_odds, kind="stable")
        best: Pose2 = poses[order[0]]
        apart = replace(APART, twins=self.line_map.is_point_symmetric)
        for place in order[1:]:
            other = poses[place]
            if log_odds[place] > log_odds[order[0]] - _MIN_LEAD and not apart.is_one(other, best):
                return NotLocated(
                    f"the lines fit two poses about equally well: ({best.x_m:.2f}, {best.y_m:.2f}) "
                    f"and ({other.x_m:.2f}, {other.y_m:.2f})"
                )
        return best

    def _evidence(self, points: LinePoints) -> LinePointEvidence:
        return LinePointEvidence(points, self.line_map)

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

    def _with_candidates(self, estimate: PoseEstimate, near: Pose2 | None) -> PoseEstimate:
        if not self.line_map.is_point_symmetric:
            return estimate
        turned = estimate.half_turn()
        if near is not None and sum(turned.pose.error_to(near)) < sum(estimate.pose.error_to(near)):
            estimate, turned = turned, estimate
        return replace(estimate, candidates=(estimate.pose, turned.pose))
