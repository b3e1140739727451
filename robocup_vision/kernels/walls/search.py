"""Compiled loops of the search for a floor outline over the whole field: a bank of places, and starts spread apart."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int16Array, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_matrix, copy_vector
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    Vector,
    WallScene,
    cost_of,
    room_for,
    settle,
    thinned,
)

# a difference counts as this many levels at most: the sum of all bearings' is a whole number of two bytes
WIDEST = np.int16(128)
# no level: nothing is seen
UNKNOWN = np.int16(-(2**15))


class SearchRules(NamedTuple):
    """What is compared over the whole field, and how far each step goes: the same for all outlines of a camera.

    Parameters
    ----------
    scene, half_scene : WallScene
        The walls, at all bearings and at every second one.
    q_step, radius_of_q, unit_px
        As in `FloorOutline`.
    places : (P, 2) float64
        Where outlines are expected.
    bank : (P, 2 B) int16
        As `score_bank` takes it.
    rows : (B,) int64
        Which of the bearings are the bank's.
    px_per_level : float
        What a level of the bank is.
    along, across : (N,), (M,) float64
        Places along and across the field, which a fit may have slid from.
    rough, coarse, fine : (I,) float64
        Widths of the weights, pixels: from all starts, from the likely ones, and from what they found.
    considered, starts, likely, refined : int
        How many poses of the bank are looked at, how many of them are starts, and how many fits go on to `coarse` and
        to `fine`.
    start_apart, fit_apart : float
        As in `spread_poses`, of starts and of fits.
    hopeless : float
        A coarse fit costlier by so much than the best goes no further.
    """

    scene: WallScene
    half_scene: WallScene
    q_step: float
    radius_of_q: FloatArray
    unit_px: float
    places: FloatArray
    bank: Int16Array
    rows: Int64Array
    px_per_level: float
    along: FloatArray
    across: FloatArray
    rough: FloatArray
    coarse: FloatArray
    fine: FloatArray
    considered: int
    starts: int
    likely: int
    refined: int
    start_apart: float
    fit_apart: float
    hopeless: float


@compiled
def search_outline(
    pose: Vector, radius: FloatArray, rules: SearchRules, begun: FloatArray, poses: FloatArray, costs: FloatArray
) -> int:
    """Fit an outline from places all over the field, and from all along the walls that it agrees with already.

    Parameters
    ----------
    pose : (float, float, float)
        x, y, theta of a fit that may have slid along walls.
    radius : (K,) float64
        As in `FloorOutline`.
    rules : SearchRules
        May be plain.
    begun, poses, costs : (R, 3), (R, 3), (R,) float64
        Result: where the last fits began, what they found and its cost.

    Returns
    -------
    int
        How many there are.
    """
    known = SearchRules(*rules)
    scene, half_scene = WallScene(*known.scene), WallScene(*known.half_scene)
    half = np.empty(half_scene.cos_b.shape[0])
    for k in range(half.shape[0]):
        half[k] = radius[2 * k]
    starts = _starts(pose, radius, known)
    rough = FloorOutline(half, known.q_step, known.radius_of_q, known.rough, known.unit_px)
    likely = _refit(starts, half_scene, rough, known.fit_apart, known.likely, np.inf)
    coarse = FloorOutline(half, known.q_step, known.radius_of_q, known.coarse, known.unit_px)
    last = _refit(likely, half_scene, coarse, known.fit_apart, known.refined, known.hopeless)
    count = len(last)
    fine = FloorOutline(radius, known.q_step, known.radius_of_q, known.fine, known.unit_px)
    copy_matrix(last, begun)
    fit_each(last, scene, fine, poses[:count], costs[:count])
    return count


@compiled
def _starts(pose: Vector, radius: FloatArray, rules: SearchRules) -> FloatArray:
    """Return poses (N, 3) whose expected outline is most like the measured one, and those along and across the field.

    The latter have the heading of a pose.
    """
    count = rules.rows.shape[0]
    levels = np.empty(count, np.int16)
    for b in range(count):
        r = radius[rules.rows[b]]
        levels[b] = np.int16(r / rules.px_per_level + 0.5) if r > 0.0 else UNKNOWN
    scores = np.empty((rules.places.shape[0], count), np.int16)
    score_bank(rules.bank, levels, scores)
    best = np.empty(min(rules.considered, scores.size), np.int64)
    least(scores.reshape(-1), best)
    found = np.empty((best.shape[0], 3))
    for n in range(best.shape[0]):
        place, shift = best[n] // count, best[n] % count
        found[n, 0], found[n, 1] = rules.places[place, 0], rules.places[place, 1]
        found[n, 2] = -shift * 2.0 * math.pi / count
    picked = np.empty(rules.starts, np.int64)
    apart = spread_poses(found, rules.start_apart, picked)
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
def _refit(
    starts: FloatArray, scene: WallScene, outline: FloorOutline, apart: float, most: int, hopeless: float
) -> FloatArray:
    """Fit each start (N, 3); return the best that are apart, of those less costly than the best and so much more."""
    count = starts.shape[0]
    fits, costs = np.empty((count, 3)), np.empty(count)
    fit_each(starts, scene, outline, fits, costs)
    order = np.empty(count, np.int64)
    in_order(costs, order)
    hopeful = 0
    while hopeful < count and costs[order[hopeful]] < costs[order[0]] + hopeless:
        hopeful += 1
    # the best itself where nothing is less costly than itself: costs that are no numbers
    ordered = np.empty((max(hopeful, 1), 3))
    for n in range(ordered.shape[0]):
        copy_vector(fits[order[n]], ordered[n])
    picked = np.empty(most, np.int64)
    kept = np.empty((spread_poses(ordered, apart, picked), 3))
    for n in range(kept.shape[0]):
        copy_vector(ordered[picked[n]], kept[n])
    return kept


@compiled
def score_bank(bank: Int16Array, levels: Int16Array, out: Int16Array) -> None:
    """Compare a measured outline with the outlines expected at many places, at every heading.

    Parameters
    ----------
    bank : (P, 2 B) int16
        Expected image radius at B evenly spaced bearings from 0 on clockwise, for heading 0, twice over, in levels.
    levels : (B,) int16
        Measured image radius, bearings from 0 on counter-clockwise, in levels; `UNKNOWN` where there is none.
    out : (P, B) int16
        Filled with the sums over the measured bearings of the differences, each `WIDEST` at most, of place p with the
        heading of minus shift times the bearings' step.
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
    """Add a bearing's differences at all headings, side by side: the processor takes sixteen at once."""
    for shift in range(np.uint64(row.shape[0])):
        off = np.int16(level - expected[shift])
        row[shift] += min(max(off, np.int16(-off)), WIDEST)


