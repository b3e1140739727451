"""Compiled sort, median and quantiles, which compile much faster than numba's own."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# number of histogram bins
_STEPS = 512


@compiled
def sort(values: FloatArray) -> None:
    """Sort in place by Shell's method with Knuth's gaps, for some hundred values at most."""
    count = values.shape[0]
    gap = 1
    while 3 * gap + 1 < count:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, count):
            value, place = values[i], i
            while place >= gap and values[place - gap] > value:
                values[place] = values[place - gap]
                place -= gap
            values[place] = value
        gap //= 3


@compiled
def sorted_median(values: FloatArray) -> float:
    """Sort in place and return the median of at least one value."""
    sort(values)
    count = values.shape[0]
    return 0.5 * float(values[(count - 1) // 2] + values[count // 2])


@compiled(error_model="numpy")
def quantiles(values: FloatArray, parts: FloatArray, scratch: FloatArray, out: FloatArray) -> None:
    """Write quantiles of many values, interpolated linearly.

    The values are counted in a histogram. Only those of the bin that holds a quantile are sorted.

    values : (N,) at least one value; all finite.
    parts, out : (Q,) probabilities, 0 to 1; (Q,) written.
    scratch : room for N + 1 values.
    """
    count = values.shape[0]
    low, high = values[0], values[0]
    for value in values:
        low, high = min(low, value), max(high, value)
    per_value = 0.0 if high == low else _STEPS * (1.0 - 1e-9) / (high - low)
    numbers = np.zeros(_STEPS, dtype=np.int64)
    for value in values:
        numbers[int((value - low) * per_value)] += 1
    for n in range(parts.shape[0]):
        place = parts[n] * (count - 1)
        rank = min(int(place), count - 1)
        step, before = 0, 0
        while before + numbers[step] <= rank:
            before += numbers[step]
            step += 1
        kept = 0
        for value in values:
            # written always and kept if it belongs to the bin: no branch to mispredict
            scratch[kept] = value
            kept += int((value - low) * per_value) == step
        sort(scratch[:kept])
        first = scratch[rank - before]
        out[n] = first
        if rank < count - 1:
            after = scratch[rank - before + 1] if rank - before + 1 < kept else _least_beyond(values, first)
            out[n] += (place - rank) * (after - first)


@compiled
def _least_beyond(values: FloatArray, bound: float) -> float:
    """Return the least value that is greater than a bound."""
    least = np.inf
    for value in values:
        if value > bound:
            least = min(least, value)
    return least
