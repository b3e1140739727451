"""Localisation with a mirror camera by the floor's outline, and by white lines where that is ambiguous."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.downward import DownwardCamera, downward
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LineEvidence, LineOdds, no_lines
from robocup_vision.localization.field_half import GoalSide, in_both_halves, nearer_half
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.line_map import LineMap
from robocup_vision.localization.localizer import Camera, FrameEvidence, Localization
from robocup_vision.localization.model_edges.field_edges import lines_only
from robocup_vision.localization.model_edges.localizer import EdgeLocalizer
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.perception.polar_view import PolarView

# lines all around a robot are many, and the picture of each is small: all their samples count
ALL_SAMPLES = EdgeSettings(ample_samples=math.inf)
# returns an estimate without its prior
_Measured = Callable[[], PoseEstimate]


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
        self._lines: EdgeLocalizer | None = None
        self._line_evidence: LineEvidence | None = None
        if use_lines and field.has_lines:
            self._downward = downward(camera)
            self._lines = EdgeLocalizer(lines_only(field), self._downward, ALL_SAMPLES)
            if self._outline is not None:
                self._line_evidence = LineEvidence(LineMap(field), view, self._outline.evidence.lines)
        self._half = GoalSide(field, camera, mask)

    def forget(self) -> None:
        """See `Localizer.forget`."""
        if self._lines is not None:
            self._lines.forget()

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`.

        The floor's outline has priority. If it is rejected, lines alone give the pose, unless the outline contradicts
        it. Finally the goals' colours determine the half of the field.
        """
        estimate, wall_px, alone = self._by_outline(evidence, prior)
        if isinstance(estimate, NotLocated) and self._lines is not None:
            refusal, wall_px = estimate.reason, None
            estimate, alone = self._by_lines(self._lines, evidence, prior)
            if isinstance(estimate, NotLocated) and refusal:
                estimate = NotLocated(f"{refusal}; by lines: {estimate.reason}")
        if isinstance(estimate, NotLocated):
            return Localization(estimate, evidence.camera)
        assert evidence.table is not None
        half = self._half.choose(evidence.frame, estimate, evidence.table.colors, pose_of(prior))
        measurement = partial(_in_half_of, alone, half) if alone is not None and half else None
        return Localization(half, evidence.camera, wall_px, measurement)

    def _by_outline(
        self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, FloatArray | None, _Measured | None]:
        """Return the pose by the floor's outline, the predicted image radii (K,) of walls, and its measurement."""
        if self._outline is None:
            return NotLocated(""), None, None
        answer = self._outline.locate(evidence.edge_px, evidence.floor_column, prior, self._line_odds(evidence))
        estimate, alone = answer.estimate, answer.measurement
        is_open = estimate and _is_open(estimate, self._outline.settings.sliding_std_m)
        if estimate and is_open and self._lines is not None:
            # the outline of a leaning body may not determine one direction, which lines may
            near, measured = self._by_lines(self._lines, evidence._replace(may_search=False), prior)
            if near and near.std[:2].max() < estimate.std[:2].max():
                return near, None, measured
        return estimate, answer.wall_px, None if alone is None else lambda: alone

    def _by_lines(
        self, lines: EdgeLocalizer, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None
    ) -> tuple[PoseEstimate | NotLocated, _Measured | None]:
        """Return the pose by lines alone, unless the outline contradicts it, and its measurement."""
        found = lines.locate(evidence._replace(camera=self._downward), prior)
        pose, measured = found.pose, found.measurement
        if isinstance(pose, NotLocated):
            return pose, None
        conflict = self._conflict(pose.pose, found.camera, evidence)
        if conflict is not None:
            return NotLocated(conflict), None
        if found.tells_half or measured is None:
            return pose, measured
        return in_both_halves(pose, pose_of(prior)), lambda: in_both_halves(measured())

    def _line_odds(self, evidence: FrameEvidence) -> LineOdds:
        """Return a function of a pose that gives its log odds by the lines in the frame's samples."""
        if self._line_evidence is None or evidence.marks is None:
            return no_lines
        return partial(self._line_evidence.log_odds, marks=evidence.marks)

    def _conflict(self, pose: Pose2, camera: Camera, evidence: FrameEvidence) -> str | None:
        """Return the outline's contradiction to a pose by lines alone; None without one, or without walls."""
        if self._outline is None:
            return None
        assert isinstance(camera, DownwardCamera)
        tally = self._outline.weigh_pose(pose, camera, evidence.edge_px, evidence.floor_column)
        return tally.reason(tally.log_odds) if tally.log_odds < 0.0 else None


def _in_half_of(measured: _Measured, chosen: PoseEstimate) -> PoseEstimate:
    """Return a measurement in the chosen half of the field; in both if that is unknown."""
    nearer = nearer_half(measured(), chosen.pose)
    return nearer if len(chosen.candidates) > 1 else replace(nearer, candidates=(nearer.pose,))


def _is_open(estimate: PoseEstimate, std_m: float) -> bool:
    """Whether x or y has at least this standard deviation; in plain floats, because it is tested in each frame."""
    covariance = estimate.covariance
    return max(covariance.item(0), covariance.item(4)) > std_m * std_m
