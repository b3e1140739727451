"""Compiled search for a floor outline over the whole field: a bank of expected outlines, and fits from the best."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int16Array, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.algebra.distinct import pick_distinct
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    Vector,
    WallScene,
    compare_outline,
    empty_prediction,
    settle,
    thinned,
)

# bound of a difference in levels, so that the sum over all bearings fits into 16 bits
MAX_DIFFERENCE = np.int16(128)
# bound for an edge in front of the wall, which is half as large because obstacles may hide the wall's foot
MAX_HIDDEN = np.int16(64)
# level of a bearing that has no edge
UNKNOWN = np.int16(-(2**15))


class SearchRules(NamedTuple):
    """Parameters of the search over the whole field, the same for all outlines of a camera.

    Parameters
    ----------
    scene : WallScene
        The walls.
    q_step, radius_of_q, unit_px
        As in `FloorOutline`.
    places : (P, 2) float64
        Places of the bank.
    bank : (P, 2 B) int16
        As in `sum_differences`.
    rows : (B,) int64
        Bearings of the bank.
    px_per_level : float
        Pixels for each level of the bank.
    along, across : (N,), (M,) float64
        Positions along and across the field, because a fit may have to slide along walls.
    scales : (I,) float64
        Widths of the weights, pixels.
    starts : int
        Number of the bank's poses to fit.
    apart_m, apart_rad : float
        As in `pick_distinct`, for fits; a pose and its half turn are equal.
    """

    scene: WallScene
    q_step: float
    radius_of_q: FloatArray
    unit_px: float
    places: FloatArray
    bank: Int16Array
    rows: Int64Array
    px_per_level: float
    along: FloatArray
    across: FloatArray
    scales: FloatArray
    starts: int
    apart_m: float
    apart_rad: float


@compiled
def search_outline(pose: Vector, radius: FloatArray, rules: SearchRules, found: FloatArray) -> int:
    """Fit an outline from the bank's best poses, and from positions along the walls that it already fits.

    Parameters
    ----------
    pose : (float, float, float)
        x, y, theta of a fit, which may have slid along walls.
    radius : (K,) float64
        As in `FloorOutline`.
    rules : SearchRules
        May be plain.
    found : (R, 3) float64
        Filled with the best distinct fits, the best first.

    Returns
    -------
    int
        Number of fits.
    """
    known = SearchRules(*rules)
    scene = WallScene(*known.scene)
    outline = FloorOutline(radius, known.q_step, known.radius_of_q, known.scales, known.unit_px)
    starts = _starts(pose, radius, known)
    count = starts.shape[0]
    costs, order = np.empty(count), np.empty(count, np.int64)
    fine = Comparison(scene, outline, empty_prediction(scene))
    thin, residual, predicted = thinned(fine), np.empty(radius.shape[0]), np.empty(radius.shape[0])
    for n in range(count):
        settle(starts[n], fine, thin)
        costs[n], _ = compare_outline(scene, outline, fine.prediction, (0.0, 0.0), residual, predicted)
        # stable insertion sort
        place = n
        while place > 0 and costs[order[place - 1]] > costs[n]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = n
    ordered, picked = np.empty((count, 3)), np.empty(found.shape[0], np.int64)
    for n in range(count):
        copy_vector(starts[order[n]], ordered[n])
    kept = pick_distinct(ordered, known.apart_m, known.apart_rad, True, picked)
    for n in range(kept):
        copy_vector(ordered[picked[n]], found[n])
    return kept


@compiled
def _starts(pose: Vector, radius: FloatArray, rules: SearchRules) -> FloatArray:
    """Return start poses (N, 3): those of the bank with the most similar outline, then some along and across the field.

    The latter differ from `pose` in x or y only.
    """
    count = rules.rows.shape[0]
    levels = np.empty(count, np.int16)
    for b in range(count):
        r = radius[rules.rows[b]]
        levels[b] = np.int16(r / rules.px_per_level + 0.5) if r > 0.0 else UNKNOWN
    sums = np.empty((rules.places.shape[0], count), np.int16)
    sum_differences(rules.bank, levels, sums)
    # more than needed, because many of the best are neighbours in the bank
    best = np.empty(min(10 * rules.starts, sums.size), np.int64)
    least(sums.reshape(-1), best)
    found = np.empty((best.shape[0], 3))
    for n in range(best.shape[0]):
        place, shift = best[n] // count, best[n] % count
        found[n, 0], found[n, 1] = rules.places[place, 0], rules.places[place, 1]
        found[n, 2] = -shift * 2.0 * math.pi / count
    picked = np.empty(rules.starts, np.int64)
    # twice the bank's step of headings, and the same number of metres
    two_steps = 4.0 * math.pi / count
    apart = pick_distinct(found, two_steps, two_steps, True, picked)
    along, across = rules.along.shape[0], rules.across.shape[0]
    starts = np.empty((apart + along + across, 3))
    for n in range(starts.shape[0]):
        starts[n, 0], starts[n, 1], starts[n, 2] = pose
    for n in range(apart):
        copy_vector(found[picked[n]], starts[n])
    for n in range(along):
        starts[apart + n, 0] = rules.along[n]
    for n in range(across):
        starts[apart + along + n, 1] = rules.across[n]
    return starts


@compiled
def sum_differences(bank: Int16Array, levels: Int16Array, out: Int16Array) -> None:
    """Compare a measured outline with the expected outlines at many places and at every heading.

    Parameters
    ----------
    bank : (P, 2 B) int16
        Expected image radius at B evenly spaced bearings, clockwise from 0, for heading 0, stored twice, in levels.
    levels : (B,) int16
        Measured image radius, bearings counter-clockwise from 0, in levels; `UNKNOWN` without an edge.
    out : (P, B) int16
        Filled with the sums over bearings of the absolute differences, each at most `MAX_DIFFERENCE`, or `MAX_HIDDEN`
        for an edge in front of the wall. The heading of column s is -s times the bearings' step.
    """
    count = levels.shape[0]
    for p in range(bank.shape[0]):
        row = out[p]
        for shift in range(count):
            row[shift] = 0
        for b in range(count):
            if levels[b] != UNKNOWN:
                _add_differences(levels[b], bank[p, count - b : 2 * count - b], row)


@compiled
def _add_differences(level: np.int16, expected: Int16Array, row: Int16Array) -> None:
    """Add a bearing's differences at all headings; vectorises."""
    for shift in range(np.uint64(row.shape[0])):
        off = np.int16(level - expected[shift])
        row[shift] += min(max(off, min(np.int16(-off), MAX_HIDDEN)), MAX_DIFFERENCE)


@compiled
def least(scores: Int16Array, out: Int64Array) -> None:
    """Fill out (M,) with the indices of the M least scores (N,), which are not negative, the least first; M <= N."""
    top = 0
    for score in scores:
        top = max(top, score)
    # number of smaller scores, which is the start of each score's group
    begin = np.zeros(top + 2, np.int64)
    for score in scores:
        begin[score + 1] += 1
    for score in range(top + 1):
        begin[score + 1] += begin[score]
    for i in range(scores.shape[0]):
        place = begin[scores[i]]
        if place < out.shape[0]:
            out[place] = i
            begin[scores[i]] = place + 1
