"""Field lines around a goal of a hue: seen near where the goal's own fit predicts them, they make its pose exact.

From afar a goal hardly tells how obliquely it is seen. A line's middle is measured to a fraction of a pixel even where
it looks thinner than one, in brightness, which no camera stores coarsely; each place on a line is one more sample of
the goal's own fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.marks import line_marks, mark_stds, measure_ridges
from robocup_vision.localization.goal.arc import GoalArc, at_one_heading, follow_arc
from robocup_vision.localization.goal.drawing import LineDrawing
from robocup_vision.localization.goal.edges import EdgeSamples, from_ideal, to_ideal
from robocup_vision.localization.goal.fit import (
    INLIER_PX,
    GoalFit,
    GoalModel,
    are_mostly_within,
    covariance_of,
    fit,
    residuals,
)
from robocup_vision.localization.goal.geometry import HEADING, LOG_FOCAL
from robocup_vision.localization.goal.with_lines import LineFit, along_lines
from robocup_vision.localization.lines.line_map import LineMap

_SPACING_PX = 6.0
_ALONG_PX = 3.0
_MIN_WIDTH_PX = 0.15
_CLEAR_PX = 2.5  # what a line is compared with lies as far beside it
_REACHES_PX = (8.0, 4.0, 2.5)
_SCALES_PX = (3.0, 1.5, 1.0)
_FLOOR_PX = 1.5
_SAMPLE_ERROR_PX = 0.45
_SHARP_WIDTH_PX = 0.5  # thinner lines are fainter
_LINE_ERROR_PX = 0.045  # of all places together
_PAINTED_TO_M = 0.003
_MIN_MARKS = 10
# where a line is due, a ridge is seen this often, less often where the line looks thinner than this, and spreads so far
_SEEN, _PLAIN_WIDTH_PX, _SPREAD_PX = 0.8, 0.35, 0.4
# where none is due, something passes for a ridge this often
_CLUTTER = 0.2
# logarithms of odds: for lines at all, and of one place against another so far off
_MIN_EVIDENCE, _CLEARLY, _SAME_M = 5.0, 3.0, 0.2
_MAX_STARTS = 3
_REACH_STDS = 2.5
_MIN_DRAWN = 6.0
_MIN_CONTRAST = 0.4  # of the median, for its width
_FULL_WIDTH_PX = 1.5  # wider paint looks no brighter
# what the goal may leave open before its arc is searched
SURE_M = 0.06
_ITERATIONS = 4
_TRUSTED = 4.0  # places that the noise expected counts for


@dataclass(frozen=True, slots=True, eq=False)
class _Marked:
    """A goal's samples with marks on lines, which of the places looked at they are, line widths and reaches there."""

    samples: EdgeSamples
    seen: npt.NDArray[np.bool_]
    width: FloatArray
    reach: FloatArray


# how likely it is, as a logarithm; the fit; what it was fitted to
_Fitted = tuple[float, LineFit, EdgeSamples]


