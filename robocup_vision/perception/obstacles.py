"""Blocked stretches of the surroundings as things with a place and a width."""

from __future__ import annotations

import math
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
    seen &= np.isfinite(places).all(axis=1)
    spacing = np.linalg.norm(places, axis=1) * (math.tau / count if step_rad is None else step_rad)
    step = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    joined = seen & np.roll(seen, 1) & (step < gap_m + spacing)
    starts = np.flatnonzero(seen & ~joined)
    if not len(starts):
        starts = np.array([0]) if seen.all() else starts
    found = []
    for start in starts:
        stretch = [int(start)]
        while len(stretch) < count and joined[(stretch[-1] + 1) % count]:
            stretch.append((stretch[-1] + 1) % count)
        ends = places[[stretch[0], stretch[-1]]]
        x, y = (float(v) for v in places[stretch].mean(axis=0))
        width = float(np.hypot(*(ends[1] - ends[0]))) + float(spacing[stretch].mean())
        found.append(Obstacle(x, y, width, math.atan2(y, x), math.hypot(x, y)))
    return tuple(found)
