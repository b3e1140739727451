"""Poses proposed without a prior: line points against a table of the field's lines.

All places and headings of a bank are scored by a few points first; the best again by all of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.distinct import pick_distinct
from robocup_vision.kernels.model_edges.prediction import on_floor, pose_frame

FIRST_POINTS = 14
_SAMPLED = 31  # one in so many scores is sampled to bound the best ones
_FAR_M = 1e3  # from lines, of what lies beside the table


class Bank(NamedTuple):
    """Prepared once for a field and a camera.

    Parameters
    ----------
    places : (P, 2) float64
        Where the camera may stand, metres: middles of cells of `distance_m`.
    headings : (H,) float64
        Of its axis, evenly spaced.
    distance_m : (R, C) float32
        From the nearest line, at cells of the floor; cut off.
    origin_m : (2,) float64
        x and y of cell (0, 0)'s middle; rows run along y.
    cell_m : float
        Side of a cell.
    """

    places: FloatArray
    headings: FloatArray
    distance_m: Float32Array
    origin_m: FloatArray
    cell_m: float


@compiled(error_model="numpy")
def floor_places(
    points: FloatArray, count: int, lens: FloatArray, tilt: float, roll: float, height_m: float, max_m: float,
    out: FloatArray,
) -> int:  # fmt: skip
    """Put line points on the floor: rows forward, left, tolerance (m), mixed in order."""
    kept = 0
    stride = max(1, int(0.381966 * count))
    while count > 0 and stride > 1 and math.gcd(stride, count) != 1:
        stride -= 1
    frame = np.empty(16)
    pose_frame(np.array((0.0, 0.0, 0.0, tilt, roll, height_m, 0.0)), lens, frame)
    at = 0
    for _ in range(count):
        x, y, is_floor = on_floor(lens, frame, points[at, 0], points[at, 1])
        at = (at + stride) % count
        away = math.sqrt(x * x + y * y)
        if not is_floor or away > max_m:
            continue
        out[kept, 0], out[kept, 1] = x, y
        out[kept, 2] = 0.12 + 0.06 * away + 0.012 * away * away / height_m
        kept += 1
        if kept == out.shape[0]:
            break
    return kept


@compiled(fastmath=True, error_model="numpy")
def _misfit(bank: Bank, rows: FloatArray, begin: int, end: int, x: float, y: float, c: float, s: float) -> float:
    """Return the sum of squared distances from lines in units of the tolerance, each at most 1."""
    total = 0.0
    inverse = 1.0 / bank.cell_m
    last_row, last_column = bank.distance_m.shape[0] - 1, bank.distance_m.shape[1] - 1
    for i in range(begin, end):
        fx = x + c * rows[i, 0] - s * rows[i, 1]
        fy = y + s * rows[i, 0] + c * rows[i, 1]
        column = math.floor((fx - bank.origin_m[0]) * inverse + 0.5)
        row = math.floor((fy - bank.origin_m[1]) * inverse + 0.5)
        if column < 0 or row < 0 or column > last_column or row > last_row:
            total += 1.0
            continue
        d = bank.distance_m[row, column] / rows[i, 2]
        total += min(d * d, 1.0)
    return total


@compiled
def _cell(bank: Bank, x: float, y: float) -> tuple[int, int]:
    """Column and row of the cell that a place lies in."""
    column = math.floor((x - bank.origin_m[0]) / bank.cell_m + 0.5)
    return int(column), int(math.floor((y - bank.origin_m[1]) / bank.cell_m + 0.5))


@compiled
def _with_margin(distance_m: Float32Array, margin: int) -> tuple[Float32Array, int]:
    """Return a table, flat, with so many cells around it that are far from everything, and its columns."""
    rows, columns = distance_m.shape
    wide = columns + 2 * margin
    table = np.full((rows + 2 * margin) * wide, np.float32(_FAR_M))
    for row in range(rows):
        begin = (row + margin) * wide + margin
        for column in range(columns):
            table[begin + column] = distance_m[row, column]
    return table, wide


@compiled(fastmath=True, error_model="numpy")
def score_bank(bank: Bank, rows: FloatArray, number: int, scores: FloatArray) -> None:
    """Score all poses of a bank by line points: the smaller the better.

    Parameters
    ----------
    bank : Bank
        The bank.
    rows : (N, 3) float64
        As `floor_places` returns them, `number` of them.
    scores : (P, H) float64
        Result.
    """
    headings = bank.headings.shape[0]
    first = min(number, FIRST_POINTS)
    inverse, farthest = 1.0 / bank.cell_m, 0.0
    for k in range(first):
        farthest = max(farthest, math.hypot(rows[k, 0], rows[k, 1]))
    margin = int(farthest * inverse) + 2
    table, columns = _with_margin(bank.distance_m, margin)
    # places are cells: where a point lies from them, as each heading turns it, is the same number of cells everywhere
    steps, sharpness = np.empty((first, headings), np.int32), np.empty(first)
    for k in range(first):
        sharpness[k] = 1.0 / rows[k, 2]
        for j in range(headings):
            c, s = math.cos(bank.headings[j]), math.sin(bank.headings[j])
            across = math.floor((c * rows[k, 0] - s * rows[k, 1]) * inverse + 0.5)
            up = math.floor((s * rows[k, 0] + c * rows[k, 1]) * inverse + 0.5)
            steps[k, j] = up * columns + across
    costs = np.empty(headings)
    for i in range(bank.places.shape[0]):
        x, y = bank.places[i, 0], bank.places[i, 1]
        column, row = _cell(bank, x, y)
        here = (row + margin) * columns + column + margin
        # headings side by side: the processor looks up several at once
        costs[:] = 0.0
        for k in range(first):
            for j in range(headings):
                d = table[np.uint32(here + steps[k, j])] * sharpness[k]
                costs[j] += min(d * d, 1.0)
        for j in range(headings):
            scores[i, j] = costs[j] * (number / max(first, 1))


@compiled(fastmath=True, error_model="numpy")
def _score_by_all(bank: Bank, rows: FloatArray, number: int, scores: FloatArray, order: Int64Array) -> FloatArray:
    """Return scores by all points of the poses at some places of `scores`, an array of places x headings, flat."""
    headings = bank.headings.shape[0]
    full = np.empty(order.shape[0])
    first = min(number, FIRST_POINTS)
    for n in range(order.shape[0]):
        i, j = order[n] // headings, order[n] % headings
        c, s = math.cos(bank.headings[j]), math.sin(bank.headings[j])
        x, y = bank.places[i, 0], bank.places[i, 1]
        few = _misfit(bank, rows, variable(0), first, x, y, c, s)
        rest = _misfit(bank, rows, first, number, x, y, c, s)
        full[n] = scores[order[n]] - few * (number / max(first, 1)) + few + rest
    return full


def _least(values: FloatArray, count: int) -> Int64Array:
    """Return the places of the `count` least of some values (N,), and of those equal to the greatest of them."""
    # a part of them tells a bound that few are below: these alone are sorted
    some = values[::_SAMPLED]
    bound = min(2 * count // _SAMPLED + _SAMPLED, len(some) - 1)
    near = np.flatnonzero(values <= np.partition(some, bound)[bound])
    if len(near) < count:
        near = np.arange(len(values))
    of_near = values[near]
    return np.asarray(near[of_near <= np.partition(of_near, count - 1)[count - 1]], np.int64)


def best_poses(
    bank: Bank,
    rows: FloatArray,
    number: int,
    scores: FloatArray,
    kept: int,
    apart_m: float,
    apart_rad: float,
    out: FloatArray,
) -> int:
    """Score the best `kept` poses by all points and give those that are apart, the best first.

    NumPy sorts: compiling a sort for this one use takes seconds.

    Parameters
    ----------
    bank, rows, number, scores
        As in `score_bank`.
    kept : int
        How many are scored in full.
    apart_m, apart_rad : float
        As of `pick_distinct`.
    out : (K, 4) float64
        Result: x, y, heading, score.

    Returns
    -------
    int
        How many.
    """
    flat = scores.reshape(-1)
    kept = min(kept, len(flat))
    order = _least(flat, kept)
    full = _score_by_all(bank, rows, number, flat, order)
    again = np.argsort(full, kind="stable")
    place, heading = np.divmod(order[again], len(bank.headings))
    poses, picked = np.column_stack([bank.places[place], bank.headings[heading]]), np.empty(len(out), np.int64)
    count = pick_distinct(poses, apart_m, apart_rad, False, picked)
    out[:count, :3], out[:count, 3] = poses[picked[:count]], full[again[picked[:count]]]
    return count
