"""Locates a pinhole camera by one picture of a goal, with the field's lines where they are in view."""

from __future__ import annotations

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arguments import as_frame
from robocup_vision.arrays import UInt8Array, plain_frame
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.arc import open_arc
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, without_lines
from robocup_vision.localization.goal.goal_lines import CERTAIN_M
from robocup_vision.localization.goal.half_goal import find_half_goal
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.goal.verdict import GoalVerdict
from robocup_vision.localization.line_map import LineMap


class GoalPoseEstimator:
    """Camera position on the floor and heading of its optical axis, from posts and bar.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar in colours of a hue.
    camera : PinholeCamera
        Pan, tilt and roll may be unknown.
    use_lines : bool
        Fit the field's lines together with the goal wherever they are in view.

    Raises
    ------
    ArgumentError
        If the field has no such goals.
    """

    def __init__(self, field: Field, camera: PinholeCamera, *, use_lines: bool = True) -> None:
        self.field = field
        self.camera = camera
        self._search = GoalSearch(field, camera)
        if not self._search.families:
            raise ArgumentError(f"the goals of field '{field.name}' have no hue; GoalLocalizer takes white ones")
        line_map = LineMap(field) if use_lines and field.has_lines else None
        self._verdict = GoalVerdict(self._search, line_map)

    def locate(self, frame: UInt8Array, prior: Pose2 | None = None) -> PoseEstimate | NotLocated:
        """Locate the camera.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        prior : Pose2, optional
            Roughly where the camera is (0.4 m, 9 degrees, one standard deviation). Where no whole goal is seen, half a
            goal is then tried from there, and of two candidates half a turn apart the nearer comes first.

        Raises
        ------
        FrameError
            If the frame has the wrong type, shape or size.
        """
        found = self.locate_camera(frame, prior)
        return found if isinstance(found, NotLocated) else found.estimate(prior)

    def locate_camera(self, frame: UInt8Array, prior: Pose2 | None = None) -> CameraEstimate | NotLocated:
        """Locate the camera as `locate` does, with its tilt, roll and height and what was measured."""
        picture = self._search.picture(plain_frame(as_frame(frame, self.camera.size_px)))
        candidates, reason = self._search.candidates(picture)
        found = self._verdict.locate(picture, candidates) if candidates else NotLocated(reason)
        if prior is None or not isinstance(found, NotLocated):
            return found
        part = find_half_goal(self._search, picture, prior)
        if part is None:
            return NotLocated(f"{found.reason}; too little of it confirms the prior")
        return without_lines(part, open_arc(part.model, part.fit, CERTAIN_M))
