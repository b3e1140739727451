"""Localises a robot by one picture of a goal, whose camera's tilt may be unknown."""

from __future__ import annotations

import math

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import HEIGHT, LOG_FOCAL, ROLL, TILT
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.localizer import (
    FrameByFrame,
    FrameEvidence,
    Localization,
    pose_of,
)
from robocup_vision.localization.model_edges.tilt_finder import TiltFinder


class GoalLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "goal": posts and bar, with the lines around them. The tilt may be unknown.

    Where it is, and goals are white, the lines come first: a white goal among clutter is looked for far longer, and
    half of one is none, while lines tell tilt and place of most pictures.
    """

    def __init__(self, field: Field, camera: PinholeCamera, mask: UInt8Array | None = None) -> None:
        self._goal = GoalPoseEstimator(field, camera)
        has_lines = bool(len(field.lines) + len(field.arcs))
        self._by_lines: TiltFinder | None = None
        if has_lines and not camera.known_orientation and not field.shows_half:
            self._by_lines = TiltFinder(field, camera)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        start = pose_of(prior)
        near = None if start is None else start.compose(camera.camera_in_robot)
        if self._by_lines is not None:
            found = self._by_lines.find(evidence.frame)
            if found:
                oriented = found.as_held(camera)
                return Localization(found.estimate.seen_from(oriented.camera_in_robot.inverse()), oriented)
        placed = self._goal.locate_camera(evidence.frame, near)
        if isinstance(placed, NotLocated):
            return Localization(placed, camera)
        p = [float(value) for value in placed.unknowns]
        fu, fv = camera.focal_px
        scale = math.exp(p[LOG_FOCAL])
        oriented = camera.as_fitted(p[TILT], p[ROLL], p[HEIGHT], (fu * scale, fv * scale))
        pose = placed.estimate(near).seen_from(oriented.camera_in_robot.inverse())
        return Localization(pose, oriented, tells_half=len(pose.candidates) == 1)
