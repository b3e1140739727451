"""Blocked stretches of the surroundings as things with a place and a width."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Obstacle:
    """The near side of something that stands on the floor, robot frame.

    Parameters
    ----------
    x_m, y_m : float
        Middle of its near side.
    width_m : float
        Distance between the ends of its near side.
    bearing_rad, range_m : float
        Of its middle.
    """

    x_m: float
    y_m: float
    width_m: float
    bearing_rad: float
    range_m: float


def find_obstacles(
    floor_m: FloatArray,
    blocked_column: npt.NDArray[np.int64],
    is_wall: npt.NDArray[np.bool_],
    gap_m: float,
    step_rad: float | None = None,
) -> tuple[Obstacle, ...]:
    """Join neighbouring bearings whose blocked samples lie close together.

    Parameters
    ----------
    floor_m : (K, M, 2) float64
        The samples' places on the floor, robot frame.
    blocked_column : (K,) int64
        First blocked column of each bearing, M where none.
    is_wall : (K,) bool
        Bearings whose blocked sample is known to be a wall: they belong to no obstacle.
    gap_m : float
        Neighbours farther apart than this are different things, beyond what their bearings' spacing explains.
    step_rad : float, optional
        That spacing; a whole turn over K unless given.
    """
    count, columns = floor_m.shape[:2]
    seen = (blocked_column < columns) & ~is_wall
    places = floor_m[np.arange(count), np.minimum(blocked_column, columns - 1)]
    x, y = places[:, 0], places[:, 1]
    seen &= np.isfinite(x) & np.isfinite(y)
    spacing = np.sqrt(x * x + y * y) * (math.tau / count if step_rad is None else step_rad)
    # slices instead of np.roll: views of a few hundred bearings cost less than its bookkeeping
    dx, dy = x - np.concatenate((x[-1:], x[:-1])), y - np.concatenate((y[-1:], y[:-1]))
    joined = seen & np.concatenate((seen[-1:], seen[:-1])) & (np.sqrt(dx * dx + dy * dy) < gap_m + spacing)
    starts = np.flatnonzero(seen & ~joined).tolist()
    if not starts and seen.all():
        starts = [0]
    # where a stretch of joined bearings ends: before the next bearing that is not joined to the one before it
    breaks = np.flatnonzero(~joined).tolist()
    # lists instead of arrays: a stretch has a few dozen bearings
    # twice round, so that a stretch over the last bearing is one slice
    xs, ys, spaces = 2 * x.tolist(), 2 * y.tolist(), 2 * spacing.tolist()
    found = []
    for start in starts:
        after = bisect_right(breaks, start)
        end = count + start if not breaks else breaks[after] if after < len(breaks) else count + breaks[0]
        end = min(end, start + count)
        last, bearings = end - 1, end - start
        middle_x, middle_y = sum(xs[start:end]) / bearings, sum(ys[start:end]) / bearings
        width = math.dist((xs[start], ys[start]), (xs[last], ys[last])) + sum(spaces[start:end]) / bearings
        found.append(
            Obstacle(middle_x, middle_y, width, math.atan2(middle_y, middle_x), math.hypot(middle_x, middle_y))
        )
    return tuple(found)
