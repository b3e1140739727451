"""Compiled loops over the polar samples: what may be driven over, how much of each cell, and where bearings end."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled

BLOCKED, FLOOR, LINE, BALL = 0, 1, 2, 3


@compiled
def passable(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_columns: Int32Array,
    line_rows: Int32Array,
    columns_in_use: int,
    outermost: Int64Array,
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
    outermost : (K,) int64
        Column of the outermost floor of each bearing: beyond it all is blocked. -1: not known.
    out : (K, M) uint8
        Filled with BLOCKED, FLOOR or LINE.
    """
    rows, columns = llr.shape
    for k in range(rows):
        for m in range(columns):
            out[k, m] = FLOOR if llr[k, m] > 0 else BLOCKED
    _clear_blur(samples, llr, valid, columns_in_use, outermost, out)
    _clear_single(valid, columns_in_use, out)
    _mark_lines_along(samples, llr, valid, line_columns, columns_in_use, out)
    _mark_lines_across(samples, llr, valid, line_rows, columns_in_use, out)
    _block_corners(valid, line_columns, columns_in_use, out)


@compiled
def _clear_blur(
    samples: UInt8Array, llr: Int8Array, valid: UInt8Array, columns_in_use: int, outermost: Int64Array, out: UInt8Array
) -> None:
    """Make floor of what is bright only by the samples' blur, and of specks of three by three samples at most.

    The blur spreads what is bright over the floor beside it by a sample; what is dark hardly colours its neighbours.
    """
    rows = llr.shape[0]
    for k in range(rows):
        here, right, right2 = llr[k], llr[(k - 1) % rows], llr[(k - 2) % rows]
        left, left2 = llr[(k + 1) % rows], llr[(k + 2) % rows]
        # floor beside it may reach farther than its own
        end = 0
        for step in range(-2, 3):
            reach = outermost[(k + step) % rows]
            end = max(end, reach + 2 if reach >= 0 else columns_in_use - 2)
        end = min(end, columns_in_use - 2)
        for m in range(2, end):
            if here[m] > 0 or not valid[k, m]:
                continue
            if (
                max(here[m - 1], here[m - 2]) > 0
                and max(here[m + 1], here[m + 2]) > 0
                and max(right[m], right2[m]) > 0
                and max(left[m], left2[m]) > 0
            ):
                is_floor = True
            elif here[m - 1] > 0 and here[m - 2] > 0:
                is_floor = _is_brighter(samples[k, m], samples[k, m - 2])
            elif here[m + 1] > 0 and here[m + 2] > 0:
                is_floor = _is_brighter(samples[k, m], samples[k, m + 2])
            elif right[m] > 0 and right2[m] > 0:
                is_floor = _is_brighter(samples[k, m], samples[(k - 2) % rows, m])
            elif left[m] > 0 and left2[m] > 0:
                is_floor = _is_brighter(samples[k, m], samples[(k + 2) % rows, m])
            else:
                is_floor = False
            if is_floor:
                out[k, m] = FLOOR


@compiled
def _clear_single(valid: UInt8Array, columns_in_use: int, out: UInt8Array) -> None:
    """Make floor of single blocked samples among floor: they are noise, for what stands there would hide more."""
    rows = out.shape[0]
    for k in range(rows):
        above, below = out[(k - 1) % rows], out[(k + 1) % rows]
        for m in range(1, columns_in_use - 1):
            if (
                out[k, m] == BLOCKED
                and valid[k, m]
                and out[k, m - 1] != BLOCKED
                and out[k, m + 1] != BLOCKED
                and above[m] != BLOCKED
                and below[m] != BLOCKED
            ):
                out[k, m] = FLOOR


