"""Compiled arithmetic on words of 64 bits, one for each sample or pixel."""

from __future__ import annotations

import numpy as np

from robocup_vision.compiling.loops import compiled

NO_BITS, ONE, EVERY_BIT = np.uint64(0), np.uint64(1), ~np.uint64(0)
# the upper six bits of the product of a power of two and this number are different for each (de Bruijn)
_DE_BRUIJN = np.uint64(0x03F79D71B4CB0A89)
_PLACES = np.empty(64, np.int64)
for _bit in range(64):
    _PLACES[((1 << _bit) * int(_DE_BRUIJN) >> 58) % 64] = _bit


@compiled
def lowest(bits: np.uint64) -> int:
    """Return the place of the lowest bit that is set."""
    return int(_PLACES[((bits & (~bits + ONE)) * _DE_BRUIJN) >> np.uint64(58)])
