"""Compiled bit operations on 64-bit words that hold one bit for each sample or pixel."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.compiling.loops import compiled

NO_BITS, ONE, EVERY_BIT = np.uint64(0), np.uint64(1), ~np.uint64(0)
TWO, THREE, FOUR, FIVE, SIX, SEVEN = (
    np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5), np.uint64(6), np.uint64(7)
)  # fmt: skip
# eight bytes of value 1; a product with _GATHER moves the lowest bits of eight bytes into the highest byte
_ONES, _GATHER, _HIGHEST = np.uint64(0x0101010101010101), np.uint64(0x0102040810204080), np.uint64(56)
# de Bruijn number: the upper six bits of its products with the powers of two are all different
_DE_BRUIJN = np.uint64(0x03F79D71B4CB0A89)
_PLACES = np.empty(64, np.int64)
for _bit in range(64):
    _PLACES[((1 << _bit) * int(_DE_BRUIJN) >> 58) % 64] = _bit


@compiled
def lowest(bits: np.uint64) -> int:
    """Return the index of the lowest bit that is set."""
    return int(_PLACES[((bits & (~bits + ONE)) * _DE_BRUIJN) >> np.uint64(58)])


@compiled(inline="always")
def eight_bytes(values: UInt8Array, at: np.uint64) -> np.uint64:
    """Return eight consecutive bytes as one number, the first one lowest; the compiler loads them at once."""
    low = (
        np.uint64(values[at])
        | np.uint64(values[at + ONE]) << np.uint64(8)
        | np.uint64(values[at + TWO]) << np.uint64(16)
        | np.uint64(values[at + THREE]) << np.uint64(24)
    )
    return np.uint64(
        low
        | np.uint64(values[at + FOUR]) << np.uint64(32)
        | np.uint64(values[at + FIVE]) << np.uint64(40)
        | np.uint64(values[at + SIX]) << np.uint64(48)
        | np.uint64(values[at + SEVEN]) << np.uint64(56)
    )


@compiled(inline="always")
def eight_equal(values: UInt8Array, at: np.uint64, value: int) -> np.uint64:
    """Return one bit for each of eight consecutive bytes: whether it equals `value`. All bytes must be below 4."""
    # bytes below 4 differ in their two lowest bits if at all
    other = eight_bytes(values, at) ^ (np.uint64(value) * _ONES)
    return np.uint64(((~(other | (other >> ONE)) & _ONES) * _GATHER) >> _HIGHEST)
