"""Compiled loops over the colours of the floor: its likelihood table, and what a frame says of the light on it."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, UInt8Array
from robocup_vision.compiling.loops import compiled

# rows of a density's numbers by brightness: R/G, B/G, inverse covariance (red, mixed, blue), logarithm of its peak
RED, BLUE, RED_RED, RED_BLUE, BLUE_BLUE, PEAK = range(6)
# steps of brightness a count
FINE = 8.0


@compiled
def tabulate(
    blue: FloatArray,
    green: FloatArray,
    red: FloatArray,
    floor: FloatArray,
    white: FloatArray,
    clip: float,
    unit: float,
    out: Int8Array,
) -> None:
    """Tabulate the floor's log-likelihood ratio over packed colours.

    Parameters
    ----------
    blue, green, red : (32,), (64,), (32,) float64
        Counts that the bins stand for.
    floor, white : (6, S) float64
        Numbers of their densities relative to any colour's, at brightnesses of 1 / `FINE` counts.
    clip, unit : float
        Nats beyond which the ratio is cut, and those of one unit of the table.
    out : (65536,) int8
        Filled: blue bins first, then green, then red.
    """
    last = floor.shape[1] - 1
    at = 0
    for b in range(blue.shape[0]):
        for g in range(green.shape[0]):
            for r in range(red.shape[0]):
                s = min(int((red[r] + 2 * green[g] + blue[b]) / 4 * FINE + 0.5), last)
                d_red, d_blue = red[r] - floor[RED, s] * green[g], blue[b] - floor[BLUE, s] * green[g]
                value = floor[PEAK, s] - 0.5 * (
                    floor[RED_RED, s] * d_red * d_red
                    + 2 * floor[RED_BLUE, s] * d_red * d_blue
                    + floor[BLUE_BLUE, s] * d_blue * d_blue
                )
                if value > -clip:
                    d_red, d_blue = red[r] - white[RED, s] * green[g], blue[b] - white[BLUE, s] * green[g]
                    rival = white[PEAK, s] - 0.5 * (
                        white[RED_RED, s] * d_red * d_red
                        + 2 * white[RED_BLUE, s] * d_red * d_blue
                        + white[BLUE_BLUE, s] * d_blue * d_blue
                    )
                    value -= max(rival, 0.0)
                value = max(-clip, min(clip, value)) / unit
                out[at] = np.int8(int(value + 0.5) if value >= 0 else -int(0.5 - value))
                at += 1


@compiled
def light_on_floor(
    samples: UInt8Array, llr: Int8Array, sure: int, row_stride: int, step_of_sum: UInt8Array, out: FloatArray
) -> None:
    """Add up what is surely floor by its brightness.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    llr : (K, M) int8
        The floor's log-likelihood ratio, 0 where not valid.
    sure : int
        Least ratio.
    row_stride : int
        Every so many rows are looked at.
    step_of_sum : (1021,) uint8
        Brightness step of each R + 2 G + B.
    out : (L, 4) float64
        Filled: number of samples in each step, sums of their B, G and R.
    """
    out[:] = 0.0
    rows, columns = llr.shape
    for k in range(0, rows, row_stride):
        for m in range(columns):
            if llr[k, m] >= sure:
                blue, green, red = samples[k, m, 0], samples[k, m, 1], samples[k, m, 2]
                step = step_of_sum[np.intp(red) + 2 * np.intp(green) + np.intp(blue)]
                out[step, 0] += 1.0
                out[step, 1] += blue
                out[step, 2] += green
                out[step, 3] += red
