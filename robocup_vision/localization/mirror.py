"""Localises a robot with a mirror camera: by the floor's outline, and by the white lines where that leaves a choice."""

from __future__ import annotations

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.floor import FloorLocalizer
from robocup_vision.localization.lines.localizer import LineLocalizer
from robocup_vision.localization.localizer import FrameEvidence, Localization, pose_of
from robocup_vision.perception.polar_view import PolarView


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
        outline tells nothing or nothing bounds the floor. Without lines ("floor") the field must be bounded.

    Raises
    ------
    ArgumentError
        If the method needs a bounded floor and the field has none.
    """

    needs_floor = True

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        view: PolarView,
        mask: UInt8Array | None = None,
        *,
        use_lines: bool = True,
    ) -> None:
        self._outline = FloorLocalizer(field, camera, view) if field.is_bounded or not use_lines else None
        self._lines = LineLocalizer(field, camera, mask) if use_lines else None
        self._half = GoalSide(field, camera, mask)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        start = pose_of(prior)
        frame, camera = evidence.frame, evidence.camera
        assert evidence.table is not None
        colors = evidence.table.colors
        reason = ""
        if self._outline is not None:
            lines = self._lines
            arbiter = None if lines is None else (lambda poses: lines.choose(frame, poses))
            estimate, walls = self._outline.locate(evidence.edge_px, start, arbiter)
            if isinstance(estimate, PoseEstimate):
                return Localization(self._half.choose(frame, estimate, colors, start), camera, walls)
            reason = estimate.reason
        if self._lines is not None:
            estimate = self._lines.locate(frame)
            if isinstance(estimate, PoseEstimate):
                return Localization(self._half.choose(frame, estimate, colors, start), camera)
            reason = f"{reason}; by lines: {estimate.reason}" if reason else estimate.reason
        return Localization(NotLocated(reason), camera)
