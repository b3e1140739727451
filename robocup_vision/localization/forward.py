"""Localises a robot by a pinhole camera: by a picture of a goal, by the field's lines, or by the walls' feet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import HEIGHT, LOG_FOCAL, ROLL, TILT
from robocup_vision.localization.goal.half_goal import PriorSettings
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.lines.nearby import locate_nearby
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from robocup_vision.localization.lines.walls import wall_points, wall_pose_estimator
from robocup_vision.localization.localizer import (
    FrameByFrame,
    FrameEvidence,
    Localization,
    pose_of,
)
from robocup_vision.localization.model_edges.tilt_finder import TiltFinder
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.line_points import LinePoints


@dataclass(frozen=True, slots=True)
class NarrowViewSettings:
    """Settings of the methods "field" and "floor" of a camera with a narrow view.

    Parameters
    ----------
    min_inlier_ratio : float
        Of the line points, those that must agree without a prior: few lines are in view, and other poses explain them
        nearly as well.
    min_lines : int
        Lines that must agree without a prior: two lines are any corner of the field.
    min_ratio_on_line : float
        Of the points, those that make a line count.
    on_line_widths : float
        So near to a line, in line widths, a point is on it.
    min_edge_contrast : float
        An edge of the floor differs by this many times the floor's noise.
    """

    min_inlier_ratio: float = 0.75
    min_lines: int = 3
    min_ratio_on_line: float = 0.08
    on_line_widths: float = 2.0
    min_edge_contrast: float = 5.0


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


class LineLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "field" of a pinhole camera whose tilt is known: by the field's lines."""

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        mask: UInt8Array | None = None,
        settings: NarrowViewSettings = NarrowViewSettings(),
    ) -> None:
        self._field = field
        self._camera = camera
        self._lines = LinePoseEstimator(field, camera, mask)
        self._settings = settings

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        points = self._lines.finder.find(evidence.frame)
        # the line points are those of the pan in the camera file: a robot turned by what the head has turned since
        turned = camera.camera_in_robot.compose(self._camera.camera_in_robot.inverse())
        if prior is None:
            pose = self._without_prior(points)
            answer = Localization(pose, self._camera)
        else:
            near = prior.seen_from(turned) if isinstance(prior, PoseEstimate) else prior.compose(turned)
            answer = _refined(points, self._lines, near, self._camera)
        if camera.camera_in_robot == self._camera.camera_in_robot:
            return answer
        assert isinstance(answer.camera, PinholeCamera)
        pose = answer.pose
        return Localization(
            pose if isinstance(pose, NotLocated) else pose.seen_from(turned.inverse()),
            camera.with_orientation(camera.pan_rad, answer.camera.tilt_rad, answer.camera.roll_rad),
        )

    def _without_prior(self, points: LinePoints) -> PoseEstimate | NotLocated:
        settings, lines = self._settings, self._lines
        estimate = lines.locate(points)
        if not isinstance(estimate, PoseEstimate):
            return estimate
        if estimate.inlier_ratio < settings.min_inlier_ratio:
            ratio = f"{estimate.inlier_ratio:.0%}"
            return NotLocated(f"only {ratio} of the line points lie on lines: too few for so narrow a view")
        nearest = lines.line_map.nearest(estimate.pose.transform(points.floor_m))
        near = nearest.distance_m < settings.on_line_widths * self._field.line_width_m
        on_each = np.bincount(nearest.index[near])
        count = int(np.count_nonzero(on_each >= max(settings.min_ratio_on_line * len(points), 10)))
        if count < settings.min_lines:
            return NotLocated(f"{count} lines in view, which without a prior fit many a corner of the field")
        return estimate


class WallLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "floor" of a pinhole camera whose tilt is known: by the feet of walls or boards."""

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        mask: UInt8Array | None = None,
        settings: NarrowViewSettings = NarrowViewSettings(),
    ) -> None:
        self._walls = wall_pose_estimator(field, camera)
        self._settings = settings

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        camera, view = evidence.camera, evidence.view
        assert isinstance(camera, PinholeCamera)
        if evidence.table is None or not isinstance(view, FloorView):
            return Localization(NotLocated("no floor is found: nothing below the horizon looks like carpet"), camera)
        if prior is None:
            # a sway of half a degree makes three walls fit elsewhere, and fit well
            return Localization(
                NotLocated("a pinhole camera sees too little of the floor's edge to do without a prior"), camera
            )
        min_contrast = self._settings.min_edge_contrast * evidence.table.colors.floor.noise
        points = wall_points(evidence.frame, view, evidence.floor_column, view.hidden_px, min_contrast)
        answer = _refined(points, self._walls, prior, camera)
        if isinstance(answer.pose, NotLocated):
            reason = f"the floor's edge, by lines where the walls stand: {answer.pose.reason}"
            return answer._replace(pose=NotLocated(reason))
        return answer


def _refined(
    points: LinePoints, lines: LinePoseEstimator, prior: PoseEstimate | Pose2, camera: PinholeCamera
) -> Localization:
    """Refine a prior by line points, together with the camera's tilt and roll."""
    if isinstance(prior, Pose2):
        known = PriorSettings()
        prior = PoseEstimate(prior, np.diag([known.std_m, known.std_m, known.std_rad]) ** 2, 1.0, 0.0)
    return Localization(*locate_nearby(points, lines.line_map, prior, camera))
