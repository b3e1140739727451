"""Field lines around a goal: measured near where the goal's own fit predicts them, they make its pose exact.

A goal far away hardly determines how obliquely it is seen. A line's middle is measured to a fraction of a pixel even
where the line looks thinner than one: in brightness, which cameras store at full resolution. Each place on a line is
one more sample of the goal's own fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.lines.marked_cameras import (
    MarkModel,
    MarkReach,
    SeenMarks,
    choose_marks,
    due_marks,
    fit_marked,
    gather_marks,
    mark_evidence,
)
from robocup_vision.kernels.goal.lines.marks import MarkLimits, MarkPlaces, measure_ridges
from robocup_vision.kernels.goal.lines.reweighting import Reweighting, fit_reweighted, goal_misfit
from robocup_vision.localization.goal.arc import GoalArc, at_one_heading, open_arc
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, LineFit
from robocup_vision.localization.goal.drawing import LineDrawing, line_pen
from robocup_vision.localization.goal.edges import from_ideal, no_samples
from robocup_vision.localization.goal.fit import (
    GoalFit,
    GoalModel,
    covariance_of,
    fit_samples,
    sample_residuals,
)
from robocup_vision.localization.goal.geometry import HEADING
from robocup_vision.localization.goal.search import Candidate
from robocup_vision.localization.lines.line_map import LineMap


@dataclass(frozen=True, slots=True)
class GoalLineSettings:
    """Settings of the fit of a goal of a hue and the lines around it."""

    spacing_px: float = 6.0  #: between places on a line
    #: lines that look narrower are left out; those thinner than a pixel are averaged along themselves
    min_width_px: float = 0.15
    clear_px: float = 2.5  #: between the edges of two lines; where they come nearer, both are left out
    along_px: float = 3.0  #: length of line over which one place is averaged
    #: longest search from a line's predicted place, and the loss's scale, round by round
    reaches_px: tuple[float, ...] = (8.0, 4.0, 2.5)
    scales_px: tuple[float, ...] = (3.0, 1.5, 1.0)
    #: length of a search, in standard deviations of the prediction, and its margin
    reach_stds: float = 3.0
    min_reach_px: float = 1.5
    marks: MarkModel = MarkModel()  #: appearance of a line at one place, and probability of seeing one
    #: common error of all places on fields with white goals: their cameras' lenses are calibrated less exactly
    white_line_error_px: float = 1.0
    paint_error_m: float = 0.003  #: standard deviation of painted lines
    min_evidence: float = 5.0  #: least log odds of lines against clutter
    same_m: float = 0.2  #: fits nearer to each other count as one
    max_starts: int = 3  #: cameras along the goal's arc that are tried beside the goal's own
    reach_on_arc_stds: float = 2.5  #: longest way along the arc by drawn lines, in standard deviations of the fit
    min_drawn_evidence: float = 6.0  #: least log odds of drawn lines where too few places show a line
    #: a goal that leaves its camera's position more uncertain than this is searched along its arc
    certain_m: float = 0.06
    iterations: int = 4  #: steps of each round
    #: reduces the weight of edges that contradict the rest: the border of a lamp's streak along a bar, say
    reweighting: Reweighting = Reweighting()


class _Marked(NamedTuple):
    """A goal's samples with marks on lines, which of the searched places are seen, line widths and searches there."""

    samples: FitSamples
    is_seen: npt.NDArray[np.bool_]
    width: FloatArray
    reach: FloatArray


_MISFIT_SCALE_PX = 0.3  # of the loss by which a goal's own edges contradict a camera

# log-likelihood ratio; the fit; its samples
_Fitted = tuple[float, LineFit, FitSamples]


