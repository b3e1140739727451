"""Localisation with a mirror camera by the floor's outline, and by white lines where that is ambiguous."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LineEvidence, LineOdds, no_lines
from robocup_vision.localization.field_half import GoalSide, nearer_half
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from robocup_vision.localization.localizer import FrameEvidence, Localization
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.polar_view import PolarView

# interval of searches over the whole field while lines are followed near the last pose
_SEARCH_AGAIN_S = 1.0


class MirrorLocalizer:
    """Satisfies `Localizer`; methods "field" and "floor" of a mirror camera.

    Parameters
    ----------
    mask : (H, W) uint8, optional
        Non-zero pixels are not used.
    use_lines : bool
        Weigh the lines, too, where the outline is ambiguous, and search by lines alone if it does not determine the
        pose or nothing bounds the floor. Without lines ("floor") the field must be bounded.

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
        self._points: LinePoints | None = None  # line points of the current frame
        self.forget()

    def forget(self) -> None:
        """See `Localizer.forget`."""
        self._searched_s: float | None = None  # time of the last search of the whole field by lines

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`.

        The floor's outline has priority. If it is rejected, lines alone give the pose, unless the outline contradicts
        it. Finally the goals' colours determine the half of the field.
        """
        self._points = None
        start = pose_of(prior)
        estimate, wall_px, alone = self._by_outline(evidence, prior)
        if isinstance(estimate, NotLocated) and self._lines is not None:
            estimate, wall_px = self._by_lines(self._lines, evidence, start, estimate), None
        if isinstance(estimate, NotLocated):
            return Localization(estimate, evidence.camera)
        assert evidence.table is not None
        half = self._half.choose(evidence.frame, estimate, evidence.table.colors, start)
        measurement = partial(_in_half_of, alone, half) if alone is not None and half else None
        return Localization(half, evidence.camera, wall_px, measurement)

    def _by_outline(
        self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, FloatArray | None, PoseEstimate | None]:
        """Return the pose by the floor's outline, the predicted image radii (K,) of walls, and its measurement."""
        if self._outline is None:
            return NotLocated(""), None, None
        odds = self._line_odds(evidence)
        answer = self._outline.locate(evidence.edge_px, evidence.floor_column, prior, odds)
        estimate = answer.estimate
        start = pose_of(prior)
        if start is None or not estimate or not _is_open(estimate, self._outline.settings.sliding_std_m):
            return answer
        # the outline of a leaning body may not determine one direction, which lines near the prior may
        if self._lines is not None:
            followed = self._lines.follow(self._line_points(evidence.frame, self._lines), start)
            if (
                followed
                and followed.std[:2].max() < estimate.std[:2].max()
                and self._conflict(followed.pose, evidence) is None
            ):
                return followed, None, None
        return answer

    def _by_lines(
        self, lines: LinePoseEstimator, evidence: FrameEvidence, start: Pose2 | None, refusal: NotLocated
    ) -> PoseEstimate | NotLocated:
        """Return the pose by lines alone, after the outline has been rejected."""
        estimate = self._follow_or_search(lines, evidence, start)
        conflict = self._conflict(estimate.pose, evidence) if estimate else estimate.reason
        if conflict is None:
            return estimate
        return NotLocated(f"{refusal.reason}; by lines: {conflict}" if refusal.reason else conflict)

    def _follow_or_search(
        self, lines: LinePoseEstimator, evidence: FrameEvidence, start: Pose2 | None
    ) -> PoseEstimate | NotLocated:
        """Follow the lines from the expected pose; search the whole field if that fails, and periodically."""
        points, t_s, searched_s = self._line_points(evidence.frame, lines), evidence.t_s, self._searched_s
        is_recent = t_s is not None and searched_s is not None and 0.0 <= t_s - searched_s < _SEARCH_AGAIN_S
        if is_recent and start is not None:
            followed = lines.follow(points, start)
            if followed:
                return followed
        found = lines.locate(points)
        # if the search contradicts the expected pose, the next frames are searched, too, to decide
        self._searched_s = t_s if found and (start is None or lines.is_near(found, start)) else None
        return found

    def _line_points(self, frame: UInt8Array, lines: LinePoseEstimator) -> LinePoints:
        """Return the line points of the current frame, found once."""
        if self._points is None:
            self._points = lines.finder.find(frame)
        return self._points

    def _line_odds(self, evidence: FrameEvidence) -> LineOdds:
        """Return a function of a pose that gives its log odds by the lines in the frame's samples."""
        if self._line_evidence is None or evidence.marks is None:
            return no_lines
        return partial(self._line_evidence.log_odds, marks=evidence.marks)

    def _conflict(self, pose: Pose2, evidence: FrameEvidence) -> str | None:
        """Return the outline's contradiction to a pose by lines alone; None without one, or without walls."""
        if self._outline is None:
            return None
        tally = self._outline.weigh_pose(pose, evidence.edge_px, evidence.floor_column)
        log_odds = tally.log_odds + self._line_odds(evidence)(pose)
        return tally.reason(log_odds) if log_odds < self._outline.evidence.min_log_odds else None


def _in_half_of(measurement: PoseEstimate, chosen: PoseEstimate) -> PoseEstimate:
    """Return a measurement in the chosen half of the field; in both if that is unknown."""
    nearer = nearer_half(measurement, chosen.pose)
    return nearer if len(chosen.candidates) > 1 else replace(nearer, candidates=(nearer.pose,))


def _is_open(estimate: PoseEstimate, std_m: float) -> bool:
    """Whether x or y has at least this standard deviation; in plain floats, because it is tested in each frame."""
    covariance = estimate.covariance
    return max(covariance.item(0), covariance.item(4)) > std_m * std_m
