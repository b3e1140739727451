"""Runs of goal paint, row by row, linked to upright strips."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled


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
