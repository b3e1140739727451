"""Compiled loops that find the foot and the sides of dark things among blurred floor samples.

A sample that shows part floor and part black has the floor's colour: black adds nothing to it. By colour alone, the
floor goes on until hardly any of it is left in a sample, so that black boards stand too far away. The foot lies where
brightness is half way between the floor before it and what is behind it.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.bits import NO_BITS
from robocup_vision.kernels.floor.free_floor import BLOCKED, FLOOR

# columns over which an edge is spread: by the averages over 3 x 3 samples, by the lens, and by motion
SPREAD = 4


@compiled(inline="always")
def _brightness(samples: UInt8Array, k: int, m: int) -> int:
    return int(samples[k, m, 0]) + int(samples[k, m, 1]) + int(samples[k, m, 2])


@compiled
def _half_way(samples: UInt8Array, valid: UInt8Array, k: int, last: int) -> float:
    """Return the brightness half way between floor up to column `last` and what lies behind; 0: no edge."""
    columns = samples.shape[1]
    if last + 2 >= columns or not valid[k, last + 1] or not valid[k, last + 2]:
        return 0.0
    behind = min(_brightness(samples, k, last + 1), _brightness(samples, k, last + 2))
    floor = 0
    for m in range(max(last - SPREAD, 0), last + 1):
        floor = max(floor, _brightness(samples, k, m))
    return 0.5 * (floor + behind) if behind < floor else 0.0


@compiled
def block_dark_feet(samples: UInt8Array, valid: UInt8Array, columns_in_use: int, marks: UInt8Array) -> None:
    """Block the floor samples before something blocked that show less than half floor.

    Parameters
    ----------
    samples : (K, M, 3) uint8
        Colours.
    valid : (K, M) uint8
        Non-zero where a sample may be looked at.
    columns_in_use : int
        Columns below the horizon.
    marks : (K, M) uint8
        What the samples show, FLOOR turned to BLOCKED where it is so.
    """
    columns, words = marks.shape[1], (columns_in_use + 7) // 8
    begins = np.zeros(8 * words, np.bool_)
    eights = begins.view(np.uint64)
    for k in range(len(marks)):
        row = marks[k]
        # told of a whole row without branches; what is blocked below lies before where the next thing begins
        for m in range(1, columns_in_use):
            begins[m] = (row[m] == BLOCKED) & (row[m - 1] == FLOOR)
        for word in range(words):
            if eights[word] == NO_BITS:
                continue
            # written out, not called: a call takes longer than all that it does
            for m in range(8 * word, 8 * word + 8):
                if not begins[m] or m + 1 >= columns or not valid[k, m] or not valid[k, m + 1]:
                    continue
                behind = min(_brightness(samples, k, m), _brightness(samples, k, m + 1))
                first, floor = max(m - 1 - SPREAD, 0), 0
                for j in range(first, m):
                    floor = max(floor, _brightness(samples, k, j))
                at = m - 1 if behind < floor else first
                while at > first and row[at] == FLOOR and 2 * _brightness(samples, k, at) < floor + behind:
                    row[at] = BLOCKED
                    at -= 1


@compiled
def foot_px(
    samples: UInt8Array, valid: UInt8Array, columns: Int64Array, radius_px: FloatArray, step_px: float, out: FloatArray
) -> None:
    """Find where floor ends on each bearing, between samples.

    Parameters
    ----------
    samples : (K, M, 3) uint8
        Colours.
    valid : (K, M) uint8
        Non-zero where a sample may be looked at.
    columns : (K,) int64
        Outermost sample of floor by its colour; -1 where none.
    radius_px : (M,) float64
        How far up the picture the columns lie.
    step_px : float
        Distance between columns.
    out : (K,) float64
        Filled with the foot, as `radius_px`: half a step behind the sample, or nearer, where what is behind is darker.
    """
    for k in range(len(columns)):
        last = columns[k]
        if last < 0:
            out[k] = float("nan")
            continue
        out[k] = radius_px[last] + 0.5 * step_px
        half = _half_way(samples, valid, k, last)
        for at in range(last, max(last - SPREAD, 0), -1):
            inner = _brightness(samples, k, at)
            if inner >= half:
                break
            nearer = _brightness(samples, k, at - 1)
            if nearer >= half:
                part = (nearer - half) / (nearer - inner)
                out[k] = radius_px[at - 1] + part * (radius_px[at] - radius_px[at - 1])
                break


@compiled
def doubt_beyond(columns: Int64Array, certain: int, llr: Int8Array) -> None:
    """Take back what little speaks for floor beyond the outermost floor (K,) of each bearing; -1: none is known."""
    for k in range(len(llr)):
        if columns[k] >= 0:
            row = llr[k, columns[k] + 1 :]
            # written in any case: without branches several are done at once
            for m in range(len(row)):
                row[m] = row[m] if (row[m] <= 0) | (row[m] >= certain) else 0