class GoalMarks:
    """Looks for the lines of one field around its goals.

    Parameters
    ----------
    lines : LineMap
        Of the field.
    camera : PinholeCamera
        The camera.
    """

    def __init__(self, lines: LineMap, camera: PinholeCamera) -> None:
        self._camera = camera
        self._width_m = lines.field.line_width_m
        points, directions = along_lines(lines)
        self._points, self._directions = np.ascontiguousarray(points), np.ascontiguousarray(directions)

    def join(self, frame: npt.NDArray[np.uint8], model: GoalModel, found: GoalFit) -> tuple[float, LineFit] | None:
        """Fit goal and lines together; None where the lines that should be in view are not.

        What comes first says how much likelier such lines are to be seen here than clutter, as a logarithm.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        model : GoalModel
            What the goal was fitted with.
        found : GoalFit
            The goal.
        """
        covariance = covariance_of(model, found.information)
        std = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
        arc = follow_arc(model, found.samples, found.unknowns, std) if std > SURE_M else None
        starts = [(found.unknowns, covariance)] if arc is None else self._starts(frame, model, found, arc)
        fits = [t for t in (self._from(frame, model, found, p, c) for p, c in starts) if t is not None]
        fits = [t for t in fits if t[0] >= _MIN_EVIDENCE]
        if arc is not None:
            drawing = LineDrawing(frame, self._points, self._width_m)
            fits = self._drawn(drawing, model, fits) if fits else self._drawn_alone(drawing, model, found, arc)
        fits.sort(key=lambda t: -t[0])
        if not fits:
            return None
        evidence, best, _ = fits[0]
        for other_evidence, other, _ in fits[1:]:
            if math.dist(other.unknowns[:2], best.unknowns[:2]) > _SAME_M and evidence - other_evidence < _CLEARLY:
                return None
        within = are_mostly_within(residuals(model, found.samples, best.unknowns), INLIER_PX)
        return (evidence, best) if within else None

    def _drawn(self, drawing: LineDrawing, model: GoalModel, fits: list[_Fitted]) -> list[_Fitted]:
        """Settle each fit along its arc by all lines drawn."""
        settled: list[_Fitted] = []
        tried: list[FloatArray] = []
        for _, line_fit, samples in sorted(fits, key=lambda t: -t[0]):
            place = line_fit.unknowns[:2]
            if any(math.dist(place, other) < _SAME_M / 2 for other in tried):
                continue
            tried.append(place)
            reach = _REACH_STDS * math.sqrt(line_fit.covariance[HEADING, HEADING])
            drawn = drawing.settle(model, samples, line_fit.unknowns, reach)
            if drawn is not None:
                moved = replace(line_fit, unknowns=drawn.unknowns, covariance=drawn.covariance)
                settled.append((drawn.likelihood, moved, samples))
        return settled

    def _drawn_alone(self, drawing: LineDrawing, model: GoalModel, found: GoalFit, arc: GoalArc) -> list[_Fitted]:
        """Settle the goal along its arc where too few lines are seen one by one, by all of them drawn."""
        told = np.array([drawing.likelihood(model, p) for p in arc.unknowns]) - arc.cost / 2
        best = int(np.argmax(told))
        if told[best] <= 0.0:
            return []
        turns = np.abs(np.diff(arc.unknowns[:, HEADING]))
        reach = 2 * float(turns[max(best - 1, 0) : best + 1].max())
        drawn = drawing.settle(model, found.samples, arc.unknowns[best], reach, loose=2)
        if drawn is None or drawn.likelihood < _MIN_DRAWN:
            return []
        line_fit = LineFit(drawn.unknowns, drawn.covariance, 0.0, np.empty(0))
        return [(drawn.likelihood, line_fit, found.samples)]

    def _starts(
        self, frame: npt.NDArray[np.uint8], model: GoalModel, found: GoalFit, arc: GoalArc
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Cameras on the arc that lines bear out best."""
        held = at_one_heading(model)
        scored = []
        for p, covariance, cost in zip(arc.unknowns, arc.covariance, arc.cost, strict=True):
            marked = self._marked(frame, held, found.samples, p, covariance, _REACHES_PX[0])
            if marked is None:
                continue
            q, least, _ = fit(held, marked.samples, p, np.full(_ITERATIONS, _SCALES_PX[1]))
            if math.isfinite(least):
                scored.append((self._evidence(held, marked, q) - cost / 2, q, covariance))
        scored.sort(key=lambda one: -one[0])
        chosen: list[tuple[FloatArray, FloatArray]] = []
        for _, p, covariance in scored:
            if all(math.dist(p[:2], other[:2]) > _SAME_M for other, _ in chosen):
                chosen.append((p, covariance))
            if len(chosen) == _MAX_STARTS:
                break
        return chosen

    def _evidence(self, model: GoalModel, marked: _Marked, p: FloatArray) -> float:
        """Logarithm of how much likelier the ridges are if these lines are there than if they are clutter."""
        residual = residuals(model, marked.samples, p)[-int(marked.seen.sum()) :]
        due = _SEEN * np.minimum(1.0, marked.width / _PLAIN_WIDTH_PX)
        near = np.exp(-0.5 * (residual / _SPREAD_PX) ** 2) / (_SPREAD_PX * math.sqrt(math.tau))
        anywhere = _CLUTTER / (2 * marked.reach)
        there = np.log1p(due[marked.seen] * (near / anywhere[marked.seen] - 1.0))
        return float(there.sum() + np.log1p(-due[~marked.seen]).sum())

    def _from(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        found: GoalFit,
        start: FloatArray,
        covariance: FloatArray,
    ) -> _Fitted | None:
        """Fit goal and lines from one start; returns the evidence, the goal's own included, the fit and its samples."""
        p = start
        is_near = False  # nothing was looked for farther away than the next round would
        marked = None
        for reach, scale in zip(_REACHES_PX, _SCALES_PX, strict=True):
            if is_near and reach > _REACHES_PX[-1]:
                continue
            marked = self._marked(frame, model, found.samples, p, covariance, reach)
            if marked is None:
                return None
            is_near = float(marked.reach.max()) <= _REACHES_PX[1]
            p, cost, information = fit(model, marked.samples, p, np.full(_ITERATIONS, scale))
            if not math.isfinite(cost):
                return None
            covariance = covariance_of(model, information)
        assert marked is not None
        samples = _as_scattered(model, marked.samples, p)
        p, cost, information = fit(model, samples, p, np.full(_ITERATIONS, _SCALES_PX[-1]))
        if not math.isfinite(cost):
            return None
        covariance = covariance_of(model, information)
        off = residuals(model, found.samples, p)
        strain = np.where(np.isinf(model.weight), 0.0, model.weight) * (p - model.prior) ** 2
        of_goal = float(np.log1p((off / 0.3) ** 2) @ (0.3 / found.samples.sigma) ** 2 + strain.sum())
        residual = residuals(model, marked.samples, p)[len(off) :]
        share = float(marked.seen.mean())
        return self._evidence(model, marked, p) - of_goal / 2, LineFit(p, covariance, share, residual), samples

    def _marked(
        self,
        frame: npt.NDArray[np.uint8],
        model: GoalModel,
        samples: EdgeSamples,
        p: FloatArray,
        covariance: FloatArray,
        max_px: float,
    ) -> _Marked | None:
        """Look for the lines where a camera predicts them; None where too few are in view or seen."""
        room = len(self._points)
        marks, pixels, normals, widths = np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
        n = line_marks(
            self._points,
            self._directions,
            model.view_array,
            p,
            self._camera.size_px,
            self._width_m,
            _SPACING_PX,
            _MIN_WIDTH_PX,
            _CLEAR_PX,
            marks,
            pixels,
            normals,
            widths,
        )
        marks, pixels, normals, widths = marks[:n], pixels[:n], normals[:n], widths[:n]
        if n < _MIN_MARKS:
            return None
        std = np.empty(n)
        mark_stds(marks, pixels, normals, model.view_array, p, LOG_FOCAL + 1, covariance, std)
        start = np.ascontiguousarray(from_ideal(self._camera, pixels))
        offset, contrast = np.empty(n), np.empty(n)
        reach = np.minimum(3 * std + _FLOOR_PX, max_px)
        measure_ridges(frame, start, normals, reach, widths, _ALONG_PX, offset, contrast)
        seen = np.isfinite(offset)
        # paint of half the width makes half the contrast
        contrast /= np.minimum(widths, _FULL_WIDTH_PX)
        if seen.any():
            seen &= contrast > _MIN_CONTRAST * np.median(contrast[seen])
        count = int(seen.sum())
        if count < _MIN_MARKS:
            return None
        paint = _PAINTED_TO_M / self._width_m * widths[seen]
        sigma = np.sqrt(
            (_SAMPLE_ERROR_PX * np.maximum(1.0, _SHARP_WIDTH_PX / widths[seen])) ** 2
            + paint**2
            + _LINE_ERROR_PX**2 * count
        )
        joined = replace(
            samples,
            mark_m=marks[seen],
            mark_uv=np.ascontiguousarray(to_ideal(self._camera, start[seen] + normals[seen] * offset[seen, None])),
            mark_direction=normals[seen],
            sigma=np.concatenate([samples.sigma, sigma]),
        )
        return _Marked(joined, seen, widths, reach)


def _as_scattered(model: GoalModel, samples: EdgeSamples, p: FloatArray) -> EdgeSamples:
    """Let the noise of marks be what they scatter; what lines are off as a whole comes and goes with it."""
    first = len(samples.sigma) - len(samples.mark_m)
    square = np.minimum((residuals(model, samples, p)[first:] / samples.sigma[first:]) ** 2, 9.0)
    scatter = (float(square.sum()) + _TRUSTED) / (len(square) + _TRUSTED)
    sigma = samples.sigma.copy()
    sigma[first:] *= math.sqrt(scatter)
    return replace(samples, sigma=sigma)
