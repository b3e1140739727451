"""Locates a pinhole camera by one picture of a goal, with the field's lines where they are in view."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array, plain_frame
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, goal_alone, shown_ratios
from robocup_vision.localization.goal.colored_goals import ColoredGoals, ColoredGoalSettings
from robocup_vision.localization.goal.colored_lines import ColoredLineSettings
from robocup_vision.localization.goal.fit import GoalFitSettings
from robocup_vision.localization.goal.geometry import BAR_TOP, HEADING, TILT, X, Y
from robocup_vision.localization.goal.half_goal import PriorSettings, find_half_goal, under_prior
from robocup_vision.localization.goal.line_marks import LineFit
from robocup_vision.localization.goal.search import Candidate, GoalSearch, SearchSettings
from robocup_vision.localization.goal.white_lines import WhiteGoalLines, WhiteLineSettings, loosened
from robocup_vision.localization.lines.line_map import LineMap


@dataclass(frozen=True, slots=True)
class GoalSettings:
    """Settings of `GoalPoseEstimator`.

    Parameters
    ----------
    search : SearchSettings
        How goals are found.
    fit : GoalFitSettings
        How a camera is fitted to one, and when it is one.
    white_lines : WhiteLineSettings
        How lines are fitted together with a white goal, and without a goal.
    colored_lines : ColoredLineSettings
        How lines are fitted together with a goal of a hue.
    colored : ColoredGoalSettings
        Which of several goals of a hue it is.
    prior : PriorSettings
        How well a prior pose is known.
    max_line_trials : int
        So many candidates, the best ones, are tried with lines.
    min_line_points : int
        White line points from which a frame's lines are fitted.
    post_reach_px : float
        How far from where lines put it a post of a white goal may stand: as near as goals are built.
    telling_marks : int
        So many places on lines predicted in view, and lines that are not seen speak against a white goal.
    min_alone_score : float
        Score from which a white goal counts without lines.
    """

    search: SearchSettings = field(default_factory=SearchSettings)
    fit: GoalFitSettings = field(default_factory=GoalFitSettings)
    white_lines: WhiteLineSettings = field(default_factory=WhiteLineSettings)
    colored_lines: ColoredLineSettings = field(default_factory=ColoredLineSettings)
    colored: ColoredGoalSettings = field(default_factory=ColoredGoalSettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
    max_line_trials: int = 2
    min_line_points: int = 20
    post_reach_px: float = 3.0
    telling_marks: int = 60
    min_alone_score: float = 0.6


class GoalPoseEstimator:
    """Camera position on the floor and heading of its optical axis, from posts and bar.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    camera : PinholeCamera
        Pan, tilt and roll may be unknown.
    use_lines : bool
        Fit the field's lines together with the goal wherever they are in view.
    settings : GoalSettings, optional
        Thresholds of search and fit.

    Raises
    ------
    ArgumentError
        If the field has no such goals.
    """

    def __init__(
        self, field: Field, camera: PinholeCamera, *, use_lines: bool = True, settings: GoalSettings = GoalSettings()
    ) -> None:
        self.field = field
        self.camera = camera
        self.settings = settings
        self._search = GoalSearch(field, camera, settings.search, settings.fit)
        line_map = LineMap(field) if use_lines and len(field.lines) + len(field.arcs) else None
        self._white_lines = None if line_map is None else WhiteGoalLines(line_map, camera, settings.white_lines)
        self._colored = ColoredGoals(self._search, line_map, settings.colored, settings.colored_lines)

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
        found = self.locate_camera(frame, prior)
        return found if isinstance(found, NotLocated) else found.estimate(prior)

    def locate_camera(self, frame: UInt8Array, prior: Pose2 | None = None) -> CameraEstimate | NotLocated:
        """Locate the camera as `locate` does, with its tilt, roll and height and what was measured."""
        self._check(frame)
        frame = plain_frame(frame)
        picture = self._search.picture(frame)
        candidates, reason = self._search.candidates(picture)
        colored = [c for c in candidates if c.model is self._search.colored_model]
        if colored and candidates[0] is colored[0]:
            placed = self._colored.locate(picture, colored)
            if isinstance(placed, CameraEstimate):
                return placed
            if placed is not None:
                reason, candidates = placed.reason, []
        for candidate in candidates[: self.settings.max_line_trials]:
            joined = self._with_lines(frame, candidate)
            if joined is not None:
                return joined
        for candidate in candidates:
            if candidate.objection is not None:
                break
            if self._is_contradicted(candidate):
                reason = "no whole goal: what looks like one would have field lines in view that are not there"
                continue
            if candidate.model is self._search.white_model and not self._is_plain(candidate):
                reason = "no certain goal: white posts and bar are too faint among the clutter to count without lines"
                continue
            return goal_alone(candidate, self.settings.colored_lines.certain_m)
        if prior is None:
            return NotLocated(reason)
        by_lines = self._by_lines(frame, prior)
        if by_lines is not None:
            return by_lines
        part = find_half_goal(self._search, picture, prior, self.settings.prior)
        if part is None:
            return NotLocated(f"{reason}; too little of it confirms the prior")
        return goal_alone(part, self.settings.colored_lines.certain_m)

    def _with_lines(self, frame: UInt8Array, candidate: Candidate) -> CameraEstimate | None:
        """Fit goal and lines together; None where lines do not confirm the goal."""
        lines = self._white_lines
        start, samples = candidate.fit.unknowns, candidate.fit.samples
        if lines is None or np.any(np.abs(start[:2]) > 2 * self._search.extent_m):
            return None
        model = loosened(candidate.model, self.settings.white_lines)
        if candidate.model is self._search.white_model:
            points = lines.points(frame, start)
            if len(points) >= self.settings.min_line_points:
                rough = lines.fit_points(model, start, samples, points, lines.starts(model, start, points))
                start = start if rough is None else rough.unknowns
        joined = lines.fit_predicted(frame, model, start, samples)
        if joined is None or np.any(np.abs(joined.unknowns[:2]) > self._search.extent_m):
            return None
        if candidate.objection is not None and (
            shown_ratios(frame, self.camera, candidate, joined.unknowns, self.settings.post_reach_px)[:2].min()
            < self.settings.fit.min_element_ratio
        ):
            return None
        return CameraEstimate(joined.unknowns, joined.covariance, candidate.sides, candidate.fit, joined)

    def _is_contradicted(self, candidate: Candidate) -> bool:
        """Whether a white goal, found among clutter, predicts many lines: had they been there, they had been found."""
        lines = self._white_lines
        if lines is None or candidate.model is not self._search.white_model:
            return False
        return lines.expected(candidate.model, candidate.fit.unknowns) >= self.settings.telling_marks

    def _is_plain(self, candidate: Candidate) -> bool:
        """Whether a white goal counts without lines: the net's own bar, below, must not pass for the bar."""
        fit = candidate.fit
        return bool(
            fit.edge_ratio[BAR_TOP] >= self.settings.fit.min_element_ratio
            and fit.score >= self.settings.min_alone_score
        )

    def _by_lines(self, frame: UInt8Array, prior: Pose2) -> CameraEstimate | None:
        """Fit lines alone about a prior pose; the tilt is searched where it is unknown."""
        lines = self._white_lines
        if lines is None:
            return None
        model = loosened(self._search.white_model, self.settings.white_lines)
        p = model.prior.copy()
        p[[X, Y, HEADING]] = prior.array
        tilts = [float(p[TILT])] if model.weight[TILT] > 0 else np.arange(-0.45, 0.3, 0.05).tolist()
        best: LineFit | None = None
        for tilt in tilts:
            p[TILT] = tilt
            points = lines.points(frame, p)
            if len(points) < self.settings.min_line_points:
                continue
            constrained = under_prior(model, prior, self.settings.prior)
            constrained.prior[TILT] = tilt
            rough = lines.fit_points(constrained, p, None, points)
            if rough is not None and (best is None or rough.line_ratio > best.line_ratio):
                best = rough
        if best is None:
            return None
        joined = lines.fit_predicted(frame, model, best.unknowns, None)
        if joined is None:
            return None
        offset = math.hypot(joined.unknowns[X] - prior.x_m, joined.unknowns[Y] - prior.y_m)
        turn = abs(wrap_angle(float(joined.unknowns[HEADING]) - prior.theta_rad))
        if offset > 3 * self.settings.prior.std_m or turn > 3 * self.settings.prior.std_rad:
            return None
        # lines alone may be those of either half
        sides = tuple(goal.side for goal in self._search.field.goals)
        return CameraEstimate(joined.unknowns, joined.covariance, sides, None, joined)

    def _check(self, frame: UInt8Array) -> None:
        width, height = self.camera.size_px
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.shape != (height, width, 3):
            got = f"{frame.dtype} {frame.shape}" if isinstance(frame, np.ndarray) else type(frame).__name__
            raise FrameError(f"frame must be uint8 ({height}, {width}, 3) as camera.toml says, got {got}")
