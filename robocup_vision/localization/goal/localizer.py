"""Where the camera stands, from one picture of a goal: the direct fit, with the field's lines where they are in view.

Yako et al.'s method is kept beside it, to measure against.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.baselines.goal_angles import PaperMethod
from robocup_vision.localization.goal.arc import follow_arc
from robocup_vision.localization.goal.edges import measure
from robocup_vision.localization.goal.fit import INLIER_PX, MIN_ELEMENT_SHARE, GoalFit, covariance_of, residuals
from robocup_vision.localization.goal.geometry import BAR_TOP, HEADING, LOG_FOCAL, TILT, IdealView, X, Y, pose_of
from robocup_vision.localization.goal.half_goal import PRIOR_STD_M, PRIOR_STD_RAD, find_half_goal, under_prior
from robocup_vision.localization.goal.marks import SURE_M, GoalMarks
from robocup_vision.localization.goal.profile import polish
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.goal.with_lines import (
    LineFit,
    expected_ridges,
    fit_goal_and_lines,
    fit_ridges,
    line_points,
    line_starts,
    loosened,
)
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.goal_color import hue_masks

Method = Literal["edges", "paper", "angles"]

_MAX_LINE_TRIALS = 2
# goals of a hue that lines may choose among, and how much worse they may be than the best
_MAX_RIVALS, _NEARLY = 3, 0.1
_MIN_LINE_POINTS = 20
_POST_REACH_PX = 3.0
# so many places along lines in view, and lines that are not there speak against a white goal
_TELLING_RIDGES = 60
_MIN_ALONE_SCORE = 0.6
_POSE = np.ix_((X, Y, HEADING), (X, Y, HEADING))


@dataclass(frozen=True, eq=False)
class GoalSight:
    """A camera that a goal, or the lines around it, has placed; for the goal at +x.

    Parameters
    ----------
    unknowns : (8,) float64
        See goal_geometry: position, heading, tilt, roll, height among them.
    covariance : (8, 8) float64
        Of the unknowns.
    sides : tuple of int
        Which goals it can be: (1,), (-1,), or both.
    fit : GoalFit or None
        The goal's own fit; None: lines alone.
    lines : LineFit or None
        The fit with lines; None: the goal alone.
    """

    unknowns: FloatArray
    covariance: FloatArray
    sides: tuple[int, ...]
    fit: GoalFit | None
    lines: LineFit | None

    def estimate(self, prior: Pose2 | None = None) -> PoseEstimate:
        """Camera position on the floor and heading of the optical axis; of two candidates the prior's comes first."""
        estimate = _estimate(self)
        if prior is not None and len(estimate.candidates) > 1:
            near, far = (math.hypot(c.x_m - prior.x_m, c.y_m - prior.y_m) for c in estimate.candidates)
            estimate = estimate.half_turn() if far < near else estimate
        return estimate


