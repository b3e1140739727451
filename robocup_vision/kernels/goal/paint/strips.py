"""Upright strips through stacks of runs, the rows in which they stand on carpet, and paint along a bar between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.algebra.order import sorted_median

_ACROSS = np.linspace(0.15, 0.85, 7)  # of a foot: where carpet is looked for between the edges
_BRIGHTEST = 20.0
_ALONG = np.linspace(0.08, 0.92, 24)  # of a bar, clear of the posts
_MIN_ALONG = 8


class Runs(NamedTuple):
    """Runs of paint: row, left and right end and contrast, (N,) float64 each (`perception.goal_region.white_runs`)."""

    row: FloatArray
    left: FloatArray
    right: FloatArray
    contrast: FloatArray


class StripLimits(NamedTuple):
    """What a strip must be: its least height in widths, lean of its edges (pixels per row), and width at both ends."""

    min_aspect: float
    max_lean: float
    min_width_px: float


@compiled
def straight_line(row: FloatArray, value: FloatArray, keep: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """Slope, and value at row 0, of the least-squares line through the kept ones."""
    count, middle, mean = 0, 0.0, 0.0
    for n in range(row.shape[0]):
        if keep[n]:
            count += 1
            middle += row[n]
            mean += value[n]
    middle /= max(count, 1)
    mean /= max(count, 1)
    square, product = 0.0, 0.0
    for n in range(row.shape[0]):
        if keep[n]:
            square += (row[n] - middle) ** 2
            product += (row[n] - middle) * (value[n] - mean)
    slope = product / max(square, 1e-12)
    return slope, mean - slope * middle


@compiled
def summarize_chains(
    row: FloatArray, left: FloatArray, right: FloatArray, order: Int64Array, bounds: Int64Array, summary: FloatArray
) -> None:
    """Mean middle, mean row, median width, first and last row, and width half-way down of each chain of runs.

    Parameters
    ----------
    row, left, right : (N,) float64
        The runs.
    order, bounds : (N,), (K + 1,) int64
        Runs by chain, each from the top down, and where each chain begins.
    summary : (K, 6) float64
        Result.
    """
    for k in range(bounds.shape[0] - 1):
        members = order[bounds[k] : bounds[k + 1]]
        wide = right[members] - left[members]
        summary[k, 0] = 0.5 * (left[members] + right[members]).mean()
        summary[k, 1] = row[members].mean()
        summary[k, 3], summary[k, 4] = row[members[0]], row[members[-1]]
        summary[k, 5] = wide[members.shape[0] // 2]
        summary[k, 2] = sorted_median(wide)


@compiled
def foot_row(line: FloatArray, bottom: float, carpet: UInt8Array) -> float:
    """First row at or below a strip's end from which carpet lies between its edges; NaN if none does.

    Parameters
    ----------
    line : (4,) float64
        `at` and `lean` of the left, then of the right edge.
    bottom : float
        Last row in which the strip was seen.
    carpet : (H, W) uint8
        Non-zero on carpet.
    """
    width = max(3.0, line[2] + line[3] * bottom - line[0] - line[1] * bottom)
    first = max(0, int(bottom - 1.5 * width))
    # not much further: a ball or a line in front would count as paint again
    last = min(carpet.shape[0] - 1, int(bottom + 0.5 * width) + 8)
    count = last - first + 1
    if count < 4:
        return np.nan
    green = np.zeros(count)
    for i in range(count):
        v = first + i
        left, right = line[0] + line[1] * v, line[2] + line[3] * v
        for part in _ACROSS:
            u = left + (right - left) * part
            if 0.0 <= u <= carpet.shape[1] - 1 and carpet[v, int(round(u))] > 0:
                green[i] += 1.0 / _ACROSS.shape[0]
    # the foot splits the rows into paint above and carpet below with the fewest rows on the wrong side
    wrong = 0.0
    for i in range(count):
        wrong += 1.0 - green[i]
    least, split = wrong, 0
    for i in range(count):
        wrong += 2.0 * green[i] - 1.0
        if wrong < least - 1e-9:
            least, split = wrong, i + 1
    if count - split < 3:
        return np.nan
    below = min(4, count - split)
    if green[split : split + below].sum() / below < 0.6:
        return np.nan
    return first + split - 0.5


@compiled
def fit_strip(runs: Runs, members: Int64Array, carpet: UInt8Array, limits: StripLimits, strip: FloatArray) -> bool:
    """Fit one strip.

    Parameters
    ----------
    runs : Runs
        All of the picture.
    members : (M,) int64
        Those of this strip, from the top down.
    carpet : (H, W) uint8
        Non-zero on carpet.
    limits : StripLimits
        What counts as a strip.
    strip : (8,) float64
        Result: `at` and `lean` of the left edge and of the right, top, bottom, foot, strength.

    Returns
    -------
    bool
        Whether it is one.
    """
    row, left, right, contrast = runs
    count = members.shape[0]
    rows = row[members]
    if count < 4 or rows[-1] - rows[0] < limits.min_aspect * sorted_median(right[members] - left[members]):
        return False
    keep, off, work = np.empty(count, np.bool_), np.empty(count), np.empty(count)
    for side in range(2):
        value = left[members] if side == 0 else right[members]
        keep[:] = True
        at, lean, typical = 0.0, 0.0, 0.0
        for _ in range(3):
            lean, at = straight_line(rows, value, keep)
            for n in range(count):
                off[n] = abs(value[n] - at - lean * rows[n])
            copy_vector(off, work)
            typical = sorted_median(work)
            for n in range(count):
                keep[n] = off[n] <= max(0.75, 2.5 * typical)
        if abs(lean) > limits.max_lean or typical > 1.0:
            return False
        strip[2 * side], strip[2 * side + 1] = at, lean
    strip[4], strip[5] = rows[0], rows[-1]
    for v in (strip[4], strip[5]):
        if strip[2] + strip[3] * v - strip[0] - strip[1] * v < limits.min_width_px:
            return False
    strip[6] = foot_row(strip[:4], strip[5], carpet)
    strip[7] = 0.0
    for m in members:
        strip[7] += min(contrast[m], _BRIGHTEST)
    return True


@compiled
def mean_along(paint: UInt8Array, start: FloatArray, end: FloatArray, mean: FloatArray) -> None:
    """Mean of `paint` (H, W) between the pixels `start` and `end` (N, 2); 0 where most of it is outside the image."""
    for n in range(start.shape[0]):
        total, count = 0.0, 0
        for part in _ALONG:
            u = int(round(start[n, 0] + (end[n, 0] - start[n, 0]) * part))
            v = int(round(start[n, 1] + (end[n, 1] - start[n, 1]) * part))
            if 0 <= u < paint.shape[1] and 0 <= v < paint.shape[0]:
                total += paint[v, u]
                count += 1
        mean[n] = total / count if count >= _MIN_ALONG else 0.0
