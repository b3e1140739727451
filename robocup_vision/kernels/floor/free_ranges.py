"""Compiled loops over marked floor: how much of each cell is free, and where bearings end."""

from __future__ import annotations

from typing import NamedTuple

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
from robocup_vision.kernels.algebra.bits import NO_BITS, ONE, eight_equal, lowest
from robocup_vision.kernels.floor.free_floor import BLOCKED

# in each byte of a word of eight marks its lowest and its highest bit
EACH_BYTE, HIGH_BITS = np.uint64(0x0101010101010101), np.uint64(0x8080808080808080)


class FreeCells(NamedTuple):
    """The samples' cells, I rings by J directions, and when a cell is free.

    Parameters
    ----------
    cell : (K, M) int32
        Index of each sample's cell, ring * J + direction; -1: none.
    allowed : (I, J) int32
        Blocked samples that a cell may have and still be free.
    seen : (J,) int64
        Rings of each direction up to the last one that any sample sees.
    bounds_m : (I + 1,) float64
        Ranges between which the rings lie.
    near_m : (K, M) float32
        Range of each sample's near rim, metres.
    first_seen : (J,) int64
        Nearest ring of each direction that any sample sees.
    is_ring : bool
        Whether the samples lie all around the robot, and from its body on. Then neither of the last two is used.
    """

    cell: Int32Array
    allowed: Int32Array
    seen: Int64Array
    bounds_m: FloatArray
    near_m: Float32Array
    first_seen: Int64Array
    is_ring: bool


@compiled
def measure_ranges(passable_mask: UInt8Array, valid: UInt8Array, cells: FreeCells, range_m: FloatArray) -> None:
    """Measure how far the floor is free in each direction: up to its first cell that is not.

    In a view that is no ring samples lie far apart along a direction: within that cell the floor is free up to the
    nearest blocked sample. What stands in the nearest floor in view may stand anywhere nearer: the range is 0.

    Parameters
    ----------
    passable_mask : (K, M) uint8
    valid : (K, M) uint8
        Samples that are not valid block nothing.
    cells : FreeCells
        Of the samples.
    range_m : (J,) float64
        Filled, metres.
    """
    rings, directions = cells.allowed.shape
    count, nearest = np.zeros(rings * directions, np.int32), np.full(rings * directions, np.inf, np.float32)
    flat, counts = passable_mask.reshape(-1), valid.reshape(-1)
    cell, near_m = cells.cell.reshape(-1), cells.near_m.reshape(-1)
    # most samples are floor: only the others are counted
    for first in range(0, len(flat), 8):
        if first + 8 <= len(flat):
            blocked = eight_equal(flat, np.uint64(first), BLOCKED)
        else:
            blocked = NO_BITS
            for n in range(first, len(flat)):
                blocked |= np.uint64(flat[n] == BLOCKED) << np.uint64(n - first)
        while blocked != NO_BITS:
            at = np.uint64(first + lowest(blocked))
            blocked &= blocked - ONE
            if cell[at] >= 0 and counts[at]:
                index = np.uint32(cell[at])
                count[index] += 1
                if not cells.is_ring:
                    nearest[index] = min(nearest[index], near_m[at])
    for j in range(directions):
        ring = 0
        while ring < cells.seen[j] and count[ring * directions + j] <= cells.allowed[ring, j]:
            ring += 1
        range_m[j] = cells.bounds_m[ring]
        if cells.is_ring:
            continue
        if ring < rings and nearest[ring * directions + j] < np.inf:
            range_m[j] = max(range_m[j], nearest[ring * directions + j])
        if ring <= cells.first_seen[j]:
            range_m[j] = 0.0


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
