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
from robocup_vision.localization.goal.half_goal import PRIOR_STD_M, PRIOR_STD_RAD, find_half_goal
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.localizer import FrameByFrame, FrameEvidence, Localization
from robocup_vision.localization.model_edges.finder import TiltedPose
from robocup_vision.localization.model_edges.follower import FollowedCamera
from robocup_vision.localization.model_edges.tilt_finder import TiltFinder
from robocup_vision.perception.goal_region import hue_families

# number of goals in a picture that are fitted to all edges: more are clutter
_MAX_PROPOSALS = 8


class GoalLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "goal": posts and bar, with the lines around them. The tilt may be unknown."""

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._goals = HueGoals(field, camera) if hue_families(field) else WhiteGoals(field, camera)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        start = pose_of(prior)
        near = None if start is None else start.compose(camera.camera_in_robot)
        return self._goals.locate(evidence.frame, camera, near)


class _Goals:
    """A field's goals, and the finder that fits all edges of it."""

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._field, self._camera = field, camera
        self._has_lines = field.has_lines

    @cached_property
    def _by_edges(self) -> TiltFinder:
        return TiltFinder(self._field, self._camera)


class HueGoals(_Goals):
    """Locates a camera by a goal of a hue, which is measured by itself, and its lines with it.

    If no goal is found, lines are tried: where the tilt is unknown and both halves of the field look alike they come
    first, as they determine tilt and pose in most pictures; else their pose is accepted only near a prior.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        super().__init__(field, camera)
        self._goal = GoalPoseEstimator(field, camera)
        self._lines_first = self._has_lines and not camera.known_orientation and not field.shows_half

    def locate(self, frame: UInt8Array, camera: PinholeCamera, near: Pose2 | None) -> Localization:
        """Locate a camera by one BGR frame; `near` is its prior pose."""
        if self._lines_first:
            found = self._by_edges.find(frame)
            if found:
                return _seen(found, found.estimate, camera)
        placed = self._goal.locate_camera(frame, near)
        if isinstance(placed, NotLocated):
            by_lines = None if near is None or self._lines_first else self._by_lines(frame, near, camera)
            return by_lines or Localization(placed, camera)
        p = [float(value) for value in placed.unknowns]
        fu, fv = camera.focal_px
        scale = math.exp(p[LOG_FOCAL])
        oriented = camera.as_fitted(p[TILT], p[ROLL], p[HEIGHT], (fu * scale, fv * scale))
        pose = placed.estimate(near).seen_from(oriented.camera_in_robot.inverse())
        return Localization(pose, oriented, tells_half=len(pose.candidates) == 1)

    def _by_lines(self, frame: UInt8Array, prior: Pose2, camera: PinholeCamera) -> Localization | None:
        """Locate a camera by lines near its prior pose."""
        found = self._by_edges.find(frame) if self._has_lines else None
        if not found:
            return None
        near = _nearer(found.estimate, prior)
        distance_m, angle_rad = near.pose.error_to(prior)
        is_near = distance_m <= 3 * PRIOR_STD_M and angle_rad <= 3 * PRIOR_STD_RAD
        return _seen(found, near, camera) if is_near else None


class WhiteGoals(_Goals):
    """Proposes cameras that may see a white goal, where lines leave a doubt.

    They are fitted to all edges of the field and judged by them, as those that lines propose are.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        super().__init__(field, camera)
        self._search = GoalSearch(field, camera)

    def locate(self, frame: UInt8Array, camera: PinholeCamera, near: Pose2 | None) -> Localization:
        """Locate a camera by one BGR frame; `near` is its prior pose, from which half a goal is proposed, too."""
        if self._has_lines:
            found = self._by_edges.find_with(frame, self.proposed)
        else:
            found = self._by_edges.judge(frame, self.proposed(frame))
        if not found and near is not None:
            half = self._proposed_near(frame, near)
            found = self._by_edges.judge(frame, half) if half else found
        if isinstance(found, NotLocated):
            return Localization(found, camera)
        estimate = found.estimate if near is None or found.tells_half else _nearer(found.estimate, near)
        return _seen(found, estimate, camera)

    def proposed(self, frame: UInt8Array) -> list[TiltedPose]:
        """Return cameras of one BGR frame that may see a whole goal, the likeliest first."""
        candidates, _ = self._search.candidates(self._search.picture(frame))
        return [_camera_of(one) for one in candidates[:_MAX_PROPOSALS]]

    def _proposed_near(self, frame: UInt8Array, prior: Pose2) -> list[TiltedPose]:
        part = find_half_goal(self._search, self._search.picture(frame), prior)
        return [] if part is None else [_camera_of(part)]


def _camera_of(candidate: Candidate) -> TiltedPose:
    return TiltedPose(*candidate.fit.unknowns[[X, Y, HEADING, TILT, ROLL]].tolist())


def _nearer(estimate: PoseEstimate, prior: Pose2) -> PoseEstimate:
    """Return an estimate or its half turn about the field's centre, whichever is nearer a prior pose."""
    return min(estimate, estimate.half_turn(), key=lambda one: one.pose.error_to(prior)[0])


def _seen(found: FollowedCamera, estimate: PoseEstimate, camera: PinholeCamera) -> Localization:
    oriented = found.as_fitted(camera)
    return Localization(estimate.seen_from(oriented.camera_in_robot.inverse()), oriented)
