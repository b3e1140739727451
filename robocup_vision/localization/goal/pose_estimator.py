"""Locates a pinhole camera by one picture of a goal, with the field's lines where they are in view."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, plain_frame
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.goal.arc import follow_arc
from robocup_vision.localization.goal.colored_lines import ColoredGoalLines, ColoredLineSettings
from robocup_vision.localization.goal.edges import measure
from robocup_vision.localization.goal.fit import GoalFit, GoalFitSettings, covariance_of, max_prior_deviation, residuals
from robocup_vision.localization.goal.geometry import BAR_TOP, EDGES, HEADING, LOG_FOCAL, TILT, IdealView, X, Y, pose_of
from robocup_vision.localization.goal.half_goal import PriorSettings, find_half_goal, under_prior
from robocup_vision.localization.goal.line_marks import LineFit
from robocup_vision.localization.goal.profile import polish
from robocup_vision.localization.goal.search import Candidate, GoalSearch, SearchSettings
from robocup_vision.localization.goal.white_lines import WhiteGoalLines, WhiteLineSettings, loosened
from robocup_vision.localization.lines.line_map import LineMap

_POSE = np.ix_((X, Y, HEADING), (X, Y, HEADING))


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
    prior : PriorSettings
        How well a prior pose is known.
    max_line_trials : int
        So many candidates, the best ones, are tried with lines.
    max_rivals : int
        Goals of a hue that lines may choose among.
    min_overruling_ratio : float
        Of the places on lines that are due, those that must be seen before lines overrule an objection to such a goal.
    min_line_points : int
        White line points from which a frame's lines are fitted.
    post_reach_px : float
        How far from where lines put it a post of a white goal may stand: as near as goals are built.
    telling_marks, telling_hue_marks : int
        So many places on lines predicted in view, and lines that are not seen speak against a white goal, and against
        one of a hue.
    min_alone_score, min_alone_hue_score : float
        Score from which a white goal counts without lines, and from which one of a hue does on a field that has lines:
        motley clutter has up to 0.7, goals that no lamp dazzles 0.85 and more.
    clear_hue_score : float
        Score from which one of a hue counts though lines that would be in view are not seen.
    """

    search: SearchSettings = field(default_factory=SearchSettings)
    fit: GoalFitSettings = field(default_factory=GoalFitSettings)
    white_lines: WhiteLineSettings = field(default_factory=WhiteLineSettings)
    colored_lines: ColoredLineSettings = field(default_factory=ColoredLineSettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
    max_line_trials: int = 2
    max_rivals: int = 6
    min_overruling_ratio: float = 0.6
    min_line_points: int = 20
    post_reach_px: float = 3.0
    telling_marks: int = 60
    telling_hue_marks: int = 12
    min_alone_score: float = 0.6
    min_alone_hue_score: float = 0.72
    clear_hue_score: float = 0.85


@dataclass(frozen=True, eq=False)
class CameraEstimate:
    """A camera placed by a goal, by the lines around it, or by both; for the goal at +x.

    Parameters
    ----------
    unknowns : (8,) float64
        In the order of goal/geometry.py: position, heading, tilt, roll, height among them.
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
        self._white_lines: WhiteGoalLines | None = None
        self._colored_lines: ColoredGoalLines | None = None
        if use_lines and len(field.lines) + len(field.arcs):
            line_map = LineMap(field)
            self._white_lines = WhiteGoalLines(line_map, camera, settings.white_lines)
            self._colored_lines = ColoredGoalLines(line_map, camera, settings.colored_lines)

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
        candidates, reason = self._search.candidates(frame)
        colored = [c for c in candidates if c.model is self._search.colored_model]
        if colored and candidates[0] is colored[0]:
            placed = self._colored(frame, colored)
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
            return self._goal_alone(candidate)
        if prior is None:
            return NotLocated(reason)
        by_lines = self._by_lines(frame, prior)
        if by_lines is not None:
            return by_lines
        part = find_half_goal(self._search, frame, prior, self.settings.prior)
        return (
            self._goal_alone(part) if part is not None else NotLocated(f"{reason}; too little of it confirms the prior")
        )

    def _colored(self, frame: UInt8Array, candidates: list[Candidate]) -> CameraEstimate | NotLocated | None:
        """Make a goal of a hue exact by its profiles, and by the lines where they confirm it.

        Lines choose among the candidates, and may overrule an objection: where lamps draw white streaks along posts and
        bar, a streak's border passes for the silhouette, or hides it. None: only objections, and no lines against them.
        """
        settings, lines = self.settings, self._colored_lines
        alone, best, best_evidence = None, None, -math.inf
        rejected: list[tuple[float, LineFit]] = []
        for candidate in candidates[: settings.max_rivals]:
            fine = polish(frame, self.camera, candidate.model, candidate.fit, candidate.appearance)
            if candidate.objection is None:
                alone = alone or replace(candidate, fit=fine)
            joined = lines.join(frame, candidate.model, fine) if lines is not None else None
            if joined is None or joined[0] <= best_evidence:
                continue
            evidence, fit = joined
            if candidate.objection is not None and not self._is_overruled(frame, candidate, fit):
                rejected.append(joined)
                continue
            best_evidence = evidence
            best = CameraEstimate(fit.unknowns, fit.covariance, candidate.sides, fine, fit)
            is_plain = candidate.objection is None and fine.score >= settings.min_alone_hue_score
            if is_plain and fit.line_ratio >= settings.min_overruling_ratio:
                break
        if best is not None and rejected:
            evidence, rival = max(rejected, key=lambda one: one[0])
            is_elsewhere = math.dist(rival.unknowns[:2], best.unknowns[:2]) > settings.colored_lines.same_m
            if is_elsewhere and evidence > best_evidence + settings.colored_lines.clear_evidence:
                return NotLocated("no certain goal: lines fit far better about another, of which too little is seen")
        if best is not None or alone is None:
            return best
        if alone.fit.score < settings.min_alone_hue_score and lines is not None:
            return NotLocated("no certain goal: posts and bar agree too badly to count without the lines around them")
        if lines is not None and alone.fit.score < settings.clear_hue_score:
            due, seen = lines.seen(frame, alone.model, alone.fit.unknowns)
            if due >= settings.telling_hue_marks and seen < settings.min_overruling_ratio * due:
                return NotLocated("no certain goal: what looks like one would have lines in view that are not there")
        return self._goal_alone(alone)

    def _is_overruled(self, frame: UInt8Array, candidate: Candidate, lines: LineFit) -> bool:
        """Whether lines confirm a goal that seemed none: most of them are seen, and posts and bar stand after all."""
        return bool(
            lines.line_ratio >= self.settings.min_overruling_ratio
            and np.all(np.abs(lines.unknowns[:2]) <= self._search.extent_m)
            and max_prior_deviation(candidate.model, lines.unknowns) <= self.settings.fit.max_deviation
            and self._shown_ratios(frame, candidate, lines.unknowns, self.settings.fit.reaches_px[-1]).min()
            >= self.settings.fit.min_other_ratio
        )

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
                tried = [
                    lines.fit_points(model, p, samples, points) for p in (start, *lines.starts(model, start, points))
                ]
                rough = [t for t in tried if t is not None]
                start = max(rough, key=lambda t: t.line_ratio).unknowns if rough else start
        joined = lines.fit_predicted(frame, model, start, samples)
        if joined is None or np.any(np.abs(joined.unknowns[:2]) > self._search.extent_m):
            return None
        if candidate.objection is not None and (
            self._shown_ratios(frame, candidate, joined.unknowns, self.settings.post_reach_px)[:2].min()
            < self.settings.fit.min_element_ratio
        ):
            return None
        return CameraEstimate(joined.unknowns, joined.covariance, candidate.sides, candidate.fit, joined)

    def _shown_ratios(
        self, frame: UInt8Array, candidate: Candidate, unknowns: FloatArray, reach_px: float
    ) -> FloatArray:
        """(3,) float64: how much of the better edge of each post and of the bar is so near to where it is due.

        Before a bright wall one edge of a post may be all there is.
        """
        scale = math.exp(float(unknowns[LOG_FOCAL]))
        fu, fv = self.camera.focal_px
        view = IdealView((fu * scale, fv * scale), self.camera.center_px)
        model = candidate.model
        edges = self.settings.fit.edges
        samples = measure(frame, self.camera, view, model.shape, unknowns, reach_px, candidate.appearance, edges)
        if samples is None:
            return np.zeros(3)
        near = np.abs(residuals(model, samples, unknowns)[: len(samples.edge)]) < reach_px
        ratio = np.bincount(samples.edge[near], minlength=EDGES) / np.maximum(samples.expected, 4)
        return np.asarray(ratio.reshape(3, 2).max(axis=1))

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

    def _goal_alone(self, candidate: Candidate) -> CameraEstimate:
        found, model = candidate.fit, candidate.model
        covariance = covariance_of(model, found.information)
        std = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        if std > self.settings.colored_lines.certain_m:
            arc = follow_arc(model, found.samples, found.unknowns, std)
            covariance = arc.covariance_about(found.unknowns) if len(arc.cost) else covariance
        return CameraEstimate(found.unknowns, covariance, candidate.sides, found, None)

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
        return CameraEstimate(joined.unknowns, joined.covariance, (1,), None, joined)

    def _check(self, frame: UInt8Array) -> None:
        width, height = self.camera.size_px
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.shape != (height, width, 3):
            got = f"{frame.dtype} {frame.shape}" if isinstance(frame, np.ndarray) else type(frame).__name__
            raise FrameError(f"frame must be uint8 ({height}, {width}, 3) as camera.toml says, got {got}")


def _estimate(camera: CameraEstimate) -> PoseEstimate:
    if camera.lines is not None:
        residual, ratio = camera.lines.residual_px, camera.lines.line_ratio
    else:
        assert camera.fit is not None
        edges = camera.fit.residual_px[: len(camera.fit.samples.edge)]
        residual = edges[np.abs(edges) < camera.fit.settings.inlier_px]
        ratio = len(residual) / max(len(edges), 1)
    covariance = camera.covariance[_POSE]
    pose = pose_of(camera.unknowns)
    estimate = PoseEstimate(
        pose,
        (covariance + covariance.T) / 2,
        ratio,
        float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0,
        (pose,) if len(camera.sides) == 1 else (pose, pose.half_turn()),
    )
    return estimate.half_turn() if camera.sides[0] < 0 else estimate
