"""Compiled loop that unrolls a frame into blurred polar samples.

It replaces three calls of OpenCV, each of which reads and writes all samples and releases Python's lock.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import Int32Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled

ONE, TWO, THREE, SIX = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(6)
# division by nine of sums up to 9 x 255 + 4 by an integer product and a shift, exact in this range
NINTH, BITS = np.uint32(7282), np.uint32(16)
HALF = np.uint16(4)


@compiled
def unroll(frame: UInt8Array, places: Int32Array, out: UInt8Array) -> None:
    """Sample pixels at given places, and average each sample with its neighbours.

    At the borders samples are mirrored, as in `cv2.blur`.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    places : (K, M) int32
        Index 3 (v W + u) of each sample; at least two rows and columns.
    out : (K, M, 3) uint8
        Filled with rounded averages over 3 x 3 samples.
    """
    pixels = frame.reshape(-1)
    rows, columns = places.shape
    width = 3 * columns
    line = np.empty(width + 6, np.uint8)
    # sums over three columns, with a mirrored row above and below
    sums = np.empty((rows + 2, width), np.uint16)
    for k in range(rows):
        for m in range(columns):
            at = np.uint64(places[k, m])
            line[3 * m + 3] = pixels[at]
            line[3 * m + 4] = pixels[at + ONE]
            line[3 * m + 5] = pixels[at + TWO]
        for c in range(3):
            line[c] = line[6 + c]
            line[width + 3 + c] = line[width - 3 + c]
        _add_columns(line, sums[k + 1])
    for i in range(width):
        sums[0, i], sums[rows + 1, i] = sums[2, i], sums[rows - 1, i]
    flat, count = sums.reshape(-1), rows * width
    _average(flat[:count], flat[width : width + count], flat[2 * width :], out.reshape(-1))


@compiled
def _add_columns(line: UInt8Array, out: UInt16Array) -> None:
    """Add each channel of three adjacent samples."""
    for i in range(np.uint64(out.shape[0])):
        out[i] = np.uint16(line[i]) + np.uint16(line[i + THREE]) + np.uint16(line[i + SIX])


@compiled
def _average(before: UInt16Array, here: UInt16Array, after: UInt16Array, out: UInt8Array) -> None:
    """Divide the sums of three rows by nine, rounded; all rows in one loop."""
    for i in range(np.uint64(out.shape[0])):
        total = np.uint16(before[i] + here[i] + after[i] + HALF)
        out[i] = np.uint8((np.uint32(total) * NINTH) >> BITS)
