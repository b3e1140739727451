"""Sekimori et al.'s published hull fit as a `Localizer`, so that `Vision(..., method="hull")` can stand beside ours."""

from __future__ import annotations

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.baselines.floor_hull import HullFitter
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.localizer import FrameByFrame, FrameEvidence, Localization, pose_of
from robocup_vision.perception.polar_view import PolarView


class HullLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "hull" of a mirror camera.

    Parameters
    ----------
    field : Field
        Its floor must be bounded, and longer than wide.
    view : PolarView
        Not used: the published method reads the whole floor mask.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    """

    def __init__(self, field: Field, camera: OmniCamera, view: PolarView, mask: UInt8Array | None = None) -> None:
        self._hull = HullFitter(field, camera, mask)
        self._half = GoalSide(field, camera, mask)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        assert evidence.table is not None
        pose = self._hull.locate_floor(self._hull.floor_mask(evidence.frame, evidence.table))
        if isinstance(pose, PoseEstimate):
            pose = self._half.choose(evidence.frame, pose, evidence.table.colors, pose_of(prior))
        return Localization(pose, evidence.camera)