class GoalLocalizer:
    """Camera position on the floor and heading of its optical axis, from posts and bar.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    camera : PinholeCamera
        Pan, tilt and roll may be unknown.
    use_lines : bool
        Fit the field's lines together with the goal wherever they are in view.
    method : {"edges", "paper", "angles"}
        The direct fit to silhouette edges; Yako et al.'s method as printed; or its angles with their closed form. The
        last two need coloured goals and use neither lines nor a prior.

    Raises
    ------
    ArgumentError
        If the field has no such goals, or the method is unknown or cannot see them.
    """

    def __init__(
        self, field: Field, camera: PinholeCamera, *, use_lines: bool = True, method: Method = "edges"
    ) -> None:
        if method not in ("edges", "paper", "angles"):
            raise ArgumentError(f"method must be 'edges', 'paper' or 'angles', got {method!r}")
        self.field = field
        self.camera = camera
        self.method = method
        self._search = GoalSearch(field, camera)
        self._lines = LineMap(field) if use_lines and len(field.lines) + len(field.arcs) else None
        self._marks = GoalMarks(self._lines, camera) if self._lines is not None else None
        self._paper: PaperMethod | None = None
        if method != "edges":
            if not self._search.families:
                raise ArgumentError(
                    f"method '{method}' finds goals by their hue, but those of '{field.name}' are white"
                )
            self._paper = PaperMethod(self._search.shape, camera, np.abs(field.floor_polygon).max(axis=0))

    def locate(self, frame: UInt8Array, prior: Pose2 | None = None) -> PoseEstimate | NotLocated:
        """Locate the camera.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        prior : Pose2, optional
            Roughly where the camera is (0.4 m, 9 degrees, one standard deviation). Where no whole goal is seen, half a
            goal or the lines are then tried from there, and of two candidates half a turn apart the nearer comes first.

        Raises
        ------
        FrameError
            If the frame has the wrong type, shape or size.
        """
        self._check(frame)
        if self._paper is not None:
            return self._as_printed(self._paper, frame)
        sight = self.look(frame, prior)
        if isinstance(sight, NotLocated):
            return sight
        return sight.estimate(prior)

    def look(self, frame: UInt8Array, prior: Pose2 | None = None) -> GoalSight | NotLocated:
        """Place the camera as `locate` does, with its tilt, roll and height and what was measured."""
        self._check(frame)
        candidates, reason = self._search.candidates(frame)
        if candidates and candidates[0].objection is None and candidates[0].model is self._search.colored_model:
            return self._colored(frame, candidates)
        for candidate in candidates[: _MAX_LINE_TRIALS if self._lines is not None else 0]:
            joined = self._with_lines(frame, candidate)
            if joined is not None:
                return joined
        for candidate in candidates:
            if candidate.objection is not None:
                break
            if self._lines is not None and self._contradicted(candidate):
                reason = "no whole goal: what looks like one would have field lines in view that are not there"
                continue
            if candidate.model is self._search.white_model and not _is_plain(candidate):
                reason = "no certain goal: white posts and bar are too faint among the clutter to count without lines"
                continue
            return _goal_alone(candidate)
        if prior is None:
            return NotLocated(reason)
        by_lines = self._by_lines(frame, prior) if self._lines is not None else None
        if by_lines is not None:
            return by_lines
        part = find_half_goal(self._search, frame, prior)
        return (
            _goal_alone(part) if part is not None else NotLocated(f"{reason}; nor does enough of it bear out the prior")
        )

    def _colored(self, frame: UInt8Array, candidates: list[Candidate]) -> GoalSight:
        """Make a goal of a hue, which is certain, exact by its profiles, and by the lines where they bear it out."""
        best = candidates[0]
        rivals = [
            c
            for c in candidates[:_MAX_RIVALS]
            if c.objection is None and c.model is best.model and c.rank > best.rank - _NEARLY
        ]
        alone = None
        for candidate in rivals:
            fine = polish(frame, self.camera, candidate.model, candidate.fit, candidate.look)
            alone = alone or replace(candidate, fit=fine)
            joined = self._marks.join(frame, candidate.model, fine) if self._marks is not None else None
            if joined is not None:
                return GoalSight(joined[1].unknowns, joined[1].covariance, candidate.sides, fine, joined[1])
        assert alone is not None
        return _goal_alone(alone)

    def _with_lines(self, frame: UInt8Array, candidate: Candidate) -> GoalSight | None:
        """Fit goal and lines together; None where lines do not bear the goal out."""
        assert self._lines is not None
        start, samples = candidate.fit.unknowns, candidate.fit.samples
        if np.any(np.abs(start[:2]) > 2 * self._search.extent_m):
            return None
        model = loosened(candidate.model)
        if candidate.model is self._search.white_model:
            points = line_points(frame, self.camera, start, self.field.line_width_m)
            if len(points) >= _MIN_LINE_POINTS:
                tried = [
                    fit_goal_and_lines(self.camera, model, p, samples, points, self._lines)
                    for p in (start, *line_starts(model, start, points, self._lines))
                ]
                rough = [t for t in tried if t is not None]
                start = max(rough, key=lambda t: t.line_share).unknowns if rough else start
        joined = fit_ridges(frame, self.camera, model, start, samples, self._lines, self.field.line_width_m)
        if joined is None or np.any(np.abs(joined.unknowns[:2]) > self._search.extent_m):
            return None
        if candidate.objection is not None and not self._both_posts_stand(frame, candidate, joined.unknowns):
            return None
        return GoalSight(joined.unknowns, joined.covariance, candidate.sides, candidate.fit, joined)

    def _both_posts_stand(self, frame: UInt8Array, candidate: Candidate, unknowns: FloatArray) -> bool:
        """Whether both posts are near where the lines put them, as near as goals are built."""
        scale = math.exp(float(unknowns[LOG_FOCAL]))
        fu, fv = self.camera.focal_px
        view = IdealView((fu * scale, fv * scale), self.camera.center_px)
        model = candidate.model
        samples = measure(frame, self.camera, view, model.shape, unknowns, _POST_REACH_PX, candidate.look)
        if samples is None:
            return False
        near = np.abs(residuals(model, samples, unknowns)[: len(samples.edge)]) < _POST_REACH_PX
        share = np.bincount(samples.edge[near], minlength=6) / np.maximum(samples.expected, 4)
        # before a bright wall one edge of a post may be all there is
        return bool(min(max(share[0], share[1]), max(share[2], share[3])) >= MIN_ELEMENT_SHARE)

    def _contradicted(self, candidate: Candidate) -> bool:
        """Whether a white goal, found among clutter, promises many lines: had they been there, they had been found."""
        assert self._lines is not None
        if candidate.model is not self._search.white_model:
            return False
        return (
            expected_ridges(self.camera, candidate.fit.unknowns, self._lines, self.field.line_width_m)
            >= _TELLING_RIDGES
        )

    def _by_lines(self, frame: UInt8Array, prior: Pose2) -> GoalSight | None:
        """Lines alone, from where the camera is believed to be; its tilt is searched where it is unknown."""
        assert self._lines is not None
        model = loosened(self._search.white_model)
        p = model.prior.copy()
        p[[X, Y, HEADING]] = prior.array
        tilts = [float(p[TILT])] if model.weight[TILT] > 0 else np.arange(-0.45, 0.3, 0.05).tolist()
        best: LineFit | None = None
        for tilt in tilts:
            p[TILT] = tilt
            points = line_points(frame, self.camera, p, self.field.line_width_m)
            if len(points) < _MIN_LINE_POINTS:
                continue
            held = under_prior(model, prior)
            held.prior[TILT] = tilt
            rough = fit_goal_and_lines(self.camera, held, p, None, points, self._lines)
            if rough is not None and (best is None or rough.line_share > best.line_share):
                best = rough
        if best is None:
            return None
        joined = fit_ridges(frame, self.camera, model, best.unknowns, None, self._lines, self.field.line_width_m)
        if joined is None:
            return None
        offset = math.hypot(joined.unknowns[X] - prior.x_m, joined.unknowns[Y] - prior.y_m)
        turn = abs(wrap_angle(float(joined.unknowns[HEADING]) - prior.theta_rad))
        if offset > 3 * PRIOR_STD_M or turn > 3 * PRIOR_STD_RAD:
            return None
        return GoalSight(joined.unknowns, joined.covariance, (1,), None, joined)

    def _as_printed(self, paper: PaperMethod, frame: UInt8Array) -> PoseEstimate | NotLocated:
        """Yako et al.: the colour with the larger region is the goal in view."""
        smooth = np.asarray(cv2.bilateralFilter(frame, 5, 30, 3), np.uint8)
        masks = hue_masks(smooth, self._search.families)
        color = max(masks, key=lambda name: int(cv2.countNonZero(masks[name])))
        estimate = paper.locate(masks[color], closed_form=self.method == "angles")
        at_positive = any(goal.side > 0 for goal in self.field.goals if goal.color == color)
        return estimate if isinstance(estimate, NotLocated) or at_positive else estimate.half_turn()

    def _check(self, frame: UInt8Array) -> None:
        width, height = self.camera.size_px
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.shape != (height, width, 3):
            got = f"{frame.dtype} {frame.shape}" if isinstance(frame, np.ndarray) else type(frame).__name__
            raise FrameError(f"frame must be uint8 ({height}, {width}, 3) as camera.toml says, got {got}")


