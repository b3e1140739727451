"""Compiled classification of a frame's polar samples, and search for the outermost floor."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import (
    BoolArray,
    Int8Array,
    Int16Array,
    Int64Array,
    UInt8Array,
    UInt16Array,
)
from robocup_vision.compiling.loops import compiled

# columns of the ring around the robot, which most probably shows floor
RING_COLUMNS = 10
B1, B2 = np.uint64(1), np.uint64(2)


@compiled
def classify(
    samples: UInt8Array,
    packing: UInt16Array,
    floor_llr: Int8Array,
    valid: UInt8Array,
    out: Int8Array,
) -> float:
    """Look up samples in a colour table.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    packing, floor_llr
        The colour table.
    valid : (K, M) uint8
    out : (K, M) int8
        Filled with the floor's log-likelihood ratios; 0 where not valid.

    Returns
    -------
    float
        Mean ratio over the ring around the robot.
    """
    rows, columns = valid.shape
    ring, count = 0, 0
    for k in range(rows):
        for m in range(columns):
            index = packing[0, samples[k, m, 0]] + packing[1, samples[k, m, 1]] + packing[2, samples[k, m, 2]]
            out[k, m] = floor_llr[index]
        # a loop of its own, because the look-ups wait for memory
        for m in range(columns):
            out[k, m] = out[k, m] if valid[k, m] else np.int8(0)
        for m in range(RING_COLUMNS):
            ring += out[k, m]
            count += valid[k, m]
    return ring / max(count, 1)


@compiled
def outer_boundary(llr: Int8Array, valid: UInt8Array, certain: int, gap: int, min_strip: int, out: Int64Array) -> None:
    """Find the outermost floor sample of each bearing.

    Floor begins at five samples in a row whose mean reaches `certain`, or at three in a row on each of three
    neighbouring bearings, because a far strip of floor is thin but long. From there it continues over gaps of at most
    `gap` samples, such as painted lines, to two samples whose sum reaches `min_strip`.

    Fills `out` (K,) with columns; -1: no floor, or the samples behind it are not valid.
    """
    rows, columns = llr.shape
    # with the last row above the first, and the first below the last
    three, five = np.empty((rows + 2, columns), np.int16), np.empty((rows, columns), np.int16)
    begins = np.empty((rows, columns), np.bool_)
    _add_runs(llr.reshape(-1), three[1:-1].reshape(-1), five.reshape(-1))
    for m in range(columns):
        three[0, m], three[rows + 1, m] = three[rows, m], three[1, m]
    for k in range(rows):
        # the sums of the first two columns contain samples of the row above
        five[k, 0], five[k, 1] = -(2**15), -(2**15)
    flat, count = three.reshape(-1), rows * columns
    before, here, after = flat[:count], flat[columns : columns + count], flat[2 * columns :]
    _find_runs(before, here, after, five.reshape(-1), certain, begins.reshape(-1))
    for k in range(rows):
        out[k] = -1
        m = columns - 3
        while m >= 0 and not begins[k, m]:
            m -= 1
        if m < 0:
            continue
        edge = m + 2
        while edge > m and llr[k, edge] <= 0:
            edge -= 1
        ahead = edge + 1
        while ahead + 1 < columns and ahead <= edge + gap + 1:
            if llr[k, ahead] > 0 and llr[k, ahead] + llr[k, ahead + 1] >= min_strip:
                edge = ahead + 1 if llr[k, ahead + 1] > 0 else ahead
                ahead = edge
            ahead += 1
        if edge + 2 < columns and valid[k, edge + 1] and valid[k, edge + 2]:
            out[k] = edge


@compiled
def _add_runs(llr: Int8Array, three: Int16Array, five: Int16Array) -> None:
    """Write sums of three consecutive samples from each on, and of five around the first; all rows in one loop."""
    last = llr.shape[0] - 2
    three[:2], three[last:], five[:2], five[last:] = 0, 0, 0, 0
    for i in range(np.uint64(last)):
        three[i] = np.int16(llr[i]) + np.int16(llr[i + B1]) + np.int16(llr[i + B2])
    for i in range(np.uint64(2), np.uint64(last)):
        five[i] = three[i] + llr[i - B1] + llr[i - B2]


@compiled
def _find_runs(
    before: Int16Array, here: Int16Array, after: Int16Array, five: Int16Array, certain: int, out: BoolArray
) -> None:
    """Write where floor begins: by the sums of three samples there and on both neighbouring bearings, and of five."""
    least, least_around, least_five = np.int16(2 * certain), np.int16(9 * certain), np.int16(5 * certain)
    for i in range(np.uint64(out.shape[0])):
        around = np.int16(before[i] + here[i] + after[i])
        out[i] = (here[i] >= least) & ((around >= least_around) | (five[i] >= least_five))
