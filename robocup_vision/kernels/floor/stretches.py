"""Joins neighbouring bearings at which something near the same place blocks the floor."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled, variable

BoolArray = npt.NDArray[np.bool_]


@compiled(error_model="numpy", inline="always")
def _goes_on(places_m: FloatArray, seen: BoolArray, gap_m: float, step_rad: float, n: int) -> bool:
    """Return whether bearing n shows the same thing as the one before it."""
    count = seen.shape[0]
    before = n - 1 if n > 0 else count - 1
    if not (seen[n] and seen[before]):
        return False
    x, y = places_m[n, 0], places_m[n, 1]
    # metres, which no square overflows
    apart = math.sqrt((x - places_m[before, 0]) ** 2 + (y - places_m[before, 1]) ** 2)
    return bool(apart < gap_m + math.sqrt(x * x + y * y) * step_rad)


@compiled(error_model="numpy")
def join_bearings(places_m: FloatArray, seen: BoolArray, gap_m: float, step_rad: float, out: FloatArray) -> int:
    """Join neighbouring bearings that show one thing; the last bearing is the first one's neighbour.

    Parameters
    ----------
    places_m : (K, 2) float64
        What blocks each bearing.
    seen : (K,) bool
        Where anything does.
    gap_m : float
        Neighbours farther apart than this and what their spacing explains are different things.
    step_rad : float
        Angle between bearings.
    out : (K, 5) float64
        Result: x and y of each thing's middle, its width, and the bearing and range of its middle.

    Returns
    -------
    int
        How many.
    """
    count, found, first = seen.shape[0], variable(0), variable(0)
    # a thing across the last bearing is whole where the round begins at a gap
    while first < count and _goes_on(places_m, seen, gap_m, step_rad, first):
        first += 1
    x, y, space, bearings, start, last = 0.0, 0.0, 0.0, variable(0), variable(0), variable(0)
    for k in range(count + 1):
        n = (first + k) % count
        if bearings > 0 and (k == count or not _goes_on(places_m, seen, gap_m, step_rad, n)):
            width = math.hypot(places_m[last, 0] - places_m[start, 0], places_m[last, 1] - places_m[start, 1])
            x, y = x / bearings, y / bearings
            out[found, 0], out[found, 1], out[found, 2] = x, y, width + space / bearings
            out[found, 3], out[found, 4] = math.atan2(y, x), math.hypot(x, y)
            found += 1
            x, y, space, bearings = 0.0, 0.0, 0.0, 0
        if k < count and seen[n]:
            start, last = n if bearings == 0 else start, n
            x += places_m[n, 0]
            y += places_m[n, 1]
            space += math.sqrt(places_m[n, 0] ** 2 + places_m[n, 1] ** 2) * step_rad
            bearings += 1
    return found
