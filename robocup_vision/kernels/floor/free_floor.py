"""Compiled marking of the polar samples that can be driven over."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import (
    BoolArray,
    FloatArray,
    Int8Array,
    Int32Array,
    Int64Array,
    UInt8Array,
    UInt64Array,
)
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.bits import EVERY_BIT, NO_BITS, ONE, lowest

BLOCKED, FLOOR, LINE, BALL = 0, 1, 2, 3
TWO, ALL = np.uint64(2), np.uint64(64)


@compiled
def passable(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_columns: Int32Array,
    line_rows: Int32Array,
    columns_in_use: int,
    is_ring: bool,
    outermost: Int64Array,
    out: UInt8Array,
) -> None:
    """Mark floor, and bright stripes between floor that are no wider than a painted line.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    llr : (K, M) int8
        The floor's log-likelihood ratio; positive is floor.
    valid : (K, M) uint8
        Samples that are not valid are ignored.
    line_columns, line_rows : (M,) int32
        Greatest width of a line at each column, in samples along and across the bearing.
    columns_in_use : int
        Columns below the horizon.
    is_ring : bool
        Whether the last row is adjacent to the first. Otherwise the last two rows are not valid.
    outermost : (K,) int64
        Column of the outermost floor of each bearing, beyond which all is blocked; -1 if not known.
    out : (K, M) uint8
        Filled with BLOCKED, FLOOR or LINE.
    """
    rows, columns = llr.shape
    words = (columns + 63) // 64
    # one bit for each sample, so that one operation tests 64 samples: floor by colour, not blocked so far, and valid
    floor, free, shown = np.zeros((3, rows, words + 2), np.uint64)
    for k in range(rows):
        for m in range(columns):
            out[k, m] = FLOOR if llr[k, m] > 0 else BLOCKED
        for word in range(words):
            first = 64 * word
            is_floor, counts = NO_BITS, NO_BITS
            for bit in range(min(64, columns_in_use - first)):
                is_floor |= np.uint64(llr[k, first + bit] > 0) << np.uint64(bit)
                counts |= np.uint64(valid[k, first + bit] != 0) << np.uint64(bit)
            # the first and the last word stay empty
            floor[k, word + 1], free[k, word + 1], shown[k, word + 1] = is_floor, is_floor, counts
    _clear_blur(samples, floor, shown, columns_in_use, outermost, free, out)
    _clear_single(shown, columns_in_use, free, out)
    has_line = np.zeros(rows, np.bool_)
    _mark_lines_along(samples, llr, valid, line_columns, free, has_line, out)
    _mark_lines_across(samples, llr, valid, line_rows, is_ring, free, has_line, out)
    _block_corners(valid, line_columns, columns_in_use, has_line, out)


@compiled
def _outward(row: UInt64Array, word: int, by: np.uint64) -> np.uint64:
    """Return the bits of a word's samples moved outwards by a number of columns."""
    return np.uint64((row[word] << by) | (row[word - 1] >> (ALL - by)))


@compiled
def _inward(row: UInt64Array, word: int, by: np.uint64) -> np.uint64:
    """Return the bits of a word's samples moved inwards by a number of columns."""
    return np.uint64((row[word] >> by) | (row[word + 1] << (ALL - by)))


@compiled
def _columns(word: int, first: int, end: int) -> np.uint64:
    """Return the bits of a word's columns from `first` to before `end`."""
    low, high = max(first - 64 * (word - 1), 0), min(end - 64 * (word - 1), 64)
    if low >= high:
        return NO_BITS
    return (EVERY_BIT >> np.uint64(64 - (high - low))) << np.uint64(low)


