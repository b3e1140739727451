"""Compiled choice of the carpet's tone among the common tones around a robot."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# width of the histogram bins of log(R/G) and log(B/G)
_BIN = 0.08
# least frequency of a tone that may be the carpet's, relative to the most frequent tone
_MIN_COMMON = 0.25


@compiled
def greenest_common_tone(log_red: FloatArray, log_blue: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Return the greenest of the tones that are nearly as frequent as the most frequent one: log(R/G) and log(B/G).

    At the carpet's edge the hall's floor may cover more of the view. The carpet is the greener one under any light.

    Parameters
    ----------
    log_red, log_blue, weight : (N,) float64
        Logarithms of R/G and B/G of the colours, and the area that each covers; N > 0.
    """
    # a tone is a bin with its eight neighbours; the histogram has a border of zeros
    row0, column0 = math.floor(log_red.min() / _BIN) - 1, math.floor(log_blue.min() / _BIN) - 1
    rows, columns = math.floor(log_red.max() / _BIN) - row0 + 2, math.floor(log_blue.max() / _BIN) - column0 + 2
    covered, around = np.zeros((rows + 2, columns + 2)), np.zeros((rows, columns))
    for n in range(len(weight)):
        covered[math.floor(log_red[n] / _BIN) - row0 + 1, math.floor(log_blue[n] / _BIN) - column0 + 1] += weight[n]
    for row in range(rows):
        for column in range(columns):
            for i in range(3):
                for j in range(3):
                    around[row, column] += covered[row + i, column + j]
    least, best_row, best_column = _MIN_COMMON * around.max(), row0 + rows, column0 + columns
    for row in range(row0, row0 + rows):
        for column in range(column0, column0 + columns):
            is_greener = max(row, column) < max(best_row, best_column)
            if is_greener and around[row - row0, column - column0] >= least:
                best_row, best_column = row, column
    return (best_row + 0.5) * _BIN, (best_column + 0.5) * _BIN
