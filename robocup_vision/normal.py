"""The cumulative distribution function of the normal distribution for arrays."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, read_only

# squared Mahalanobis distance within which 99.9 % of a normal distribution in two dimensions lie
GATE_2D = 13.8

# range of the table in standard deviations (beyond it lies a probability of 2e-19), and entries for each of them; the
# error of linear interpolation is at most 3e-8
_REACH, _STEPS = 9, 1024


def normal_below(z: npt.ArrayLike) -> FloatArray:
    """Return the probability that a standard normal variable is below each value, with an error of at most 3e-8."""
    table = _table()
    place = (np.clip(np.asarray(z, dtype=np.float64), -_REACH, _REACH) + _REACH) * _STEPS
    index = np.minimum(np.nan_to_num(place).astype(np.int64), len(table) - 2)
    return np.asarray(table[index] + (place - index) * (table[index + 1] - table[index]))


@lru_cache(maxsize=1)
def _table() -> FloatArray:
    at = np.linspace(-_REACH, _REACH, 2 * _REACH * _STEPS + 1)
    return read_only([0.5 * math.erfc(-z / math.sqrt(2.0)) for z in at.tolist()])
