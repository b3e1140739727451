"""Field lines around a goal: measured near where the goal's own fit predicts them, they make its pose exact.

A goal far away hardly determines how obliquely it is seen. A line's middle is measured to a fraction of a pixel even
where the line looks thinner than one: in brightness, which cameras store at full resolution. Each place on a line is
one more sample of the goal's own fit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.marks import MarkLimits, MarkPlaces, line_marks, measure_ridges
from robocup_vision.kernels.goal.picture import floor_residuals
from robocup_vision.localization.distinct import Apart
from robocup_vision.localization.goal.arc import GoalArc
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, LineFit
from robocup_vision.localization.goal.drawing import LineDrawing, line_pen
from robocup_vision.localization.goal.edges import from_ideal
from robocup_vision.localization.goal.fit import GoalModel, covariance_of, fit_samples, sample_residuals
from robocup_vision.localization.goal.geometry import EDGES, HEADING, X, Y
from robocup_vision.localization.goal.search import Candidate
from robocup_vision.localization.line_map import LineMap

_SPACING_PX = 6.0  # between places on a line
# lines that look narrower are left out; those thinner than a pixel are averaged along themselves
_MIN_WIDTH_PX = 0.15
_CLEAR_PX = 2.5  # between the edges of two lines; where they come nearer, both are left out
_ALONG_PX = 3.0  # length of line over which one place is averaged
# ridges fainter than this fraction of the median contrast are no lines; lines narrower than the width have less
# contrast in proportion
_MIN_CONTRAST = 0.4
_CONTRAST_WIDTH_PX = 1.5
_SAMPLE_ERROR_PX = 0.4  # noise of one place
_LINE_ERROR_PX = 0.045  # common error of all places: lens and paint
_SEEN_RATIO = 0.8  # probability of seeing a line that is due
CLUTTER_RATIO = 0.2  # probability that something passes for a line where none is due
# longest search from a line's predicted place, round by round; the loss's scale is a part of it
_REACHES_PX = (8.0, 4.0, 2.5)
_SCALE_RATIO = 0.4
SAME_M = 0.2  # fits nearer to each other count as one
_REACH_ON_ARC_STDS = 2.5  # longest way along the arc by drawn lines, in standard deviations of the fit
# a goal that leaves its camera's position more uncertain than this is searched along its arc
CERTAIN_M = 0.06
_ITERATIONS = 4  # steps of each round
_REWEIGHTED = 3  # last rounds, whose weights follow the residuals of the round before
# edges farther off are no edges of the goal, and tell nothing of the others: blur moves one by half a pixel
_MAX_EDGE_ERROR_PX = 0.5
_PRIOR_MARKS = 4.0  # number of marks of the expected noise that are added to those whose scatter is measured


class Marks(NamedTuple):
    """Places on lines that a camera predicts, and what is seen there."""

    floor_m: FloatArray  #: (N, 2): in the field
    direction: FloatArray  #: (N, 2): across the line there, ideal image
    uv: FloatArray  #: (N, 2): where it was seen, ideal pixels
    reach_px: float  #: length of the search to both sides
    is_seen: BoolArray  #: (N,): whether a line is seen

    def added_to(self, samples: FitSamples) -> FitSamples:
        """Add the marks that are seen to a goal's samples."""
        seen = self.is_seen
        count = np.count_nonzero(seen)
        # what all have in common counts for each
        sigma = math.sqrt(_SAMPLE_ERROR_PX**2 + _LINE_ERROR_PX**2 * count)
        return samples._replace(
            mark_m=self.floor_m[seen],
            mark_uv=self.uv[seen],
            mark_direction=self.direction[seen],
            sigma=np.append(samples.sigma, np.full(count, sigma)),
        )

    def nats(self, residual_px: FloatArray) -> float:
        """Log-likelihood ratio of lines to clutter, by residuals (N,); those not seen do not count."""
        seen, spread_px = _SEEN_RATIO, _SAMPLE_ERROR_PX
        near = np.exp(-0.5 * (residual_px / spread_px) ** 2) / (spread_px * math.sqrt(math.tau))
        anywhere = CLUTTER_RATIO / (2.0 * self.reach_px)
        of_seen = np.log1p(seen * (near / anywhere - 1.0))
        return float(np.where(self.is_seen, of_seen, math.log1p(-seen)).sum())


_MISFIT_SCALE_PX = 0.3  # of the loss by which a goal's own edges contradict a camera
_FAR2 = 9.0  # squared residual in variances: a mark farther off counts as one so far off

# log-likelihood ratio; the fit; its samples
_Fitted = tuple[float, LineFit, FitSamples]


