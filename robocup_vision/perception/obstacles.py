"""Blocked stretches of the surroundings as things with a place and a width."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple, cast

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.kernels.floor.stretches import join_bearings


class Obstacle(NamedTuple):
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


# what `Obstacle._make` does, without a call of Python for each
_made = cast("Callable[[list[float]], Obstacle]", partial(tuple.__new__, Obstacle))


def join_places(
    places_m: FloatArray, seen: npt.NDArray[np.bool_], gap_m: float, step_rad: float
) -> tuple[Obstacle, ...]:
    """Join neighbouring bearings whose blocked places lie close together.

    Parameters
    ----------
    places_m : (K, 2) float64
        What blocks each bearing, robot frame.
    seen : (K,) bool
        Bearings that are blocked by what is no wall.
    gap_m : float
        Neighbours farther apart than this are different things, beyond what their bearings' spacing explains.
    step_rad : float
        That spacing.
    """
    found = np.empty((len(seen), 5))
    count = join_bearings(places_m, seen, gap_m, step_rad, found)
    return tuple(map(_made, found[:count].tolist()))
