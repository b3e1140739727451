"""Compiled loops over marked floor: how much of each cell is free, and where bearings end."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import (
    Float32Array,
    FloatArray,
    Int8Array,
    Int32Array,
    Int64Array,
    UInt8Array,
)
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.floor.free_floor import BLOCKED

# in each byte of a word of eight marks its lowest and its highest bit
EACH_BYTE, HIGH_BITS = np.uint64(0x0101010101010101), np.uint64(0x8080808080808080)


@compiled
def free_rings(
    passable_mask: UInt8Array,
    cell: Int32Array,
    needed: Int32Array,
    seen: Int64Array,
    bounds_m: FloatArray,
    free: Int32Array,
    range_m: FloatArray,
) -> None:
    """Count the passable samples of each cell, and the rings of each direction before its first blocked cell.

    Parameters
    ----------
    passable_mask : (K, M) uint8
    cell : (K, M) int32
        Index of each sample's cell, ring * J + direction; -1: none.
    needed : (I, J) int32
        Passable samples that make a cell free.
    seen : (J,) int64
        Rings of each direction up to the last one that any sample sees.
    bounds_m : (I + 1,) float64
        Ranges between which the rings lie.
    free, range_m : (J,) int32, (J,) float64
        Filled with the number of free rings, and the range at which they end.
    """
    rows, columns = cell.shape
    rings, directions = needed.shape
    count = np.zeros(rings * directions, np.int32)
    for k in range(rows):
        for m in range(columns):
            if cell[k, m] >= 0 and passable_mask[k, m] != 0:
                count[cell[k, m]] += 1
    for j in range(directions):
        ring = 0
        while ring < seen[j] and count[ring * directions + j] >= needed[ring, j]:
            ring += 1
        free[j], range_m[j] = ring, bounds_m[ring]


@compiled
def to_first_blocked(
    passable_mask: UInt8Array, cell: Int32Array, near_m: Float32Array, rings: Int32Array, range_m: FloatArray
) -> None:
    """Lengthen ranges that end before a blocked cell to the nearest of its samples that is blocked.

    Parameters
    ----------
    passable_mask : (K, M) uint8
    cell : (K, M) int32
        Index of each sample's cell, ring * J + direction; -1: none.
    near_m : (K, M) float32
        Range of each sample's near rim, metres.
    rings : (J,) int32
        Free rings of each direction.
    range_m : (J,) float64
        Range of their far bound, metres; lengthened.
    """
    rows, columns = cell.shape
    directions = len(rings)
    nearest = np.full(directions, np.inf, np.float32)
    # looked up, as dividing by the number of directions takes longer than all else
    ended = np.full((max(rings) + 1) * directions, -1, np.int16)
    for j in range(directions):
        ended[rings[j] * directions + j] = j
    count = np.uint32(len(ended))
    for k in range(rows):
        for m in range(columns):
            # no cell, -1, is beyond all of them as an unsigned number
            if passable_mask[k, m] == BLOCKED and np.uint32(cell[k, m]) < count:
                j = ended[np.uint32(cell[k, m])]
                if j >= 0:
                    nearest[j] = min(nearest[j], near_m[k, m])
    for j in range(directions):
        if nearest[j] < np.inf:
            range_m[j] = max(range_m[j], nearest[j])


@compiled
def sum_near(llr: Int8Array, columns: int) -> int:
    """Return the sum of the likelihood ratios (K, M) in the nearest columns."""
    total = 0
    for k in range(llr.shape[0]):
        for m in range(columns):
            total += llr[k, m]
    return total


@compiled(inline="always")
def _has_blocked(eight: np.uint64) -> bool:
    """Whether any of eight marks is BLOCKED, 0: the first such byte borrows from the bit above it."""
    return bool((eight - EACH_BYTE) & ~eight & HIGH_BITS)


@compiled
def first_blocked(
    passable_mask: UInt8Array, valid: UInt8Array, first_column: int, columns_in_use: int, run: int, out: Int64Array
) -> None:
    """Find the first of `run` blocked samples in a row on each bearing, from `first_column` on.

    Writes out (K,) int64: its column; `columns_in_use` where nothing blocks.
    """
    rows, columns = passable_mask.shape
    flat, count = passable_mask.reshape(-1), rows * columns
    eights = flat[: count - count % 8].view(np.uint64)
    for k in range(rows):
        out[k] = columns_in_use
        blocked = 0
        m = first_column
        while m < columns_in_use:
            at = k * columns + m
            # most of a row is floor: eight samples at once
            if blocked == 0 and at % 8 == 0 and m + 8 <= columns_in_use and not _has_blocked(eights[at // 8]):
                m += 8
                continue
            if valid[k, m]:
                blocked = 0 if passable_mask[k, m] else blocked + 1
                if blocked == run:
                    first = m
                    while first > first_column and not passable_mask[k, first - 1] and valid[k, first - 1]:
                        first -= 1
                    out[k] = first
                    break
            m += 1
