"""Cameras fitted to a goal and to marks on lines, many at once: where marks are due, and how likely those seen are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.algebra.order import sorted_median
from robocup_vision.kernels.goal.fit import FitPriors, FitSamples, fit_goal, goal_residuals, with_marks
from robocup_vision.kernels.goal.lines.marks import MarkLimits, MarkPlaces, line_marks, mark_stds
from robocup_vision.kernels.goal.picture import GoalScene


class MarkReach(NamedTuple):
    """How far marks are searched: in standard deviations, this much more, and at most, pixels."""

    stds: float
    more_px: float
    max_px: float


class MarkModel(NamedTuple):
    """What lines look like at one place, and how often one is seen.

    Parameters
    ----------
    min_contrast, contrast_width_px : float
        Fainter ridges than this fraction of the median contrast are no lines; lines of less than this width have less
        contrast in proportion.
    min_marks : int
        Places, predicted or seen, that are needed.
    sample_error_px, sharp_width_px : float
        Noise of one place; lines that look thinner are fainter, and noisier in proportion.
    line_error_px : float
        Error of all places together: lens and paint.
    paint_part : float
        How exactly lines are painted, as a fraction of their width.
    seen_ratio, full_width_px : float
        Where a line is due, a ridge is seen this often; less often where it looks thinner than this.
    spread_px : float
        Ridges of lines spread so far about their places.
    clutter_ratio : float
        Where no line is due, something passes for a ridge this often.
    """

    min_contrast: float = 0.4
    contrast_width_px: float = 1.5
    min_marks: int = 10
    sample_error_px: float = 0.45
    sharp_width_px: float = 0.5
    line_error_px: float = 0.045
    paint_part: float = 0.06
    seen_ratio: float = 0.8
    full_width_px: float = 0.35
    spread_px: float = 0.4
    clutter_ratio: float = 0.2


class SeenMarks(NamedTuple):
    """Marks of all cameras, one camera after the other.

    Parameters
    ----------
    bounds : (K + 1,) int64
        Each camera's first mark, and their number.
    marks, directions, uv : (N, 2) float64
        Places in the field (metres); in the ideal image unit vectors across the line there, and where it was seen.
    widths, reach : (N,) float64
        How wide the line should look there, and how far it was searched.
    contrast : (N,) float64
        Of each; NaN where none was seen.
    """

    bounds: Int64Array
    marks: FloatArray
    directions: FloatArray
    uv: FloatArray
    widths: FloatArray
    reach: FloatArray
    contrast: FloatArray


@compiled
def due_marks(
    points: FloatArray,
    directions: FloatArray,
    view: FloatArray,
    cameras: FloatArray,
    covariances: FloatArray,
    size: tuple[int, int],
    limits: MarkLimits,
    how_far: MarkReach,
    places: MarkPlaces,
    reach: FloatArray,
    bounds: Int64Array,
) -> int:
    """Places along lines that cameras have in view, and how far they may be off there.

    Parameters
    ----------
    points, directions, view, size, limits
        See `line_marks`.
    cameras, covariances : (K, 8), (K, 8, 8) float64
        The cameras.
    how_far : MarkReach
        By which covariances become reaches.
    places, reach : MarkPlaces, (K N,) float64
        Results, one camera after the other.
    bounds : (K + 1,) int64
        Result: each camera's first place, and their number.

    Returns
    -------
    int
        How many places there are.
    """
    n = 0
    for k in range(cameras.shape[0]):
        bounds[k] = n
        rest = MarkPlaces(places.marks[n:], places.pixels[n:], places.normals[n:], places.widths[n:])
        count = line_marks(points, directions, view, cameras[k], size, limits, rest)
        mark_stds(rest.marks[:count], rest.normals[:count], view, cameras[k], covariances[k], reach[n : n + count])
        for i in range(n, n + count):
            reach[i] = min(how_far.stds * reach[i] + how_far.more_px, how_far.max_px)
        n += count
    bounds[cameras.shape[0]] = n
    return n


@compiled
def choose_marks(contrast: FloatArray, widths: FloatArray, model: MarkModel, is_seen: BoolArray) -> int:
    """Mark (N,) the ridges that are as bright as lines of their width; returns how many there are.

    Parameters
    ----------
    contrast, widths : (N,) float64
        See `SeenMarks`; contrasts are overwritten.
    model : MarkModel
        How bright lines are.
    is_seen : (N,) bool
        Result.
    """
    # paint of half the width makes half the contrast
    for i in range(contrast.shape[0]):
        contrast[i] /= min(widths[i], model.contrast_width_px)
    known = np.empty(contrast.shape[0])
    count = variable(0)
    for i in range(contrast.shape[0]):
        if not math.isnan(contrast[i]):
            known[count] = contrast[i]
            count += 1
    least = model.min_contrast * sorted_median(known[:count]) if count else np.inf
    count = 0
    for i in range(contrast.shape[0]):
        is_seen[i] = contrast[i] > least
        count += is_seen[i]
    return count


@compiled
def gather_marks(
    seen: SeenMarks,
    begin: int,
    is_seen: BoolArray,
    model: MarkModel,
    marks: FloatArray,
    uv: FloatArray,
    directions: FloatArray,
    sigma: FloatArray,
) -> None:
    """Gather the marks of one camera that are seen, with their noise.

    Parameters
    ----------
    seen : SeenMarks
        Of all cameras.
    begin : int
        The camera's first mark.
    is_seen : (N,) bool
        Which of its marks are seen, M of them.
    model : MarkModel
        What noise they have.
    marks, uv, directions : (M, 2) float64
        Results, see `SeenMarks`.
    sigma : (M,) float64
        Result: noise, pixels; what lines are off as a whole counts for each.
    """
    common = model.line_error_px**2 * sigma.shape[0]
    m = variable(0)
    for i in range(is_seen.shape[0]):
        if not is_seen[i]:
            continue
        at = begin + i
        copy_vector(seen.marks[at], marks[m])
        copy_vector(seen.uv[at], uv[m])
        copy_vector(seen.directions[at], directions[m])
        blurred = model.sample_error_px * max(1.0, model.sharp_width_px / seen.widths[at])
        sigma[m] = math.sqrt(blurred**2 + (model.paint_part * seen.widths[at]) ** 2 + common)
        m += 1


@compiled
def mark_evidence(
    residual: FloatArray, widths: FloatArray, reach: FloatArray, is_seen: BoolArray, model: MarkModel
) -> float:
    """Logarithm of how much likelier ridges are if lines are there than if they are clutter.

    Parameters
    ----------
    residual : (M,) float64
        Of those seen, pixels.
    widths, reach : (N,) float64
        Of all marks.
    is_seen : (N,) bool
        Which are seen, M of them.
    model : MarkModel
        Probabilities.
    """
    evidence, m = 0.0, 0
    sharp = 1.0 / model.spread_px
    peak = sharp / math.sqrt(2.0 * math.pi)
    for i in range(widths.shape[0]):
        due = model.seen_ratio * min(1.0, widths[i] / model.full_width_px)
        if is_seen[i]:
            near = peak * math.exp(-0.5 * (residual[m] * sharp) ** 2)
            anywhere = model.clutter_ratio / (2.0 * reach[i])
            evidence += math.log1p(due * (near / anywhere - 1.0))
            m += 1
        else:
            evidence += math.log1p(-due)
    return evidence


@compiled
def fit_marked(
    scene: GoalScene,
    samples: FitSamples,
    priors: FitPriors,
    scales: FloatArray,
    seen: SeenMarks,
    model: MarkModel,
    cameras: FloatArray,
    evidence: FloatArray,
) -> None:
    """Fit cameras to a goal's samples and the marks that each sees.

    Parameters
    ----------
    scene, samples, priors, scales
        See `fit_goal`; the samples hold no marks.
    seen : SeenMarks
        Of all cameras; their contrast is overwritten.
    model : MarkModel
        What marks count.
    cameras : (K, 8) float64
        Starts, overwritten with the fits.
    evidence : (K,) float64
        Result, see `mark_evidence`; minus infinity where too few marks are seen or the fit breaks down.
    """
    goal = samples.sigma.shape[0]
    information = np.empty((8, 8))
    for k in range(cameras.shape[0]):
        evidence[k] = -np.inf
        begin, end = seen.bounds[k], seen.bounds[k + 1]
        if end - begin < model.min_marks:
            continue
        widths = seen.widths[begin:end]
        is_seen = np.empty(end - begin, np.bool_)
        contrast = seen.contrast[begin:end]
        count = choose_marks(contrast, widths, model, is_seen)
        if count < model.min_marks:
            continue
        marks, uv, directions = np.empty((count, 2)), np.empty((count, 2)), np.empty((count, 2))
        sigma = np.empty(goal + count)
        copy_vector(samples.sigma, sigma[:goal])
        gather_marks(seen, begin, is_seen, model, marks, uv, directions, sigma[goal:])
        joined = with_marks(samples, marks, uv, directions, sigma)
        cost = fit_goal(scene, joined, priors, scales, cameras[k], information)
        if math.isinf(cost):
            continue
        residual = np.empty(goal + count)
        goal_residuals(scene, joined, cameras[k], residual)
        evidence[k] = mark_evidence(residual[goal:], widths, seen.reach[begin:end], is_seen, model)
