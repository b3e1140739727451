"""Compiled loops over the polar samples: what may be driven over, the share of each cell, and where bearings end."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Int8Array = npt.NDArray[np.int8]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
UInt8Array = npt.NDArray[np.uint8]

BLOCKED, FLOOR, LINE = 0, 1, 2


@njit(cache=True, nogil=True)
def passable(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_columns: Int32Array,
    line_rows: Int32Array,
    columns_in_use: int,
    out: UInt8Array,
) -> None:
    """Mark floor, and bright stripes between floor that are no wider than a painted line.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    llr : (K, M) int8
        Floor likelihood ratio; positive is floor.
    valid : (K, M) uint8
        Samples that are not valid interrupt nothing and count as nothing.
    line_columns, line_rows : (M,) int32
        Widest line at each column, in samples across and along the rows.
    columns_in_use : int
        Columns below the horizon.
    out : (K, M) uint8
        Filled with BLOCKED, FLOOR or LINE.
    """
    rows, columns = llr.shape
    for k in range(rows):
        last = -1
        for m in range(columns):
            out[k, m] = FLOOR if llr[k, m] > 0 else BLOCKED
        for m in range(columns_in_use):
            if llr[k, m] <= 0:
                continue
            if last >= 0 and 1 < m - last <= line_columns[m] + 1:
                blue, red = 0, 0
                for j in range(last + 1, m):
                    blue, red = max(blue, int(samples[k, j, 0])), max(red, int(samples[k, j, 2]))
                if _is_whiter(blue, red, samples[k, last], samples[k, m]):
                    for j in range(last + 1, m):
                        out[k, j] = LINE
            last = m
    for m in range(columns_in_use):
        widest = line_rows[m] + 1
        last = -1
        # once round and a little further, so that a line across row 0 is closed, too
        for step in range(rows + widest):
            k = step if step < rows else step - rows
            if llr[k, m] <= 0:
                continue
            if last >= 0 and 1 < step - last <= widest:
                blue, red = 0, 0
                for i in range(last + 1, step):
                    j = i if i < rows else i - rows
                    blue, red = max(blue, int(samples[j, m, 0])), max(red, int(samples[j, m, 2]))
                if _is_whiter(blue, red, samples[last if last < rows else last - rows, m], samples[k, m]):
                    for i in range(last + 1, step):
                        out[i if i < rows else i - rows, m] = LINE
            last = step


@njit(cache=True, nogil=True)
def _is_whiter(blue: int, red: int, before: UInt8Array, after: UInt8Array) -> bool:
    """Whether paint is whiter than the floor on both sides: by an eighth, in blue and in red."""
    return 16 * blue > 9 * (int(before[0]) + after[0]) and 16 * red > 9 * (int(before[2]) + after[2])


@njit(cache=True, nogil=True)
def count_cells(passable_mask: UInt8Array, cell: Int32Array, free: Int32Array) -> None:
    """Count the passable samples of each cell.

    Parameters
    ----------
    passable_mask : (K, M) uint8
    cell : (K, M) int32
        Index of each sample's cell, -1: none.
    free : (C,) int32
        Filled with the counts.
    """
    free[:] = 0
    rows, columns = cell.shape
    for k in range(rows):
        for m in range(columns):
            if cell[k, m] >= 0 and passable_mask[k, m] != 0:
                free[cell[k, m]] += 1


@njit(cache=True, nogil=True)
def first_blocked(
    passable_mask: UInt8Array, valid: UInt8Array, first_column: int, columns_in_use: int, run: int, out: Int64Array
) -> None:
    """Find the first of `run` blocked samples in a row on each bearing, from `first_column` on.

    Writes out (K,) int64: its column; `columns_in_use` where nothing blocks.
    """
    rows = passable_mask.shape[0]
    for k in range(rows):
        out[k] = columns_in_use
        blocked = 0
        for m in range(first_column, columns_in_use):
            if not valid[k, m]:
                continue
            blocked = 0 if passable_mask[k, m] else blocked + 1
            if blocked == run:
                first = m
                while first > first_column and not passable_mask[k, first - 1] and valid[k, first - 1]:
                    first -= 1
                out[k] = first
                break
