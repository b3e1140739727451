"""Runs of goal paint, row by row, linked to upright strips."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable


@compiled
def link_runs(
    row: FloatArray, left: FloatArray, right: FloatArray, lean: float, max_gap: float, chain: Int64Array
) -> int:
    """Give each run the number of its chain: the runs that stack into one upright strip. They come sorted by row.

    A run continues the chain whose last run's ends are nearest, within one pixel plus what a strip leaning by `lean`
    (pixels per row) moves; `max_gap` rows may be missing. Returns the number of chains; `chain` (N,) holds each run's.
    """
    count = row.shape[0]
    last = np.empty(count, np.int64)
    chains, oldest = 0, 0
    taken = np.zeros(count, np.bool_)
    for n in range(count):
        best, at = np.inf, -1
        for k in range(oldest, chains):
            m = last[k]
            gap = row[n] - row[m]
            if gap <= 0 or gap > max_gap:
                continue
            tolerance = 1.0 + lean * gap
            off = max(abs(left[n] - left[m]), abs(right[n] - right[m]))
            if off <= tolerance and off + 0.5 * gap < best and not taken[m]:
                best, at = off + 0.5 * gap, k
        if at < 0:
            at = chains
            chains += 1
        else:
            taken[last[at]] = True
        last[at] = n
        chain[n] = at
        while oldest < chains and row[n] - row[last[oldest]] > max_gap:
            oldest += 1
    return chains


@compiled
def find_mask_runs(
    mask: UInt8Array, row_step: int, widest: int, row: FloatArray, left: FloatArray, right: FloatArray
) -> int:
    """Stretches of a mask in every `row_step`-th row, but for those that are too wide or touch the border.

    Parameters
    ----------
    mask : (H, W) uint8
        Non-zero on paint.
    row_step : int
        The first row is half of it.
    widest : int
        Of a stretch, pixels.
    row, left, right : (N,) float64
        Results: row, and the edges before its first and after its last pixel; room for all there may be.

    Returns
    -------
    int
        How many there are.
    """
    height, width = mask.shape
    count = variable(0)
    for v in range(row_step // 2, height, row_step):
        start = -1
        for u in range(width):
            if mask[v, u]:
                if start < 0:
                    start = u
            elif start >= 0:
                if start > 0 and u - start <= widest:
                    row[count], left[count], right[count] = v, start - 0.5, u - 0.5
                    count += 1
                start = -1
    return count
