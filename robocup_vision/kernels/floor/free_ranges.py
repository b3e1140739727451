"""Compiled measurement of the free range in each direction."""

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


class FreeCells(NamedTuple):
    """The samples' cells, I rings by J directions, and the bounds for free cells.

    Parameters
    ----------
    cell : (K, M) int32
        Index of each sample's cell, ring * J + direction; -1 if it belongs to none.
    allowed : (I, J) int32
        Greatest number of blocked samples in a free cell.
    seen : (J,) int64
        Number of rings in each direction up to the last one with valid samples.
    bounds_m : (I + 1,) float64
        Boundaries of the rings.
    near_m : (K, M) float32
        Range of each sample's near edge, metres.
    first_m : (J,) float64
        Range in each direction beyond which all its bearings are visible, metres.
    is_ring : bool
        Whether the samples surround the robot and begin at its body; then `near_m` and `first_m` are not used.
    """

    cell: Int32Array
    allowed: Int32Array
    seen: Int64Array
    bounds_m: FloatArray
    near_m: Float32Array
    first_m: FloatArray
    is_ring: bool


@compiled
def measure_ranges(passable_mask: UInt8Array, valid: UInt8Array, cells: FreeCells, range_m: FloatArray) -> None:
    """Measure the range of free floor in each direction, up to its first cell that is not free.

    If the view is no ring, samples are far apart along a direction; then the floor within that cell is free up to the
    nearest blocked sample. If that sample is where the floor comes into view, the obstacle may be nearer: range 0.

    Parameters
    ----------
    passable_mask : (K, M) uint8
    valid : (K, M) uint8
        Samples that are not valid block nothing.
    cells : FreeCells
        Cells of the samples.
    range_m : (J,) float64
        Filled, metres.
    """
    rings, directions = cells.allowed.shape
    count, nearest = np.zeros(rings * directions, np.int32), np.full(rings * directions, np.inf, np.float32)
    flat, counts = passable_mask.reshape(-1), valid.reshape(-1)
    cell, near_m = cells.cell.reshape(-1), cells.near_m.reshape(-1)
    # eight samples at once, because most are floor
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
        if ring == rings or nearest[ring * directions + j] == np.inf:
            continue
        range_m[j] = max(range_m[j], nearest[ring * directions + j])
        if nearest[ring * directions + j] <= cells.first_m[j]:
            range_m[j] = 0.0


@compiled
def sum_near(llr: Int8Array, columns: int) -> int:
    """Return the sum of the likelihood ratios (K, M) in the nearest columns."""
    total = 0
    for k in range(llr.shape[0]):
        for m in range(columns):
            total += llr[k, m]
    return total