@compiled
def _clear_blur(
    samples: UInt8Array,
    floor: UInt64Array,
    shown: UInt64Array,
    columns_in_use: int,
    outermost: Int64Array,
    free: UInt64Array,
    out: UInt8Array,
) -> None:
    """Mark specks of at most 3 x 3 samples, and samples that are bright only by blur, as floor.

    Blur spreads bright colours over one adjacent sample; dark ones hardly change their neighbours.
    """
    rows, columns = len(floor), samples.shape[1]
    flat = samples.reshape(-1)
    for k in range(rows):
        # negative indices instead of a remainder, which would take longer than the rest of a row
        here, right, right2, left, left2 = (
            floor[k],
            floor[k - 1],
            floor[k - 2],
            floor[k + 1 - rows],
            floor[k + 2 - rows],
        )
        # floor of neighbouring bearings may extend farther
        end = 0
        for step in range(-2, 3):
            reach = outermost[k + step - rows if step > 0 else k + step]
            end = max(end, reach + 2 if reach >= 0 else columns_in_use - 2)
        end = min(end, columns_in_use - 2)
        to_right, to_left = (-2 if k >= 2 else rows - 2) * columns, (2 if k + 2 < rows else 2 - rows) * columns
        for word in range(1, len(here) - 1):
            blocked = ~here[word] & shown[k, word] & _columns(word, 2, end)
            if blocked == NO_BITS:
                continue
            inner, inner2 = _outward(here, word, ONE), _outward(here, word, TWO)
            outer, outer2 = _inward(here, word, ONE), _inward(here, word, TWO)
            within = (inner | inner2) & (outer | outer2) & (right[word] | right2[word]) & (left[word] | left2[word])
            becomes = blocked & within
            on_inner, on_outer, on_right = inner & inner2, outer & outer2, right[word] & right2[word]
            doubtful = blocked & ~within & (on_inner | on_outer | on_right | (left[word] & left2[word]))
            while doubtful != NO_BITS:
                bit = lowest(doubtful)
                one = ONE << np.uint64(bit)
                doubtful &= ~one
                # compared with the nearest sample of floor that is two samples wide
                away = to_right if on_right & one else to_left
                away = 2 if on_outer & one else away
                away = -2 if on_inner & one else away
                at = k * columns + 64 * (word - 1) + bit
                is_brighter = _level(flat, np.uint64(3 * at)) > _level(flat, np.uint64(3 * (at + away)))
                becomes |= one if is_brighter else NO_BITS
            _mark(becomes, FLOOR, k, word, free, out)


@compiled
def _mark(bits: np.uint64, kind: int, k: int, word: int, free: UInt64Array, out: UInt8Array) -> None:
    """Mark samples of a word as not blocked."""
    free[k, word] |= bits
    while bits != NO_BITS:
        out[k, 64 * (word - 1) + lowest(bits)] = kind
        bits &= bits - ONE


@compiled
def _clear_single(shown: UInt64Array, columns_in_use: int, free: UInt64Array, out: UInt8Array) -> None:
    """Mark single blocked samples among floor as floor: an object would block more than one."""
    rows = len(free)
    for k in range(rows):
        here, above, below = free[k], free[k - 1], free[k + 1 - rows]
        for word in range(1, len(here) - 1):
            beside = _outward(here, word, ONE) & _inward(here, word, ONE) & above[word] & below[word]
            single = ~here[word] & shown[k, word] & beside & _columns(word, 1, columns_in_use - 1)
            _mark(single, FLOOR, k, word, free, out)


