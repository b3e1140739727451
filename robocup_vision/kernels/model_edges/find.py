"""Proposes poses without a prior: scores them by line points and a table of distances from the field's lines.

All places and headings of a bank are first scored by a few points; the best are scored again by all points.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.distinct import pick_distinct
from robocup_vision.kernels.model_edges.prediction import FRAME, on_floor, pose_frame

FIRST_POINTS = 14
_SAMPLED = 31  # every 31st score is read to estimate a bound on the best ones
_FAR_M = 1e3  # distance from lines of what lies beside the table


class Bank(NamedTuple):
    """Poses all over a field, and distances from its lines; prepared once.

    Parameters
    ----------
    places : (P, 2) float64
        Where the camera may stand, metres: middles of cells of `distance_m`.
    headings : (H,) float64
        Headings of its axis, evenly spaced.
    distance_m : (R, C) float32
        Distance of each cell of the floor from the nearest line, limited to a maximum.
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
    """Map pixels `points` (N, 3) to the floor; returns the number of rows of `out` (M, 3) that are filled.

    A row is forward and left of the camera's foot, and a tolerance, metres. Points beyond `max_m` are left out. The
    order is shuffled, so that the first rows are spread over the picture.
    """
    kept = 0
    stride = max(1, int(0.381966 * count))
    while count > 0 and stride > 1 and math.gcd(stride, count) != 1:
        stride -= 1
    frame = np.empty(FRAME)
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
    """Return the sum of squared distances of rows `begin` to `end` from lines, in tolerances, each at most 1.

    The pose is x, y and the cosine c and sine s of its heading.
    """
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
    """Return column and row of the cell that contains a place."""
    column = math.floor((x - bank.origin_m[0]) / bank.cell_m + 0.5)
    return int(column), int(math.floor((y - bank.origin_m[1]) / bank.cell_m + 0.5))


@compiled
def _with_margin(distance_m: Float32Array, margin: int) -> tuple[Float32Array, int]:
    """Return a flattened table with a margin of cells far from all lines, and its number of columns."""
    rows, columns = distance_m.shape
    width = columns + 2 * margin
    table = np.full((rows + 2 * margin) * width, np.float32(_FAR_M))
    for row in range(rows):
        begin = (row + margin) * width + margin
        for column in range(columns):
            table[begin + column] = distance_m[row, column]
    return table, width


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
    # places are middles of cells: a point turned by a heading is the same number of cells away from each place
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
        origin = (row + margin) * columns + column + margin
        # the inner loop is over headings, so that it can be vectorised
        costs[:] = 0.0
        for k in range(first):
            for j in range(headings):
                d = table[np.uint32(origin + steps[k, j])] * sharpness[k]
                costs[j] += min(d * d, 1.0)
        for j in range(headings):
            scores[i, j] = costs[j] * (number / max(first, 1))


@compiled(fastmath=True, error_model="numpy")
def _score_by_all(bank: Bank, rows: FloatArray, number: int, scores: FloatArray, order: Int64Array) -> FloatArray:
    """Return scores by all points of the poses at the indices `order` of `scores`, flattened from (P, H)."""
    headings = bank.headings.shape[0]
    full = np.empty(order.shape[0])
    first = min(number, FIRST_POINTS)
    for n in range(order.shape[0]):
        i, j = order[n] // headings, order[n] % headings
        c, s = math.cos(bank.headings[j]), math.sin(bank.headings[j])
        x, y = bank.places[i, 0], bank.places[i, 1]
        first_score = _misfit(bank, rows, variable(0), first, x, y, c, s)
        rest = _misfit(bank, rows, first, number, x, y, c, s)
        full[n] = scores[order[n]] - first_score * (number / max(first, 1)) + first_score + rest
    return full


def _least(values: FloatArray, count: int) -> Int64Array:
    """Return the indices of the `count` least of some values (N,), and of those equal to the greatest of them."""
    # a sample of the values gives a bound that few lie below: only these are sorted
    sample = values[::_SAMPLED]
    bound = min(2 * count // _SAMPLED + _SAMPLED, len(sample) - 1)
    low = np.flatnonzero(values <= np.partition(sample, bound)[bound])
    if len(low) < count:
        low = np.arange(len(values))
    low_values = values[low]
    return np.asarray(low[low_values <= np.partition(low_values, count - 1)[count - 1]], np.int64)


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
    """Score the best `kept` poses by all points, and fill in distinct ones, the best first; returns their number.

    NumPy sorts: compiling a sort for this one use takes seconds.

    Parameters
    ----------
    bank, rows, number, scores
        As in `score_bank`.
    kept : int
        Number of poses that are scored by all points.
    apart_m, apart_rad : float
        See `pick_distinct`.
    out : (K, 4) float64
        Result: x, y, heading, score.
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
