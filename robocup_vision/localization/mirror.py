"""Localises a robot with a mirror camera: by the floor's outline, and by the white lines where that leaves a choice."""

from __future__ import annotations

from functools import partial

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.line_support import LineSupport
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from robocup_vision.localization.localizer import FrameEvidence, Localization, pose_of
from robocup_vision.localization.wall_ranges import wall_px
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.polar_view import PolarView

# lines near the last pose are followed; the whole field is searched so often for what else explains them
_SEARCH_AGAIN_S = 1.0
# floor that shows this many columns beyond a wall is beyond it; so many of the bearings may be mistaken
_BEYOND_COLUMNS, _MAX_BEYOND_RATIO = 3.0, 0.1


class MirrorLocalizer:
    """Satisfies `Localizer`; methods "field" and "floor" of a mirror camera.

    Parameters
    ----------
    field : Field
        The pitch.
    camera : OmniCamera
        The camera.
    view : PolarView
        Its floor samples.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    use_lines : bool
        Choose by the lines among poses that the outline fits about equally well, and search by lines alone where the
        outline does not fix the pose, or nothing bounds the floor. Without lines ("floor") the field must be bounded.

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
        lines = LinePoseEstimator(field, camera, mask) if len(field.lines) + len(field.arcs) else None
        self._lines = lines if use_lines else None
        self._finder = None if lines is None else lines.finder
        self._support = None if lines is None else LineSupport(lines.line_map, self._line_points, view)
        self._walls = field.walls if field.is_bounded else None
        self._half = GoalSide(field, camera, mask)
        self._points: LinePoints | None = None  # of the frame that is looked at
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
            arbiter = None if self._lines is None else partial(self._choose, self._lines, evidence)
            estimate, walls = self._outline.locate(evidence.edge_px, start, arbiter)
            if isinstance(estimate, PoseEstimate):
                if start is not None and _leaves_open(estimate, self._outline.settings.sliding_std_m):
                    estimate, walls = self._closed_by_lines(evidence, start, estimate, walls)
                if self._is_supported(estimate, evidence):
                    return Localization(self._half.choose(frame, estimate, colors, start), camera, walls)
                agree = f"{estimate.inlier_ratio:.0%}"
                estimate = NotLocated(f"{agree} of the floor's edge agrees with the walls, but the lines do not")
            reason = estimate.reason
        if self._lines is not None:
            estimate = self._by_lines(self._lines, evidence, start)
            if isinstance(estimate, PoseEstimate) and self._is_within_walls(estimate.pose, evidence):
                return Localization(self._half.choose(frame, estimate, colors, start), camera)
            by_lines = estimate.reason if isinstance(estimate, NotLocated) else "floor shows where they put the walls"
            reason = f"{reason}; by lines: {by_lines}" if reason else by_lines
        return Localization(NotLocated(reason), camera)

    def _line_points(self, frame: UInt8Array) -> LinePoints:
        """Find the line points of the frame that is looked at, once: choice, support and search may all ask."""
        assert self._finder is not None
        if self._points is None:
            self._points = self._finder.find(frame)
        return self._points

    def _closed_by_lines(
        self, evidence: FrameEvidence, start: Pose2, estimate: PoseEstimate, walls: FloatArray
    ) -> tuple[PoseEstimate, FloatArray]:
        """Return what nearby lines tell where the outline leaves the position of a body that may lean open."""
        if self._lines is None:
            return estimate, walls
        followed = self._lines.follow(self._line_points(evidence.frame), start)
        if not followed or not self._is_within_walls(followed.pose, evidence):
            return estimate, walls
        if followed.std[:2].max() >= estimate.std[:2].max():
            return estimate, walls
        return followed, np.full_like(walls, np.nan)

    def _by_lines(
        self, lines: LinePoseEstimator, evidence: FrameEvidence, start: Pose2 | None
    ) -> PoseEstimate | NotLocated:
        """Follow the lines from the expected pose; search the whole field where that fails, or now and then."""
        points, t_s, searched_s = self._line_points(evidence.frame), evidence.t_s, self._searched_s
        is_recent = t_s is not None and searched_s is not None and 0.0 <= t_s - searched_s < _SEARCH_AGAIN_S
        if is_recent and start is not None:
            followed = lines.follow(points, start)
            if followed:
                return followed
        found = lines.locate(points)
        # where the search contradicts the expected pose, the frames that follow are searched, too: they decide
        self._searched_s = t_s if found and (start is None or lines.is_near(found, start)) else None
        return found

    def _choose(self, lines: LinePoseEstimator, evidence: FrameEvidence, poses: list[Pose2]) -> int | None:
        """Return the index of the pose that the lines confirm; points to a fraction of a pixel only where needed."""
        chosen = None
        if self._support is not None and evidence.marks is not None:
            chosen = self._support.choose(poses, evidence.marks)
        return lines.choose(self._line_points(evidence.frame), poses) if chosen is None else chosen

    def _is_supported(self, estimate: PoseEstimate, evidence: FrameEvidence) -> bool:
        if self._support is None or evidence.marks is None:
            return True
        return self._support.supports(estimate, evidence.frame, evidence.marks)

    def _is_within_walls(self, pose: Pose2, evidence: FrameEvidence) -> bool:
        """Whether hardly any floor shows beyond the walls of a pose that lines alone give."""
        if self._walls is None or evidence.view is None:
            return True
        edge, wall = evidence.edge_px, wall_px(self._walls, pose, evidence.view)
        shown = np.isfinite(edge) & np.isfinite(wall)
        beyond = edge[shown] > wall[shown] + _BEYOND_COLUMNS * evidence.view.step_px
        return int(beyond.sum()) <= _MAX_BEYOND_RATIO * int(shown.sum())


def _leaves_open(estimate: PoseEstimate, std_m: float) -> bool:
    """Whether x or y is known to no better than a standard deviation; in plain floats, as it is asked in each frame."""
    covariance = estimate.covariance
    return max(covariance.item(0), covariance.item(4)) > std_m * std_m
