"""Compiled loops that find the feet and sides of dark objects in blurred floor samples.

A mixture of floor and black has the floor's hue, so that by colour the floor seems to extend too far under black
objects. The foot is where brightness is half-way between the floor in front and the object behind.

The loops take `samples` (K, M, 3) uint8, their colours; `valid` (K, M) uint8, non-zero for samples that may be used;
`marks` (K, M) uint8 of `free_floor`, which they change; and the number of columns below the horizon.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.bits import NO_BITS
from robocup_vision.kernels.floor.free_floor import BLOCKED, FLOOR, LINE

# columns over which averaging, lens and motion blur an edge
SPREAD = 4
# less than this ratio of the brightest floor within FADE columns in front is shadow or a black body; the columns are
# several because the shadow of a body deepens towards its foot
DARK_RATIO, FADE = 0.4, 12


@compiled(inline="always")
def _brightness(samples: UInt8Array, k: int, m: int) -> int:
    return int(samples[k, m, 0]) + int(samples[k, m, 1]) + int(samples[k, m, 2])


@compiled
def _half_way(samples: UInt8Array, valid: UInt8Array, k: int, last: int) -> float:
    """Return the brightness half-way between floor up to column `last` and what is behind; 0 without an edge."""
    columns = samples.shape[1]
    if last + 2 >= columns or not valid[k, last + 1] or not valid[k, last + 2]:
        return 0.0
    behind = min(_brightness(samples, k, last + 1), _brightness(samples, k, last + 2))
    floor = 0
    for m in range(max(last - SPREAD, 0), last + 1):
        floor = max(floor, _brightness(samples, k, m))
    return 0.5 * (floor + behind) if behind < floor else 0.0


@compiled
def block_dark_feet(samples: UInt8Array, valid: UInt8Array, columns_in_use: int, marks: UInt8Array) -> None:
    """Block the floor samples in front of blocked ones that show less than half floor."""
    columns, words = marks.shape[1], (columns_in_use + 7) // 8
    begins = np.zeros(8 * words, np.bool_)
    eights = begins.view(np.uint64)
    for k in range(len(marks)):
        row = marks[k]
        # a whole row without branches; blocking below changes only samples in front of later feet
        for m in range(1, columns_in_use):
            begins[m] = (row[m] == BLOCKED) & (row[m - 1] == FLOOR)
        for word in range(words):
            if eights[word] == NO_BITS:
                continue
            # not a function, because the call would take longer than its work
            for m in range(8 * word, 8 * word + 8):
                if not begins[m] or m + 1 >= columns or not valid[k, m] or not valid[k, m + 1]:
                    continue
                behind = min(_brightness(samples, k, m), _brightness(samples, k, m + 1))
                first, floor = max(m - 1 - SPREAD, 0), 0
                for j in range(first, m):
                    floor = max(floor, _brightness(samples, k, j))
                at = m - 1 if behind < floor else first
                while at > first and row[at] == FLOOR and 2 * _brightness(samples, k, at) < floor + behind:
                    row[at] = BLOCKED
                    at -= 1


@compiled
def block_dark_bodies(samples: UInt8Array, valid: UInt8Array, columns_in_use: int, marks: UInt8Array) -> None:
    """Block dark stretches of the floor's hue, and lines in them, that lead to something blocked.

    A black body on a green carpet reflects it and looks like floor in a deep shadow. But a shadow ends at lit floor,
    whereas a body's foot is followed by the rest of it or the horizon.
    """
    for k in range(len(marks)):
        row = marks[k]
        m, brightest = 0, 0
        while m < columns_in_use:
            if row[m] != FLOOR or not valid[k, m]:
                m += 1
                continue
            lit, first, here = 0, m, _brightness(samples, k, m)
            # returns early for most samples
            if here >= DARK_RATIO * brightest:
                brightest = max(brightest, here)
                m += 1
                continue
            for j in range(max(m - FADE, 0), m):
                if row[j] == FLOOR and valid[k, j]:
                    lit = max(lit, _brightness(samples, k, j))
            if here >= DARK_RATIO * lit:
                m += 1
                continue
            while row[first - 1] == FLOOR and 2 * _brightness(samples, k, first - 1) < lit:
                first -= 1
            end = m
            while end < columns_in_use and valid[k, end]:
                if row[end] == FLOOR and 2 * _brightness(samples, k, end) >= lit:
                    break
                if row[end] == BLOCKED and (end + 1 >= columns_in_use or row[end + 1] == BLOCKED):
                    break
                end += 1
            if end >= columns_in_use or row[end] == BLOCKED:
                for j in range(first, end):
                    if row[j] == FLOOR or row[j] == LINE:
                        row[j] = BLOCKED
            m = max(end, m + 1)


@compiled
def foot_px(
    samples: UInt8Array, valid: UInt8Array, columns: Int64Array, radius_px: FloatArray, step_px: float, out: FloatArray
) -> None:
    """Find the end of the floor on each bearing between samples.

    Parameters
    ----------
    columns : (K,) int64
        Outermost sample of floor by colour; -1 if there is none.
    radius_px, step_px : (M,) float64, float
        Image radius of the columns, and the distance between them.
    out : (K,) float64
        Filled with the foot's image radius: half a step behind the sample, or nearer if a dark object follows.
    """
    for k in range(len(columns)):
        last = columns[k]
        if last < 0:
            out[k] = float("nan")
            continue
        out[k] = radius_px[last] + 0.5 * step_px
        half = _half_way(samples, valid, k, last)
        for at in range(last, max(last - SPREAD, 0), -1):
            inner = _brightness(samples, k, at)
            if inner >= half:
                break
            nearer = _brightness(samples, k, at - 1)
            if nearer >= half:
                part = (nearer - half) / (nearer - inner)
                out[k] = radius_px[at - 1] + part * (radius_px[at] - radius_px[at - 1])
                break


@compiled
def doubt_beyond(columns: Int64Array, certain: int, llr: Int8Array) -> None:
    """Set uncertain ratios beyond the outermost floor (K,) of each bearing to zero; -1 if there is no floor."""
    for k in range(len(llr)):
        if columns[k] >= 0:
            row = llr[k, columns[k] + 1 :]
            # always written, so that the loop vectorises
            for m in range(len(row)):
                row[m] = row[m] if (row[m] <= 0) | (row[m] >= certain) else 0
