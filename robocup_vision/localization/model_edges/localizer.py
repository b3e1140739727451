"""Localises a pinhole camera by all edges in view: follows it by a prior, or finds it without one (a `Localizer`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.distinct import may_be_one
from robocup_vision.localization.forward import GoalLocalizer, WhiteGoals
from robocup_vision.localization.localizer import FrameEvidence, Localization
from robocup_vision.localization.model_edges.finder import EdgeFinder, for_walled_fields
from robocup_vision.localization.model_edges.follower import ODDS_MEMORY_S, EdgeFollower, FollowedCamera, FollowerState
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.perception.goal_region import hue_families

# edge points, or a function that makes them
_Points = EdgePoints | Callable[[], EdgePoints]
_USUAL_STEP_S = 1 / 30  # assumed time between frames without times
# least error of a head's pan and of a prior's heading
_MIN_PAN_STD_RAD = math.radians(0.1)
# least time from a search by the bank that found nothing to the next: frames closer together show the same
_SEARCH_AGAIN_S = 0.1
# a camera located within this time is probably near its prior: odometry with an error of a tenth is off by 20 cm
# at 1 m/s
NEAR_S = 2.0
# standard deviations of a prior that is given as a pose only
_PRIOR_STD_M, PRIOR_STD_RAD = 0.15, 0.1
# a frame that confirms no pose may be blurred: it is examined again in copies reduced by these factors, if a copy has
# at least this width
_COPY_FACTORS, _MIN_COPY_PX = (2, 3), 200


def reductions(width_px: int) -> list[int]:
    """Return the factors by which a frame of this width is reduced where it is examined again."""
    return [k for k in _COPY_FACTORS if width_px >= k * _MIN_COPY_PX]


class EdgeLocalizer:
    """Method "edges": follows by a prior, or finds the robot by a bank of poses, and then by a goal."""

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        settings: EdgeSettings = EdgeSettings(),
    ) -> None:
        self.follower = EdgeFollower(field, camera, settings)
        # followers of reduced copies, by the factor of reduction
        self._copies: dict[int, EdgeFollower] = {}
        self._finder: EdgeFinder | None = None
        self._copies_finder: EdgeFinder | None = None
        self._reductions = reductions(camera.size_px[0])
        # walls' feet, which `for_walled_fields` uses, stand out in smaller copies
        self._has_walls = field.is_bounded and bool(self._reductions)
        has_posts = any(goal.kind == "posts" for goal in field.goals)
        self._has_goals_of_hue = has_posts and bool(hue_families(field))
        self._has_white_goals = has_posts and not self._has_goals_of_hue
        self._held = camera  # the camera as held in the last look
        self.forget()

    def forget(self) -> None:
        """See `Localizer.forget`."""
        self.follower.forget()
        for follower in (self.follower, *self._copies.values()):
            follower.forget_paint()
        self._last_s: float | None = None
        self._was_located = False  # whether the camera was located in the last look
        self._located_s: float | None = None  # time when it was last located
        self._failed_s: float | None = None  # time of the last search beside a prior that found nothing

    def with_camera(self, camera: PinholeCamera) -> EdgeLocalizer:
        """Return a localiser with another calibration of its camera, which continues from this one's state."""
        other = copy(self)
        other.follower = self.follower.with_camera(camera)
        other._copies = {}
        other._finder = None if self._finder is None else self._finder.with_follower(other.follower)
        other._copies_finder = None
        other._held = camera
        return other

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        self._hold(camera)
        answer: FollowedCamera | NotLocated
        points: _Points | None = None
        if prior is None:
            goals = WhiteGoals(self.follower.field, camera).proposed if self._has_white_goals else None
            answer = self._made_finder().find_with(evidence.frame, goals) if goals else self._find(evidence.frame)
        else:
            near = _camera_prior(self._as_estimate(prior), camera)
            answer, points = self._follow(evidence, near)
            if isinstance(answer, NotLocated) and evidence.may_search:
                found = self._search_beside(evidence, near)
                answer = answer if isinstance(found, NotLocated) else found
        self._was_located = bool(answer)
        self._last_s = evidence.t_s
        if answer:
            self._located_s = evidence.t_s
        is_open = isinstance(answer, NotLocated) or bool(answer.others)
        if is_open and prior is None and self._has_goals_of_hue:
            # this separate search is slow: if there is a prior, the next frame may decide instead
            of_hue = self._by_goal(evidence)
            if isinstance(of_hue, Localization):
                return of_hue
            answer = answer if of_hue is None else of_hue
        if isinstance(answer, NotLocated) and prior is None and self._has_walls:
            found = self._made_copies_finder().find(evidence.frame)
            if found:
                answer, points = found, self._follower_of(max(self._reductions)).edge_points()
                self.follower.state = self._follower_of(max(self._reductions)).state
        if isinstance(answer, NotLocated):
            return Localization(answer, camera, edge_points=points or self.follower.edge_points_when_asked())
        back = camera.camera_in_robot.inverse()
        oriented, measurement = answer.as_fitted(camera), partial(_measurement, answer, back, camera.pan_std_rad)
        seen = points or self.follower.edge_points_when_asked()
        pose, tells_half = _with_pan_error(answer.estimate.seen_from(back), camera.pan_std_rad), answer.tells_half
        return Localization(pose, oriented, None, measurement, seen, answer.camera_covariance, tells_half)

    def _hold(self, camera: PinholeCamera) -> None:
        """Take the camera's orientation at rest as joints or sensors measure it in this frame."""
        if camera is self._held or camera.is_held_as(self._held):
            return
        self._held = camera
        for follower in (self.follower, *self._copies.values()):
            follower.hold(camera)

    def _follow(
        self, evidence: FrameEvidence, near: PoseEstimate
    ) -> tuple[FollowedCamera | NotLocated, _Points | None]:
        """Follow by the frame or its reduced copies; also return the edges if not those of the follower's last fit."""
        before, dt_s = self.follower.state, self._step_s(evidence.t_s)
        answer = first = self.follower.follow(evidence.frame, near, dt_s)
        points: _Points | None = None
        if not self.follower.confirms_prior and self._was_near(evidence.t_s, ODDS_MEMORY_S):
            answer, points = self._follow_slipped(evidence, near, dt_s, before, first)
            if first and not answer:
                return answer, points
        if answer:
            return answer, points
        for reduction in self._reductions:
            copies = self._follower_of(reduction)
            copies.state = before
            found = copies.follow(evidence.frame, near, dt_s)
            if found:
                self.follower.state = copies.state
                return found, copies.edge_points_when_asked()
        return answer, points

    def _follower_of(self, reduction: int) -> EdgeFollower:
        """Return the follower of copies reduced by this factor, for frames that confirm no pose.

        The step of a blurred line is as wide as the blur: a search of a few pixels sees too little of it, and takes its
        border for something other than carpet.
        """
        if reduction not in self._copies:
            field, camera, settings = self.follower.field, self.follower.camera, self.follower.settings
            self._copies[reduction] = EdgeFollower(field, camera, settings.for_unconfirmed_frames(), reduction)
        return self._copies[reduction]

    def _follow_slipped(
        self,
        evidence: FrameEvidence,
        near: PoseEstimate,
        dt_s: float,
        before: FollowerState,
        first: FollowedCamera | NotLocated,
    ) -> tuple[FollowedCamera | NotLocated, _Points]:
        """Follow a frame that does not confirm its prior once more by a wider prior, as if the robot had slipped.

        The odds decide whether the earlier frames are right and this one shows little, or the robot has slipped. A
        frame that also confirms a slipped robot is no evidence for the prior.
        """
        follower = self.follower
        after, points = follower.state, follower.edge_points_when_asked()
        follower.state = FollowerState(before.sway, None, 0.0)
        slipped = follower.follow(evidence.frame, self._widened(near), dt_s, is_same_frame=True)
        if slipped and (not first or follower.state.log_odds > after.log_odds):
            return slipped, follower.edge_points_when_asked()
        follower.state = after
        if not first or not slipped:
            return first, points
        there = slipped.estimate
        if not may_be_one(there.pose, near.pose, there.covariance + near.covariance):
            away_m, turn_rad = there.pose.error_to(near.pose)
            place = f"a place {away_m:.2f} m and {math.degrees(turn_rad):.0f} degrees from the prior"
            return NotLocated(f"what is in view confirms {place} as well: {slipped.evidence.in_words}"), points
        return first, points

    def _was_near(self, t_s: float | None, lately_s: float) -> bool:
        """Whether the camera was located within this time; without times, in the last look."""
        if t_s is None or self._located_s is None:
            return self._was_located
        return 0.0 <= t_s - self._located_s < lately_s

    def _search_beside(self, evidence: FrameEvidence, near: PoseEstimate) -> FollowedCamera | NotLocated:
        """Search for a camera whose prior is not confirmed; all over the field only if the camera may be lost.

        A prior that continues the last answer, and is no wider than a search's proposals, is fitted and judged like one
        of them, which bounds the time of a frame. If that gives no answer, the next frame is searched.
        """
        state, finder = self.follower.state, self._made_finder()
        goes_on = self._was_located and state.last_pose is not None
        if goes_on and (near.std <= finder.proposal_std).all():
            found = finder.judge(evidence.frame, (near.pose,))
            if not found:
                self.follower.state = state
            return found
        if not self._may_search(evidence.t_s):
            return NotLocated("the last search, moments ago, found nothing")
        is_near = self._was_near(evidence.t_s, NEAR_S)
        found = self._find(evidence.frame, near.pose if is_near else None)
        self._failed_s = evidence.t_s if isinstance(found, NotLocated) else None
        return found

    def _may_search(self, t_s: float | None) -> bool:
        if t_s is None or self._failed_s is None:
            return True
        return not 0.0 <= t_s - self._failed_s < _SEARCH_AGAIN_S

    def _find(self, frame: UInt8Array, near: Pose2 | None = None) -> FollowedCamera | NotLocated:
        return self._made_finder().find(frame, near)

    def _made_finder(self) -> EdgeFinder:
        if self._finder is None:
            self._finder = EdgeFinder(self.follower)
        return self._finder

    def _made_copies_finder(self) -> EdgeFinder:
        if self._copies_finder is None:
            follower = self._follower_of(max(self._reductions))
            self._copies_finder = EdgeFinder(follower, for_walled_fields(follower.field))
        return self._copies_finder

    def _by_goal(self, evidence: FrameEvidence) -> Localization | FollowedCamera | None:
        """Search for a goal: return its pose by all edges if they confirm it, else by the goal alone.

        Glare whitens posts, and little else may be in view with a goal before an unknown wall. The goal's own verdict
        covers these cases.
        """
        alone = GoalLocalizer(self.follower.field, self._held).locate(evidence)
        if isinstance(alone.pose, NotLocated):
            return None
        camera = alone.pose.seen_from(alone.camera.camera_in_robot)
        return self._made_finder().judge(evidence.frame, camera.candidates) or alone

    def _as_estimate(self, prior: PoseEstimate | Pose2) -> PoseEstimate:
        if isinstance(prior, PoseEstimate):
            return prior
        return PoseEstimate(prior, np.diag([_PRIOR_STD_M, _PRIOR_STD_M, PRIOR_STD_RAD]) ** 2, 1.0, 0.0)

    def _widened(self, near: PoseEstimate) -> PoseEstimate:
        """Return a prior widened by the covariance of a prior that is given as a pose only."""
        return PoseEstimate(near.pose, near.covariance + self._as_estimate(near.pose).covariance, 1.0, 0.0)

    def _step_s(self, t_s: float | None) -> float:
        if t_s is None or self._last_s is None or not t_s > self._last_s:
            return _USUAL_STEP_S
        return t_s - self._last_s


def _measurement(answer: FollowedCamera, robot_in_camera: Pose2, pan_std_rad: float) -> PoseEstimate:
    """Return the robot's pose by the frame alone."""
    return _with_pan_error(answer.measurement.seen_from(robot_in_camera), pan_std_rad)


def _with_pan_error(robot: PoseEstimate, pan_std_rad: float) -> PoseEstimate:
    if not pan_std_rad:
        return robot
    return replace(robot, covariance=robot.covariance + np.diag([0.0, 0.0, pan_std_rad**2]))


def _camera_prior(robot: PoseEstimate, camera: PinholeCamera) -> PoseEstimate:
    """Return the camera's prior by the robot's, including the error of the pan."""
    mount = camera.camera_in_robot
    if mount.x_m or mount.y_m:
        robot = robot.seen_from(mount)
        pose = robot.pose
    else:
        pose = robot.pose.compose(mount)
    pan_std_rad = max(camera.pan_std_rad, _MIN_PAN_STD_RAD)
    covariance: FloatArray = robot.covariance + np.diag([0.0, 0.0, pan_std_rad**2])
    return PoseEstimate(pose, covariance, robot.inlier_ratio, robot.residual_px)
