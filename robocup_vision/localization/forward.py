"""Localises a camera by one picture of a goal, also where its tilt is unknown."""

from __future__ import annotations

import math
from functools import cached_property

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import HEADING, HEIGHT, LOG_FOCAL, ROLL, TILT, X, Y
from robocup_vision.localization.goal.half_goal import find_half_goal
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.localizer import (
    FrameByFrame,
    FrameEvidence,
    Localization,
)
from robocup_vision.localization.model_edges.finder import TiltedPose
from robocup_vision.localization.model_edges.follower import FollowedCamera
from robocup_vision.localization.model_edges.tilt_finder import TiltFinder
from robocup_vision.perception.goal_region import hue_families

# number of goals in a picture that are fitted to all edges: more are clutter
_MAX_PROPOSALS = 8


class GoalLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "goal": posts and bar, with the lines around them. The tilt may be unknown.

    A goal of a hue is measured by itself, and its lines with it. White goals only propose cameras, which are then
    fitted to and judged by all edges of the field, as cameras proposed by lines are.

    If the tilt is unknown and both halves of the field look alike, lines come first: they determine tilt and pose in
    most pictures, and need no whole goal. On fields whose halves differ they are tried if no goal is found, and
    accepted only near a prior.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._field, self._camera = field, camera
        self._goal = GoalPoseEstimator(field, camera) if hue_families(field) else None
        self._white_goals = None if self._goal else WhiteGoals(field, camera)
        self._has_lines = bool(len(field.lines) + len(field.arcs))
        self._lines_first = self._has_lines and not camera.known_orientation and not field.shows_half

    @cached_property
    def _by_edges(self) -> TiltFinder:
        return TiltFinder(self._field, self._camera)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera, frame = evidence.camera, evidence.frame
        assert isinstance(camera, PinholeCamera)
        start = pose_of(prior)
        near = None if start is None else start.compose(camera.camera_in_robot)
        if self._lines_first:
            found = self._by_edges.find(frame)
            if found:
                return _seen(found, found.estimate, camera)
        if self._white_goals is not None:
            found = self._by_edges.judge(frame, self._white_goals.proposed(frame, near))
            return (
                Localization(found, camera) if isinstance(found, NotLocated) else _seen(found, found.estimate, camera)
            )
        assert self._goal is not None
        placed = self._goal.locate_camera(frame, near)
        if isinstance(placed, NotLocated):
            by_lines = None if near is None or self._lines_first else self._near(frame, near, camera)
            return Localization(placed, camera) if by_lines is None else by_lines
        p = [float(value) for value in placed.unknowns]
        fu, fv = camera.focal_px
        scale = math.exp(p[LOG_FOCAL])
        oriented = camera.as_fitted(p[TILT], p[ROLL], p[HEIGHT], (fu * scale, fv * scale))
        pose = placed.estimate(near).seen_from(oriented.camera_in_robot.inverse())
        return Localization(pose, oriented, tells_half=len(pose.candidates) == 1)

    def _near(self, frame: UInt8Array, prior: Pose2, camera: PinholeCamera) -> Localization | None:
        """Locate the camera by lines near a prior pose of it."""
        found = self._by_edges.find(frame) if self._has_lines else None
        if not found:
            return None
        turned = found.estimate.half_turn()
        near = min(found.estimate, turned, key=lambda one: one.pose.error_to(prior)[0])
        distance_m, angle_rad = near.pose.error_to(prior)
        assert self._goal is not None
        settings = self._goal.settings.prior
        is_near = distance_m <= 3 * settings.std_m and angle_rad <= 3 * settings.std_rad
        return _seen(found, near, camera) if is_near else None


class WhiteGoals:
    """Proposes cameras that may see a white goal of a field."""

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._search = GoalSearch(field, camera)

    def proposed(self, frame: UInt8Array, near: Pose2 | None = None) -> list[TiltedPose]:
        """Return cameras of one BGR frame, the likeliest first; half a goal may do near a prior pose of the camera."""
        picture = self._search.picture(frame)
        candidates, _ = self._search.candidates(picture)
        part = None if near is None else find_half_goal(self._search, picture, near)
        seen = [*candidates[:_MAX_PROPOSALS], *([] if part is None else [part])]
        return [TiltedPose(*one.fit.unknowns[[X, Y, HEADING, TILT, ROLL]].tolist()) for one in seen]


def _seen(found: FollowedCamera, estimate: PoseEstimate, camera: PinholeCamera) -> Localization:
    oriented = found.as_fitted(camera)
    return Localization(estimate.seen_from(oriented.camera_in_robot.inverse()), oriented)
