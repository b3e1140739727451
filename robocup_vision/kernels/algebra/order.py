"""Compiled loops that order a few numbers: numba's own sort and median compile some thirty functions for each type."""

from __future__ import annotations

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


@compiled
def sort(values: FloatArray) -> None:
    """Sort in place, by Shell's method with Knuth's gaps: some hundred values at most."""
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