class GoalLines:
    """Fits goals of a hue and the lines of one field together."""

    def __init__(self, lines: LineMap, camera: PinholeCamera, settings: GoalLineSettings = GoalLineSettings()) -> None:
        self._settings, self._camera = settings, camera
        line_width_m = float(lines.field.line_width_m)
        self._points, self._directions = along_lines(lines)
        self._limits = MarkLimits(line_width_m, settings.spacing_px, settings.min_width_px, settings.clear_px)
        self._model = settings.marks._replace(paint_part=settings.paint_error_m / line_width_m)
        self._pen = line_pen(self._points, line_width_m)

    def join(self, frame: npt.NDArray[np.uint8], model: GoalModel, goal: Candidate) -> list[CameraEstimate]:
        """Fit goal and lines together: candidate cameras, none where no lines are in view."""
        found = goal.fit
        covariance = covariance_of(model, found.information)
        arc = open_arc(model, found, covariance, self._settings.certain_m)
        starts = [(found.unknowns, covariance)] if arc is None else self._starts(frame, model, found, arc)
        fits = [t for t in (self._from(frame, model, found, p, c) for p, c in starts) if t is not None]
        fits = [t for t in fits if t[0] >= self._settings.min_evidence]
        if arc is not None:
            drawing = LineDrawing(frame, self._pen)
            fits = self._drawn(drawing, model, fits) if fits else self._drawn_alone(drawing, model, found, arc)
        return [CameraEstimate(one.unknowns, one.covariance, goal.sides, found, one) for _, one, _ in fits]

    def nats(self, frame: npt.NDArray[np.uint8], model: GoalModel, p: FloatArray) -> tuple[float, float]:
        """Log-likelihood ratio of lines to clutter at the places where a camera (8,) predicts them, and its maximum.

        The maximum is reached where all of them are seen exactly at their places.
        """
        reach = self._settings.reaches_px[-1]
        due, is_seen = self._look_from(frame, model, p, np.zeros((len(p), len(p))), MarkReach(0.0, reach, reach))
        marked = self._gathered(no_samples().for_fit, due, is_seen)
        all_seen = np.ones(len(is_seen), np.bool_)
        most = mark_evidence(np.zeros(len(is_seen)), due.widths, due.reach, all_seen, self._model)
        return self._evidence(marked, sample_residuals(model, marked.samples, p)), float(most)

    def _drawn(self, drawing: LineDrawing, model: GoalModel, fits: list[_Fitted]) -> list[_Fitted]:
        """Settle each fit along its arc by all lines drawn."""
        settled: list[_Fitted] = []
        tried: list[FloatArray] = []
        for _, line_fit, samples in sorted(fits, key=lambda t: -t[0]):
            place = line_fit.unknowns[:2]
            if any(math.dist(place, other) < self._settings.same_m / 2 for other in tried):
                continue
            tried.append(place)
            reach = self._settings.reach_on_arc_stds * math.sqrt(line_fit.covariance[HEADING, HEADING])
            drawn = drawing.settle(model, samples, line_fit.unknowns, reach)
            if drawn is not None:
                ratio = max(line_fit.line_ratio, drawn.shown_ratio)
                moved = replace(line_fit, unknowns=drawn.unknowns, covariance=drawn.covariance, line_ratio=ratio)
                settled.append((drawn.likelihood, moved, samples))
        return settled

    def _drawn_alone(self, drawing: LineDrawing, model: GoalModel, found: GoalFit, arc: GoalArc) -> list[_Fitted]:
        """Settle the goal along its arc by all lines drawn, where too few are seen one by one."""
        if len(arc.cost) < 2:
            return []
        evidence = np.array([drawing.likelihood(model, p) for p in arc.unknowns]) - arc.cost / 2
        best = int(np.argmax(evidence))
        if evidence[best] <= 0.0:
            return []
        turns = np.abs(np.diff(arc.unknowns[:, HEADING]))
        reach = 2 * float(turns[max(best - 1, 0) : best + 1].max())
        drawn = drawing.settle(model, found.samples.for_fit, arc.unknowns[best], reach, loose=2)
        if drawn is None or drawn.likelihood < self._settings.min_drawn_evidence:
            return []
        line_fit = LineFit(drawn.unknowns, drawn.covariance, 0.0, np.empty(0))
        return [(drawn.likelihood, line_fit, found.samples.for_fit)]

    def _starts(
        self, frame: npt.NDArray[np.uint8], model: GoalModel, found: GoalFit, arc: GoalArc
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Cameras on the arc: the goal's own, and those that lines confirm best."""
        settings, fixed = self._settings, at_one_heading(model)
        how_far = MarkReach(settings.reach_stds, settings.min_reach_px, settings.reaches_px[0])
        seen = self._look(frame, model, arc.unknowns, arc.covariance, how_far)
        scales = np.full(settings.iterations, settings.scales_px[1])
        cameras, evidence = arc.unknowns.copy(), np.empty(len(arc.cost))
        fit_marked(
            fixed.scene,
            found.samples.for_fit,
            fixed.priors,
            scales,
            seen,
            self._model,
            cameras,
            evidence,
        )
        evidence -= arc.cost / 2
        likeliest = int(np.argmin(arc.cost))
        chosen = [(arc.unknowns[likeliest], arc.covariance[likeliest])]
        for k in np.argsort(-evidence, kind="stable"):
            if len(chosen) > settings.max_starts or math.isinf(evidence[k]):
                break
            if all(math.dist(cameras[k, :2], other[:2]) > settings.same_m for other, _ in chosen):
                chosen.append((cameras[k], arc.covariance[k]))
        return chosen

    def _evidence(self, marked: _Marked, residual: FloatArray) -> float:
        """Log-likelihood ratio of the ridges being these lines to their being clutter."""
        of_marks = residual[len(residual) - len(marked.samples.mark_m) :]
        return float(mark_evidence(of_marks, marked.width, marked.reach, marked.is_seen, self._model))

    def _from(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        found: GoalFit,
        start: FloatArray,
        covariance: FloatArray,
    ) -> _Fitted | None:
        """Fit goal and lines from one start; returns the evidence, the goal's own included, the fit and its samples."""
        settings, of_goal = self._settings, found.samples.for_fit
        p = start
        is_near = False  # whether the last round already searched no farther than the next one
        marked = None
        for reach, scale in zip(settings.reaches_px, settings.scales_px, strict=True):
            if is_near and reach > settings.reaches_px[-1]:
                continue
            marked = self._marked(frame, model, of_goal, p, covariance, reach)
            if marked is None:
                return None
            is_near = float(marked.reach.max()) <= settings.reaches_px[1]
            p, cost, information = fit_samples(model, marked.samples, p, np.full(settings.iterations, scale))
            if not math.isfinite(cost):
                return None
            covariance = covariance_of(model, information)
        assert marked is not None
        scales, sigma = np.full(settings.iterations, settings.scales_px[-1]), np.empty(len(marked.samples.sigma))
        cost = fit_reweighted(
            model.scene, marked.samples, model.priors, scales, settings.reweighting, p, information, sigma
        )
        if not math.isfinite(cost):
            return None
        residual = sample_residuals(model, marked.samples, p)
        misfit = float(goal_misfit(of_goal, residual, model.priors, _MISFIT_SCALE_PX, p))
        line_fit = LineFit(
            p, covariance_of(model, information), float(marked.is_seen.mean()), residual[len(of_goal.sigma) :]
        )
        return self._evidence(marked, residual) - misfit / 2, line_fit, marked.samples._replace(sigma=sigma)

    def _marked(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        samples: FitSamples,
        p: FloatArray,
        covariance: FloatArray,
        max_px: float,
    ) -> _Marked | None:
        """Look for the lines where a camera predicts them; None where too few are in view or seen."""
        how_far = MarkReach(self._settings.reach_stds, self._settings.min_reach_px, max_px)
        due, is_seen = self._look_from(frame, model, p, covariance, how_far)
        if np.count_nonzero(is_seen) < self._model.min_marks:
            return None
        return self._gathered(samples, due, is_seen)

    def _look_from(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        p: FloatArray,
        covariance: FloatArray,
        how_far: MarkReach,
    ) -> tuple[SeenMarks, npt.NDArray[np.bool_]]:
        due = self._look(frame, model, p[None], covariance[None], how_far)
        is_seen = np.empty(len(due.widths), np.bool_)
        choose_marks(due.contrast, due.widths, self._model, is_seen)
        return due, is_seen

    def _look(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        cameras: FloatArray,
        covariances: FloatArray,
        how_far: MarkReach,
    ) -> SeenMarks:
        """Look for lines where each of some cameras (K, 8), with covariances (K, 8, 8), predicts them."""
        capacity = len(cameras) * len(self._points)
        places = MarkPlaces(
            np.empty((capacity, 2)), np.empty((capacity, 2)), np.empty((capacity, 2)), np.empty(capacity)
        )
        reach, bounds = np.empty(capacity), np.empty(len(cameras) + 1, np.int64)
        n = due_marks(
            self._points,
            self._directions,
            model.scene.camera,
            cameras,
            covariances,
            self._camera.size_px,
            self._limits,
            how_far,
            places,
            reach,
            bounds,
        )
        marks, pixels, direction, width = (part[:n] for part in places)
        start = np.ascontiguousarray(from_ideal(self._camera, pixels))
        offset, contrast = np.empty(n), np.empty(n)
        measure_ridges(frame, start, direction, reach[:n], width, self._settings.along_px, offset, contrast)
        contrast[np.isnan(offset)] = np.nan
        uv = np.ascontiguousarray(self._camera.ideal_pixels(start + direction * offset[:, None]))
        return SeenMarks(bounds, marks, direction, uv, width, reach[:n], contrast)

    def _gathered(self, samples: FitSamples, due: SeenMarks, is_seen: npt.NDArray[np.bool_]) -> _Marked:
        """Add the lines that are seen to a goal's samples."""
        count, of_goal = int(np.count_nonzero(is_seen)), len(samples.sigma)
        marks, uv, direction = np.empty((count, 2)), np.empty((count, 2)), np.empty((count, 2))
        sigma = np.empty(of_goal + count)
        sigma[:of_goal] = samples.sigma
        gather_marks(due, 0, is_seen, self._model, marks, uv, direction, sigma[of_goal:])
        joined = samples._replace(mark_m=marks, mark_uv=uv, mark_direction=direction, sigma=sigma)
        return _Marked(joined, is_seen, due.widths, due.reach)


@lru_cache(maxsize=4)
def along_lines(line_map: LineMap) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) every 4 cm along a field's lines, and their directions (N, 2)."""
    points, directions = [], []
    for x0, y0, x1, y1 in line_map.lines:
        length = math.hypot(x1 - x0, y1 - y0)
        at = np.arange(0.1, length - 0.1, 0.04)[:, None]
        direction = np.array([[x1 - x0, y1 - y0]]) / length
        points.append(np.array([[x0, y0]]) + at * direction)
        directions.append(np.repeat(direction, len(at), axis=0))
    for x, y, radius, start, sweep in line_map.arcs:
        angle = start + np.sign(sweep) * np.arange(0.02, abs(sweep), 0.04 / radius)
        points.append(np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)]))
        directions.append(np.column_stack([-np.sin(angle), np.cos(angle)]))
    return np.ascontiguousarray(np.vstack(points)), np.ascontiguousarray(np.vstack(directions))
