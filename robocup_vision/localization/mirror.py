"""Localises a robot with a mirror camera: by the floor's outline, and by the white lines where that leaves a choice."""

from __future__ import annotations

from functools import partial

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LineEvidence, LineOdds
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from robocup_vision.localization.localizer import FrameEvidence, Localization, pose_of
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.polar_view import PolarView

# lines near the last pose are followed; the whole field is searched for other explanations at this interval
_SEARCH_AGAIN_S = 1.0


class MirrorLocalizer:
    """Satisfies `Localizer`; methods "field" and "floor" of a mirror camera.

    Parameters
    ----------
    mask : (H, W) uint8, optional
        Non-zero pixels are not used.
    use_lines : bool
        Weigh the lines, too, where the outline leaves something open, and search by lines alone where it does not fix
        the pose, or nothing bounds the floor. Without lines ("floor") the field must be bounded.

    Raises
    ------
    ArgumentError
        If the method needs a bounded floor and the field has none.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        view: PolarView,
        mask: UInt8Array | None = None,
        *,
        use_lines: bool = True,
    ) -> None:
        self._outline = OutlineFitter(field, camera, view) if field.is_bounded or not use_lines else None
        lines = LinePoseEstimator(field, camera, mask) if use_lines and len(field.lines) + len(field.arcs) else None
        self._lines = lines
        self._line_evidence: LineEvidence | None = None
        if self._outline is not None and lines is not None:
            self._line_evidence = LineEvidence(lines.line_map, view, self._outline.evidence.lines)
        self._half = GoalSide(field, camera, mask)
        self._points: LinePoints | None = None  # of the current frame
        self.forget()

    def forget(self) -> None:
        """See `Localizer.forget`."""
        self._searched_s: float | None = None  # when the whole field was last searched by lines

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        self._points = None
        start = pose_of(prior)
        frame, camera = evidence.frame, evidence.camera
        assert evidence.table is not None
        colors = evidence.table.colors
        reason = ""
        if self._outline is not None:
            line_odds = self._line_odds(evidence)
            estimate, walls = self._outline.locate(evidence.edge_px, evidence.floor_column, start, line_odds)
            if isinstance(estimate, PoseEstimate):
                if start is not None and _leaves_open(estimate, self._outline.settings.sliding_std_m):
                    estimate, walls = self._closed_by_lines(evidence, start, estimate, walls)
                return Localization(self._half.choose(frame, estimate, colors, start), camera, walls)
            reason = estimate.reason
        if self._lines is not None:
            estimate = self._by_lines(self._lines, evidence, start)
            conflict = estimate.reason if isinstance(estimate, NotLocated) else self._conflict(estimate.pose, evidence)
            if isinstance(estimate, PoseEstimate) and conflict is None:
                return Localization(self._half.choose(frame, estimate, colors, start), camera)
            reason = f"{reason}; by lines: {conflict}" if reason else str(conflict)
        return Localization(NotLocated(reason), camera)

    def _line_odds(self, evidence: FrameEvidence) -> LineOdds | None:
        """Return a function of a pose's log odds by the lines in the frame's samples."""
        if self._line_evidence is None or evidence.marks is None:
            return None
        return partial(self._line_evidence.log_odds, marks=evidence.marks)

    def _line_points(self, frame: UInt8Array, lines: LinePoseEstimator) -> LinePoints:
        """Find the line points of the current frame, once."""
        if self._points is None:
            self._points = lines.finder.find(frame)
        return self._points

    def _closed_by_lines(
        self, evidence: FrameEvidence, start: Pose2, estimate: PoseEstimate, walls: FloatArray
    ) -> tuple[PoseEstimate, FloatArray]:
        """Return the pose by nearby lines where the outline leaves the position of a body that may lean open."""
        if self._lines is None:
            return estimate, walls
        followed = self._lines.follow(self._line_points(evidence.frame, self._lines), start)
        if not followed or self._conflict(followed.pose, evidence) is not None:
            return estimate, walls
        if followed.std[:2].max() >= estimate.std[:2].max():
            return estimate, walls
        return followed, np.full_like(walls, np.nan)

    def _by_lines(
        self, lines: LinePoseEstimator, evidence: FrameEvidence, start: Pose2 | None
    ) -> PoseEstimate | NotLocated:
        """Follow the lines from the expected pose; search the whole field where that fails, or now and then."""
        points, t_s, searched_s = self._line_points(evidence.frame, lines), evidence.t_s, self._searched_s
        is_recent = t_s is not None and searched_s is not None and 0.0 <= t_s - searched_s < _SEARCH_AGAIN_S
        if is_recent and start is not None:
            followed = lines.follow(points, start)
            if followed:
                return followed
        found = lines.locate(points)
        # where the search contradicts the expected pose, the following frames are searched, too: they decide
        self._searched_s = t_s if found and (start is None or lines.is_near(found, start)) else None
        return found

    def _conflict(self, pose: Pose2, evidence: FrameEvidence) -> str | None:
        """Return the outline's contradiction to a pose by lines alone; None where there is none, or no walls."""
        if self._outline is None:
            return None
        tally = self._outline.weigh_pose(pose, evidence.edge_px, evidence.floor_column)
        line_odds = self._line_odds(evidence)
        log_odds = tally.log_odds + (0.0 if line_odds is None else line_odds(pose))
        return tally.reason(log_odds) if log_odds < self._outline.evidence.min_log_odds else None


def _leaves_open(estimate: PoseEstimate, std_m: float) -> bool:
    """Whether x or y is known to no better than a standard deviation; in plain floats, as it is asked in each frame."""
    covariance = estimate.covariance
    return max(covariance.item(0), covariance.item(4)) > std_m * std_m