class GoalLines:
    """Fits goals and the lines of one field together."""

    def __init__(self, lines: LineMap, camera: PinholeCamera) -> None:
        self._camera = camera
        line_width_m = float(lines.field.line_width_m)
        self._points, self._directions, starts = along_lines(lines)
        self._limits = MarkLimits(line_width_m, _SPACING_PX, _MIN_WIDTH_PX)
        self._pen = line_pen(self._points, starts, line_width_m)

    def join(self, frame: UInt8Array, goal: Candidate, arc: GoalArc | None) -> list[CameraEstimate]:
        """Fit goal and lines together: candidate cameras, none where no lines are in view.

        `arc` holds the cameras that the goal leaves open; None: its own fit is certain.
        """
        found, model, of_goal = goal.fit, goal.model, goal.fit.samples.for_fit
        if arc is None:
            fits = self._fits(frame, model, of_goal, [found.unknowns])
        else:
            drawing = LineDrawing(frame, self._pen)
            likely = np.array([drawing.likelihood(model, p) for p in arc.unknowns]) - arc.cost / 2
            # the likeliest cameras by the goal alone, and with the lines drawn
            best = int(np.argmax(likely))
            chosen = sorted({int(np.argmin(arc.cost)), best})
            fits = self._fits(frame, model, of_goal, [arc.unknowns[k] for k in chosen])
            if not fits and len(likely) > 1 and likely[best] > 0.0:
                # too few places show a line, but all of them together do: as certain as its neighbours are far
                covariance = arc.covariance[best].copy()
                covariance[HEADING, HEADING] = np.gradient(arc.unknowns[:, HEADING])[best] ** 2
                fits = [(likely[best], LineFit(arc.unknowns[best], covariance, 0.0, np.empty(0)), of_goal)]
            fits = self._drawn(drawing, model, fits)
        return [CameraEstimate(one.unknowns, one.covariance, goal.sides, found, one) for _, one, _ in fits]

    def nats(self, frame: UInt8Array, model: GoalModel, p: FloatArray) -> tuple[float, float]:
        """Log-likelihood ratio of lines to clutter at the places where a camera (8,) predicts them, and its maximum.

        The maximum is reached where all of them are seen exactly at their places.
        """
        marks = self._look(frame, model, p, _REACHES_PX[-1])
        exact = marks._replace(is_seen=np.ones_like(marks.is_seen))
        nats = marks.nats(self._residual(model, marks, p))
        return nats, exact.nats(np.zeros(len(marks.uv)))

    def _residual(self, model: GoalModel, marks: Marks, p: FloatArray) -> FloatArray:
        residual = np.empty(len(marks.uv))
        floor_residuals(model.scene.camera, p, marks.floor_m, marks.uv, marks.direction, residual)
        return residual

    def _drawn(self, drawing: LineDrawing, model: GoalModel, fits: list[_Fitted]) -> list[_Fitted]:
        """Settle each fit along its arc by all lines drawn."""
        settled: list[_Fitted] = []
        fits = sorted(fits, key=lambda t: -t[0])
        places = np.array([line_fit.unknowns[[X, Y, HEADING]] for _, line_fit, _ in fits]).reshape(-1, 3)
        for k in Apart(SAME_M / 2).first(places, len(fits)):
            _, line_fit, samples = fits[k]
            reach = _REACH_ON_ARC_STDS * math.sqrt(line_fit.covariance[HEADING, HEADING])
            drawn = drawing.settle(model, samples, line_fit.unknowns, reach)
            if drawn is not None:
                moved = replace(line_fit, unknowns=drawn.unknowns, covariance=drawn.covariance)
                settled.append((drawn.likelihood, moved, samples))
        return settled

    def _fits(
        self, frame: UInt8Array, model: GoalModel, samples: FitSamples, starts: list[FloatArray]
    ) -> list[_Fitted]:
        """Fit goal and lines from each start; those that lines confirm."""
        fits = (self._fit(frame, model, samples, p) for p in starts)
        return [one for one in fits if one is not None and one[0] > 0.0]

    def _fit(self, frame: UInt8Array, model: GoalModel, of_goal: FitSamples, p: FloatArray) -> _Fitted | None:
        """Fit goal and lines from one start; returns the evidence, the goal's own included, the fit and its samples."""
        joined, marks = of_goal, None
        scales = np.empty(0)
        for reach in _REACHES_PX:
            marks = self._look(frame, model, p, reach)
            if not marks.is_seen.any():
                return None
            joined = marks.added_to(of_goal)
            scales = np.full(_ITERATIONS, _SCALE_RATIO * reach)
            p, cost, information = fit_samples(model, joined, p, scales)
            if not math.isfinite(cost):
                return None
        assert marks is not None
        expected = joined.sigma
        for _ in range(_REWEIGHTED):
            residual = sample_residuals(model, joined, p)
            joined = joined._replace(sigma=self._reweighted(joined.edge, residual, expected, len(of_goal.sigma)))
            p, cost, information = fit_samples(model, joined, p, scales)
            if not math.isfinite(cost):
                return None
        residual = sample_residuals(model, joined, p)
        of_marks = residual[len(of_goal.sigma) :]
        line_fit = LineFit(p, covariance_of(model, information), float(marks.is_seen.mean()), of_marks)
        nats = marks.nats(self._residual(model, marks, p))
        return nats - misfit(model, of_goal, residual, p) / 2, line_fit, joined

    def _reweighted(self, edge: Int64Array, residual: FloatArray, sigma: FloatArray, first_mark: int) -> FloatArray:
        """Noise (S,) of samples by their residuals: of edges as a whole, and of marks as they scatter.

        The border of a lamp's streak along a bar passes for the bar's edge: each edge is as uncertain as it is off, so
        that all others overrule it. Where some edges are off in a picture, the others may be as well, though the fit
        has followed them: each is also as uncertain as edges are off on average, up to `max_edge_error_px` each.
        """
        n = len(edge)
        count = np.bincount(edge, minlength=EDGES)
        square = (np.bincount(edge, residual[:n], EDGES) / np.maximum(count, 1)) ** 2
        typical = np.minimum(square, _MAX_EDGE_ERROR_PX**2)[count > 0].mean() if n else 0.0
        sigma = sigma.copy()
        sigma[:n] = np.sqrt(sigma[:n] ** 2 + ((square + typical) * count)[edge])
        squares = np.minimum((residual[first_mark:] / sigma[first_mark:]) ** 2, _FAR2)
        sigma[first_mark:] *= math.sqrt((squares.sum() + _PRIOR_MARKS) / (len(squares) + _PRIOR_MARKS))
        return sigma

    def _are_clear(self, pixels: FloatArray, direction: FloatArray, width_px: FloatArray) -> BoolArray:
        """Which places (N,) no other line comes near to: two lines that run into each other look like one."""
        # how far each place lies from each other one along that one's line, and across it
        tangent = np.column_stack([direction[:, 1], -direction[:, 0]])
        along_px, across_px = (axis @ pixels.T - (axis * pixels).sum(axis=1)[:, None] for axis in (tangent, direction))
        # places on the same line are a spacing away along it
        is_beside = np.abs(along_px) <= 0.95 * _SPACING_PX
        apart_px = np.abs(across_px) - (width_px[:, None] + width_px) / 2
        is_near = is_beside & (apart_px < _CLEAR_PX)
        np.fill_diagonal(is_near, False)
        return np.asarray(~is_near.any(axis=1))

    def _look(self, frame: UInt8Array, model: GoalModel, p: FloatArray, reach_px: float) -> Marks:
        """Look for lines within reach of where a camera (8,) predicts them."""
        capacity = len(self._points)
        floor_m, pixels, direction, width_px = *np.empty((3, capacity, 2)), np.empty(capacity)
        places = MarkPlaces(floor_m, pixels, direction, width_px)
        view, size_px = model.scene.camera, self._camera.size_px
        n = line_marks(self._points, self._directions, view, p, size_px, self._limits, places)
        is_clear = self._are_clear(pixels[:n], direction[:n], width_px[:n])
        floor_m, pixels, direction, width_px = (part[:n][is_clear] for part in places)
        start = np.ascontiguousarray(from_ideal(self._camera, pixels))
        offset, contrast = np.empty((2, len(width_px)))
        measure_ridges(frame, start, direction, reach_px, width_px, _ALONG_PX, offset, contrast)
        uv = np.ascontiguousarray(self._camera.ideal_pixels(start + direction * offset[:, None]))
        # paint of half the width makes half the contrast
        contrast = contrast / np.minimum(width_px, _CONTRAST_WIDTH_PX)
        known = np.isfinite(offset)
        least = _MIN_CONTRAST * float(np.median(contrast[known])) if known.any() else math.inf
        return Marks(floor_m, direction, uv, reach_px, known & (contrast > least))


def misfit(model: GoalModel, of_goal: FitSamples, residual_px: FloatArray, p: FloatArray) -> float:
    """Chi-square of a goal's own samples, by the first of the residuals, and of the priors at a camera (8,)."""
    sigma = of_goal.sigma
    squares = np.log1p((residual_px[: len(sigma)] / _MISFIT_SCALE_PX) ** 2) * (_MISFIT_SCALE_PX / sigma) ** 2
    return float(squares.sum() + (((p - model.prior) * model.tightness) ** 2).sum())


def along_lines(line_map: LineMap) -> tuple[FloatArray, FloatArray, Int64Array]:
    """Points (N, 2) every 4 cm along a field's lines, their directions (N, 2), and each line's first point, then N."""
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
    starts = np.cumsum([0, *map(len, points)])
    return np.ascontiguousarray(np.vstack(points)), np.ascontiguousarray(np.vstack(directions)), starts