@compiled
def _mark_lines_along(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_columns: Int32Array,
    columns_in_use: int,
    out: UInt8Array,
) -> None:
    """Mark bright stripes between floor on one bearing that are no longer than a line is wide."""
    rows = llr.shape[0]
    for k in range(rows):
        # the robot stands on the floor: what lies under its rim is bounded by floor
        last, floor = -1, -1
        for m in range(columns_in_use):
            if out[k, m] == BLOCKED:
                continue
            if llr[k, m] > 0 or floor < 0:
                floor = m
            if 1 < m - last <= line_columns[m] + 1:
                blue, red = 0, 0
                for j in range(last + 1, m):
                    if valid[k, j]:
                        blue, red = max(blue, int(samples[k, j, 0])), max(red, int(samples[k, j, 2]))
                if blue > samples[k, floor, 0] and red > samples[k, floor, 2]:
                    for j in range(last + 1, m):
                        if valid[k, j]:
                            out[k, j] = LINE
            last = m


@compiled
def _mark_lines_across(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_rows: Int32Array,
    columns_in_use: int,
    out: UInt8Array,
) -> None:
    """Mark bright stripes between floor on one ring that are no wider than a line.

    Where two lines meet, what lies between is bounded by line; it must still be whiter than the floor.
    """
    rows = llr.shape[0]
    before = np.full(columns_in_use, -1)
    floors = np.full(columns_in_use, -1)
    # once round and a little further, so that a line across row 0 is closed, too
    for step in range(rows + line_rows[0] + 1):
        k = step if step < rows else step - rows
        for m in range(columns_in_use):
            if out[k, m] == BLOCKED:
                continue
            if llr[k, m] > 0 or floors[m] < 0:
                floors[m] = k
            if 1 < step - before[m] <= line_rows[m] + 1 and before[m] >= 0:
                blue, red = 0, 0
                for i in range(before[m] + 1, step):
                    j = i if i < rows else i - rows
                    if valid[j, m]:
                        blue, red = max(blue, int(samples[j, m, 0])), max(red, int(samples[j, m, 2]))
                if blue > samples[floors[m], m, 0] and red > samples[floors[m], m, 2]:
                    for i in range(before[m] + 1, step):
                        j = i if i < rows else i - rows
                        if valid[j, m]:
                            out[j, m] = LINE
            before[m] = step


@compiled
def _block_corners(valid: UInt8Array, line_columns: Int32Array, columns_in_use: int, out: UInt8Array) -> None:
    """Block the lines that lead up to something blocked.

    A bright corner that points at the robot is no wider than a line at first, over the depth at which a right angle
    has opened to that width.
    """
    rows = out.shape[0]
    for k in range(rows):
        left = 0
        for m in range(columns_in_use - 1, -1, -1):
            if not valid[k, m]:
                continue
            if out[k, m] == BLOCKED:
                left = (line_columns[m] + 1) // 2
            elif out[k, m] == LINE and left > 0:
                out[k, m] = BLOCKED
                left -= 1
            else:
                left = 0


@compiled
def clear_ball(
    center_row: float,
    center_radius: float,
    half_rows: float,
    half_px: float,
    radius_px: FloatArray,
    marks: UInt8Array,
) -> None:
    """Mark the blocked samples on a ball and its shadow as BALL: within an ellipse about (row, image radius)."""
    rows = marks.shape[0]
    for m in range(radius_px.shape[0]):
        along = (radius_px[m] - center_radius) / half_px
        if abs(along) > 1.0:
            continue
        reach = half_rows * math.sqrt(1.0 - along * along)
        for step in range(int(math.ceil(center_row - reach)), int(math.floor(center_row + reach)) + 1):
            if marks[step % rows, m] == BLOCKED:
                marks[step % rows, m] = BALL


@compiled
def _is_brighter(sample: UInt8Array, floor: UInt8Array) -> bool:
    """Whether a colour is brighter than the floor's."""
    return bool(int(sample[0]) + sample[1] + sample[2] > int(floor[0]) + floor[1] + floor[2])


@compiled
def free_rings(
    passable_mask: UInt8Array, cell: Int32Array, needed: Int32Array, seen: Int64Array, free: Int32Array
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
    free : (J,) int32
        Filled with the number of free rings.
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
        free[j] = ring


@compiled
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
