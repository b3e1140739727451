"""Yako et al.'s published goal angles as a `Localizer`: `Vision(..., method="angles")` stands beside ours."""

from __future__ import annotations

from field_models.field import Field
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.baselines.goal_angles import GoalAnglesEstimator
from robocup_vision.localization.localizer import FrameByFrame, FrameEvidence, Localization, pose_of


class AnglesLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "angles" of a pinhole camera. The tilt may be unknown.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar, in colours of a hue.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._angles = GoalAnglesEstimator(field, camera)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`; of two candidates, the one nearer to the prior comes first."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        found = self._angles.sight(evidence.frame)
        if isinstance(found, NotLocated):
            return Localization(found, camera)
        held = camera.with_orientation(camera.pan_rad or 0.0, found.tilt_rad, found.roll_rad)
        estimate, near = found.estimate.seen_from(held.camera_in_robot.inverse()), pose_of(prior)
        if near is not None and len(estimate.candidates) > 1:
            estimate = min((estimate, estimate.half_turn()), key=lambda one: sum(one.pose.error_to(near)))
        return Localization(estimate, held)
