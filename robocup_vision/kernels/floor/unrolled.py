"""Compiled loop that unrolls a frame into blurred polar samples.

OpenCV would take three calls, each of which writes and reads all samples, and hands Python's lock on and back.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled

ONE, TWO = np.uint64(1), np.uint64(2)
# a ninth of up to 9 x 255 + 4 in whole numbers: the error of the factor stays below half of the next step
NINTH, BITS = np.uint32(7282), np.uint32(16)
HALF = np.uint32(4)


@compiled
def unroll(frame: UInt8Array, places: Int32Array, out: UInt8Array) -> None:
    """Take the pixels at given places, and average each with its neighbours.

    Beyond the first and last row and column lies what mirrors the row and column beside them, as in `cv2.blur`.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    places : (K, M) int32
        Each sample's index, 3 (v W + u), at least two rows and columns.
    out : (K, M, 3) uint8
        Filled with the rounded averages over 3 x 3 samples.
    """
    pixels = frame.reshape(-1)
    rows, columns = places.shape
    width = 3 * columns
    averages = out.reshape(rows, width)
    line = np.empty(width + 6, np.uint16)
    # of three neighbouring rows, the sums over neighbouring columns
    sums = np.empty((3, width), np.uint16)
    for step in range(rows + 1):
        if step < rows:
            for m in range(columns):
                at = np.uint64(places[step, m])
                line[3 * m + 3] = pixels[at]
                line[3 * m + 4] = pixels[at + ONE]
                line[3 * m + 5] = pixels[at + TWO]
            for c in range(3):
                line[c] = line[6 + c]
                line[width + 3 + c] = line[width - 3 + c]
            row = sums[step % 3]
            for i in range(width):
                row[i] = line[i] + line[i + 3] + line[i + 6]
        if step > 0:
            k = step - 1
            before = sums[(k - 1) % 3 if k > 0 else 1]
            here = sums[k % 3]
            after = sums[(k + 1) % 3 if step < rows else (k - 1) % 3]
            average = averages[k]
            for i in range(width):
                total = np.uint32(before[i]) + np.uint32(here[i]) + np.uint32(after[i]) + HALF
                average[i] = np.uint8((total * NINTH) >> BITS)