def _is_plain(candidate: Candidate) -> bool:
    """Whether a white goal is one without lines to confirm it: the net's own bar, below, must not pass for the bar."""
    return bool(candidate.fit.share[BAR_TOP] >= MIN_ELEMENT_SHARE and candidate.fit.score >= _MIN_ALONE_SCORE)


def _goal_alone(candidate: Candidate) -> GoalSight:
    found, model = candidate.fit, candidate.model
    covariance = covariance_of(model, found.information)
    std = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    if std > SURE_M:
        covariance = follow_arc(model, found.samples, found.unknowns, std).covariance_about(found.unknowns)
    return GoalSight(found.unknowns, covariance, candidate.sides, found, None)


def _estimate(sight: GoalSight) -> PoseEstimate:
    if sight.lines is not None:
        residual, share = sight.lines.residual_px, sight.lines.line_share
    else:
        assert sight.fit is not None
        edges = sight.fit.residual_px[: len(sight.fit.samples.edge)]
        residual = edges[np.abs(edges) < INLIER_PX]
        share = len(residual) / max(len(edges), 1)
    covariance = sight.covariance[_POSE]
    pose = pose_of(sight.unknowns)
    estimate = PoseEstimate(
        pose,
        (covariance + covariance.T) / 2,
        share,
        float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0,
        (pose,) if len(sight.sides) == 1 else (pose, pose.half_turn()),
    )
    return estimate.half_turn() if sight.sides[0] < 0 else estimate
