"""A robot's pose from white line points: searched over the whole field without any prior, or refined from a guess."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import PoseEvidence, default_evidence
from robocup_vision.localization.lines.evidence import LinesAloneEvidence, LineTally, SeenLines
from robocup_vision.localization.lines.fit import LineFitSettings, refine_by_lines
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import LineSearchSettings, same_pose, search_by_lines
from robocup_vision.perception.line_points import FloorCamera, LineFinder, LinePoints


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Settings of `LinePoseEstimator`.

    Parameters
    ----------
    search, fit : LineSearchSettings, LineFitSettings
        Of its stages.
    max_std_m, max_std_rad : float
        A pose more uncertain than this is refused.
    max_followed_m, max_followed_rad : float
        A pose that is followed moves no farther from where it was expected: half of what separates two modes of the
        search at the usual distances of lines.
    """

    search: LineSearchSettings = LineSearchSettings()
    fit: LineFitSettings = LineFitSettings()
    max_std_m: float = 0.25
    max_std_rad: float = math.radians(8.0)
    max_followed_m: float = 0.3
    max_followed_rad: float = math.radians(10.0)


class FoundPose(NamedTuple):
    """A pose of the search, its evidence, and whether the lines fix it in every direction."""

    pose: Pose2
    tally: LineTally
    is_fixed: bool


class LinePoseEstimator:
    """Finds a robot's pose from the white lines one camera sees.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : FloorCamera
        Takes the frames.
    mask : (H, W) array, optional
        Non-zero pixels are never looked at.
    settings : LineSettings, optional
        Of search and fit.
    evidence : PoseEvidence, optional
        Its `lines_alone` and `min_log_odds` decide; those that come with the package unless given.
    """

    def __init__(
        self,
        field: Field,
        camera: FloorCamera,
        mask: npt.NDArray[np.generic] | None = None,
        settings: LineSettings = LineSettings(),
        evidence: PoseEvidence | None = None,
    ) -> None:
        self.settings = settings
        decides = evidence or default_evidence()
        self._min_log_odds = decides.min_log_odds
        # of a whole field's places one may be told by clutter: without a prior the odds are asked for twice
        self._min_found_log_odds = 2 * decides.min_log_odds
        self.line_map = LineMap(field)
        self.finder = LineFinder(camera, field.line_width_m, mask)
        self.evidence = LinesAloneEvidence(
            camera, self.line_map, decides.lines_alone, settings.fit.inlier_px, settings.search
        )

    def locate(
        self,
        frame: npt.NDArray[np.uint8] | LinePoints,
    ) -> PoseEstimate | NotLocated:
        """Find the pose by searching the whole field.

        Parameters
        ----------
        frame : (H, W, 3) uint8, or LinePoints
            BGR image, or the line points already found in it.

        Returns
        -------
        PoseEstimate or NotLocated
            On a field whose lines are point-symmetric both candidates half a turn apart, `pose` first.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        seen = self.evidence.see(points)
        candidates = self.candidates(points, seen)
        if not candidates:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        (best, tally, _), *others = candidates
        if tally.log_odds < self._min_found_log_odds:
            return NotLocated(tally.reason)
        for other, its, _ in others:
            if its.log_odds < tally.log_odds - self._min_log_odds:
                break
            if not same_pose(other, best, self.line_map.is_point_symmetric, self.settings.search):
                return NotLocated(
                    f"the lines fit two poses about equally well: ({best.x_m:.2f}, {best.y_m:.2f}) "
                    f"and ({other.x_m:.2f}, {other.y_m:.2f}), {tally.reason}"
                )
        refined = self._refined(best, points, seen, self._min_found_log_odds)
        return self._with_candidates(refined, None) if refined else refined

    def candidates(self, points: LinePoints, seen: SeenLines) -> list[FoundPose]:
        """Return poses anywhere on the field that put line points on lines, with their evidence, the likeliest first.

        Parameters
        ----------
        points : LinePoints
            Of a frame.
        seen : SeenLines
            The same, as the evidence takes them.
        """
        fit, found = self.settings.fit, []
        for candidate in search_by_lines(points, self.line_map, settings=self.settings.search):
            refined = refine_by_lines(candidate.pose, seen.patches, self.line_map, settings=fit)
            pose = refined.pose if refined else candidate.pose
            is_fixed = isinstance(refined, PoseEstimate) and self._fixes(refined)
            found.append(FoundPose(pose, self.evidence.tally(pose, seen), is_fixed))
        return sorted(found, key=lambda one: -one.tally.log_odds)

    def follow(self, frame: npt.NDArray[np.uint8] | LinePoints, start: Pose2) -> PoseEstimate | NotLocated:
        """Find the pose near one, by the frame alone: where the search begins, and nothing more, is known beforehand.

        Much faster than `locate`. What else would explain the lines is not looked for: search now and then.

        Parameters
        ----------
        frame : (H, W, 3) uint8, or LinePoints
            BGR image, or the line points already found in it.
        start : Pose2
            Where to begin.

        Returns
        -------
        PoseEstimate or NotLocated
            As `locate`; NotLocated where the lines lead away from the start, too.
        """
        points = frame if isinstance(frame, LinePoints) else self.finder.find(frame)
        if len(points) < self.settings.search.min_points:
            return NotLocated(f"too little of the field's lines in view ({len(points)} line points)")
        refined = self._refined(start, points, self.evidence.see(points), self._min_log_odds)
        if not refined:
            return refined
        if not self.is_near(refined, start):
            distance, angle = refined.pose.error_to(start)
            return NotLocated(f"the lines lead {distance:.2f} m and {math.degrees(angle):.0f} degrees away")
        return self._with_candidates(refined, start)

    def is_near(self, estimate: PoseEstimate, start: Pose2) -> bool:
        """Return whether one of an estimate's poses is so near to another pose that it may be the same one."""
        for pose in estimate.candidates:
            distance, angle = pose.error_to(start)
            if distance <= self.settings.max_followed_m and angle <= self.settings.max_followed_rad:
                return True
        return False

    def _refined(
        self, start: Pose2, points: LinePoints, seen: SeenLines, min_log_odds: float
    ) -> PoseEstimate | NotLocated:
        """Refine a pose in pixels; NotLocated if the lines do not bear it out, or do not fix it."""
        refined = refine_by_lines(start, points, self.line_map, settings=self.settings.fit)
        if not refined:
            return refined
        tally = self.evidence.tally(refined.pose, seen)
        if tally.log_odds < min_log_odds:
            return NotLocated(tally.reason)
        return refined if self._fixes(refined) else NotLocated("the lines in view do not fix the pose")

    def _fixes(self, estimate: PoseEstimate) -> bool:
        x_m, y_m, theta_rad = estimate.std
        return bool(max(x_m, y_m) <= self.settings.max_std_m and theta_rad <= self.settings.max_std_rad)

    def _with_candidates(self, estimate: PoseEstimate, near: Pose2 | None) -> PoseEstimate:
        if not self.line_map.is_point_symmetric:
            return estimate
        turned = estimate.half_turn()
        if near is not None and _apart(turned.pose, near) < _apart(estimate.pose, near):
            estimate, turned = turned, estimate
        return PoseEstimate(
            estimate.pose,
            estimate.covariance,
            estimate.inlier_ratio,
            estimate.residual_px,
            (estimate.pose, turned.pose),
        )


def _apart(pose: Pose2, other: Pose2) -> float:
    distance, angle = pose.error_to(other)
    return distance + angle
