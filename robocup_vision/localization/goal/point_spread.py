"""Point spreads that a picture may have, as the light of a step in each pixel near it.

Every pixel is the mean over its own square; demosaicing mixes neighbours, a lens spreads as a normal distribution does.
JPEG and video keep colour at half the resolution: two pixels have one value, which is interpolated again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray

PER_PX = 64
_REACH_PX = 4
# how a row of values at half the resolution is spread over an even pixel and, mirrored, over an odd one
_HALVED = {"linear": ((-2, 0.125), (-1, 0.125), (0, 0.375), (1, 0.375)), "nearest": ((0, 0.5), (1, 0.5))}


class PointSpread(NamedTuple):
    """A point spread along one axis of the picture."""

    mixed: float  #: weight of each neighbour in a pixel
    lens_px: float  #: standard deviation of the lens's spread
    #: how a channel at half the resolution is spread over the pixels: "linear" or "nearest"; empty: it is whole
    halved: str = ""

    @property
    def shared(self) -> int:
        """Number of pixels, in rows and columns, with one common value."""
        return 4 if self.halved else 1


_MIXED, _LENS_PX = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25), (0.05, 0.3, 0.5, 0.7, 0.9)
SPREADS = tuple(PointSpread(mixed, lens_px) for mixed in _MIXED for lens_px in _LENS_PX)
HALVED = tuple(_HALVED)
TYPICAL = PointSpread(0.1, 0.5)


def neighbours(spread: PointSpread) -> tuple[PointSpread, ...]:
    """One of `SPREADS` and those that differ from it by one step in mixing, in the lens or in both."""
    i, j = _MIXED.index(spread.mixed), _LENS_PX.index(spread.lens_px)
    return tuple(
        PointSpread(mixed, lens_px)
        for mixed in _MIXED[max(0, i - 1) : i + 2]
        for lens_px in _LENS_PX[max(0, j - 1) : j + 2]
    )


def nearest_best(cost: Callable[[PointSpread], float], start: PointSpread) -> PointSpread:
    """Go from one of `SPREADS` to its best neighbour while that costs less."""
    known = cache(cost)
    best = start
    while (better := min(neighbours(best), key=known)) != best and known(better) < known(best):
        best = better
    return best


@lru_cache(maxsize=128)
def step_response(spread: PointSpread) -> FloatArray:
    """Light of a step in even and odd pixels beyond it, and its derivative: (2, K, 2), `PER_PX` entries to a pixel."""
    at = np.arange(-_REACH_PX * PER_PX, _REACH_PX * PER_PX + 1) / PER_PX
    light, density = np.zeros_like(at), np.zeros_like(at)
    for offset, weight in ((-1, spread.mixed), (0, 1 - 2 * spread.mixed), (1, spread.mixed)):
        before, after = (_blurred(at - offset + half, spread.lens_px) for half in (-0.5, 0.5))
        light += weight * (after[0] - before[0])
        density += weight * (after[1] - before[1])
    if not spread.halved:
        response = np.stack([light, density], axis=-1)
        return np.stack([response, response])
    parities = []
    for sign in (1, -1):
        parts = [(weight, at + sign * offset) for offset, weight in _HALVED[spread.halved]]
        parities.append([sum(weight * np.interp(where, at, f) for weight, where in parts) for f in (light, density)])
    return np.ascontiguousarray(np.moveaxis(np.array(parities), 1, 2))


def _blurred(at: FloatArray, std: float) -> tuple[FloatArray, FloatArray]:
    """Integral of a step blurred by a normal distribution, and that step."""
    step = np.array([0.5 * math.erfc(-t / (std * math.sqrt(2.0))) for t in at])
    return at * step + std * np.exp(-0.5 * (at / std) ** 2) / math.sqrt(2.0 * math.pi), step