@compiled
def _mark_lines_along(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_columns: Int32Array,
    free: UInt64Array,
    has_line: BoolArray,
    out: UInt8Array,
) -> None:
    """Mark bright stripes between floor along a bearing that are not longer than a line is wide."""
    for k in range(len(free)):
        first = begin = -1
        for word in range(1, free.shape[1] - 1):
            if first < 0 and free[k, word] != NO_BITS:
                first = 64 * (word - 1) + lowest(free[k, word])
            # samples that are not blocked behind a blocked one
            ends = free[k, word] & ~_outward(free[k], word, ONE)
            if word == 1:
                ends &= ~ONE
            while ends != NO_BITS:
                m = 64 * (word - 1) + lowest(ends)
                ends &= ends - ONE
                # samples under the robot's or the picture's border count as floor, because the robot stands on it
                if begin < 0:
                    begin = 0
                    while not valid[k, begin] and begin < m:
                        begin += 1
                last = m - 1
                while last >= begin and out[k, last] == BLOCKED and m - last <= line_columns[m] + 1:
                    last -= 1
                if m - last > line_columns[m] + 1:
                    continue
                at = m
                while at >= 0 and llr[k, at] <= 0:
                    at -= 1
                at = at if at >= 0 else first
                blue, red = 0, 0
                for j in range(last + 1, m):
                    if valid[k, j]:
                        blue, red = max(blue, int(samples[k, j, 0])), max(red, int(samples[k, j, 2]))
                if blue > samples[k, at, 0] and red > samples[k, at, 2]:
                    for j in range(last + 1, m):
                        if valid[k, j]:
                            out[k, j], has_line[k] = LINE, True
                            free[k, 1 + j // 64] |= ONE << np.uint64(j % 64)


@compiled
def _mark_lines_across(
    samples: UInt8Array,
    llr: Int8Array,
    valid: UInt8Array,
    line_rows: Int32Array,
    is_ring: bool,
    free: UInt64Array,
    has_line: BoolArray,
    out: UInt8Array,
) -> None:
    """Mark bright stripes between floor across bearings that are not wider than a line.

    Where two lines meet, the samples between may border on line instead, but must still be whiter than the floor.
    """
    rows = len(free)
    visited = free.copy()
    k = 0
    # rows are visited once and a little further, so that a ring's lines across row 0 are closed, and the first rows are
    # compared with floor of later rows if there is none before them
    for step in range(1, rows + line_rows[0] + 1):
        begin = 0 if is_ring or step < rows else rows
        before, k = k, k + 1 if k + 1 < rows else 0
        for word in range(1, free.shape[1] - 1):
            ends = free[k, word] & ~free[before, word]
            while ends != NO_BITS:
                bit = lowest(ends)
                one, m = ONE << np.uint64(bit), 64 * (word - 1) + bit
                ends &= ends - ONE
                # rows are counted instead of using a remainder, which would take longer than the rest
                last, row = step - 1, before
                while last >= begin and out[row, m] == BLOCKED and step - last <= line_rows[m] + 1:
                    last, row = last - 1, row - 1 if row > 0 else rows - 1
                if last < begin or step - last > line_rows[m] + 1:
                    continue
                at, left = k, step
                while left >= 0 and llr[at, m] <= 0:
                    left, at = left - 1, at - 1 if at > 0 else rows - 1
                if left < 0:
                    at = 0
                    while visited[at, word] & one == NO_BITS:
                        at += 1
                blue, red, row = 0, 0, before
                for _ in range(last + 1, step):
                    if valid[row, m]:
                        blue = max(blue, int(samples[row, m, 0]))
                        red = max(red, int(samples[row, m, 2]))
                    row = row - 1 if row > 0 else rows - 1
                if blue > samples[at, m, 0] and red > samples[at, m, 2]:
                    row = before
                    for _ in range(last + 1, step):
                        if valid[row, m]:
                            out[row, m], has_line[row] = LINE, True
                            free[row, word] |= one
                        row = row - 1 if row > 0 else rows - 1


@compiled
def _ends_blocked(marks: UInt8Array, columns_in_use: int) -> bool:
    """Whether a line of a bearing has a blocked sample just behind it; without branches."""
    ends = False
    for m in range(columns_in_use - 1):
        ends |= (marks[m] == LINE) & (marks[m + 1] == BLOCKED)
    return ends


@compiled
def _block_corners(
    valid: UInt8Array, line_columns: Int32Array, columns_in_use: int, has_line: BoolArray, out: UInt8Array
) -> None:
    """Block lines that lead to something blocked.

    A bright corner that points at the robot starts narrower than a line. A right angle reaches a line's width over half
    that depth.
    """
    for k in range(out.shape[0]):
        if not has_line[k] or not _ends_blocked(out[k], columns_in_use):
            continue
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
    near_px: float,
    far_px: float,
    is_ring: bool,
    radius_px: FloatArray,
    marks: UInt8Array,
) -> None:
    """Mark the blocked samples of a ball and its shadow as BALL, within an ellipse in (row, image radius).

    Its half axes in image radius are `near_px` and `far_px`. In a ring the last row is adjacent to the first.
    """
    rows = marks.shape[0]
    for m in range(radius_px.shape[0]):
        off_px = radius_px[m] - center_radius
        along = off_px / (far_px if off_px > 0.0 else near_px)
        if abs(along) > 1.0:
            continue
        reach = half_rows * math.sqrt(1.0 - along * along)
        for step in range(int(math.ceil(center_row - reach)), int(math.floor(center_row + reach)) + 1):
            if (is_ring or 0 <= step < rows) and marks[step % rows, m] == BLOCKED:
                marks[step % rows, m] = BALL


@compiled
def _level(flat: UInt8Array, at: np.uint64) -> int:
    """Return the brightness of a colour, as the sum of three bytes."""
    return int(np.int64(flat[at]) + flat[at + ONE] + flat[at + TWO])