@compiled
def least(scores: Int16Array, out: Int64Array) -> None:
    """Fill out (M,) with the indices of the M least scores (N,), none negative, the least first; M at most N."""
    top = 0
    for score in scores:
        top = max(top, score)
    # how many are less than each score, and so where those of this score begin
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


@compiled
def in_order(costs: FloatArray, out: Int64Array) -> None:
    """Fill out (N,) with the indices of some costs, the least first and of equal ones the first."""
    for i in range(costs.shape[0]):
        place = i
        while place > 0 and costs[out[place - 1]] > costs[i]:
            out[place] = out[place - 1]
            place -= 1
        out[place] = i


@compiled
def spread_poses(poses: FloatArray, apart: float, out: Int64Array) -> int:
    """Pick the best poses that are apart from those picked before, and from their half turns.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y, theta, the best first; metres, radians.
    apart : float
        Poses differ by more than this: by the distance, metres, and the angle, radians, added.
    out : (M,) int64
        Filled with the indices of up to M poses.

    Returns
    -------
    int
        How many.
    """
    count, turn = 0, 2.0 * math.pi
    for n in range(poses.shape[0]):
        if count == out.shape[0]:
            break
        x, y, theta = poses[n, 0], poses[n, 1], poses[n, 2]
        nearest = np.inf
        for k in range(count):
            other = out[k]
            turned = theta - poses[other, 2]
            turned = abs(turned - turn * np.rint(turned / turn))
            here = math.hypot(x - poses[other, 0], y - poses[other, 1]) + turned
            there = math.hypot(x + poses[other, 0], y + poses[other, 1]) + (math.pi - turned)
            nearest = min(here, there)
            if nearest <= apart:
                break
        if nearest > apart:
            out[count] = n
            count += 1
    return count


@compiled
def fit_each(
    poses: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    out_poses: FloatArray,
    out_costs: FloatArray,
) -> None:
    """Fit each start by itself, as `settle` does; fills out_poses (N, 3) and out_costs (N,)."""
    fine = Comparison(scene, outline, room_for(scene))
    thin = thinned(fine)
    for n in range(poses.shape[0]):
        copy_vector(poses[n], out_poses[n])
        settle(out_poses[n], fine, thin)
        out_costs[n] = cost_of(fine)
