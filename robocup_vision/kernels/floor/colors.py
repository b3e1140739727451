"""Compiled table of the floor's colour likelihoods, and measurement of the light on the floor."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, Int8Array, UInt8Array
from robocup_vision.compiling.loops import compiled

# parameters of a density at each brightness: R/G, B/G, inverse covariance (red, mixed, blue), logarithm of its peak,
# and for the floor the components of a direction towards purer colours, in standard deviations
RED, BLUE, RED_RED, RED_BLUE, BLUE_BLUE, PEAK, PURER_RED, PURER_BLUE = range(8)
# steps of brightness in one count
FINE = 8.0
# step in bearings of the measurement of light, which varies slowly between them
_ROW_STRIDE = 4
# quantile of the floor's brightness that measures its sunlit part
_SUNNY_RATIO = 0.9


@compiled(inline="always")
def _log_ratio(blue: float, green: float, red: float, floor: FloatArray, white: FloatArray, least: float) -> float:
    """Return the floor's log-likelihood ratio of a colour, nats; inexact if it is at most `least`."""
    s = min(int((red + 2 * green + blue) / 4 * FINE + 0.5), floor.shape[1] - 1)
    d_red, d_blue = red - floor[RED, s] * green, blue - floor[BLUE, s] * green
    purer = max(floor[PURER_RED, s] * d_red + floor[PURER_BLUE, s] * d_blue, 0.0)
    value = floor[PEAK, s] - 0.5 * (
        floor[RED_RED, s] * d_red * d_red
        + 2 * floor[RED_BLUE, s] * d_red * d_blue
        + floor[BLUE_BLUE, s] * d_blue * d_blue
        - purer * purer
    )
    # returns early for most colours, which are not floor
    if value <= least:
        return float(value)
    d_red, d_blue = red - white[RED, s] * green, blue - white[BLUE, s] * green
    rival = white[PEAK, s] - 0.5 * (
        white[RED_RED, s] * d_red * d_red
        + 2 * white[RED_BLUE, s] * d_red * d_blue
        + white[BLUE_BLUE, s] * d_blue * d_blue
    )
    return float(value - max(rival, 0.0))


@compiled
def log_ratios(colors: FloatArray, floor: FloatArray, white: FloatArray, out: FloatArray) -> None:
    """Write the floor's log-likelihood ratios (N,) of colours (3, N) in blue, green, red; see `tabulate`."""
    for n in range(out.shape[0]):
        out[n] = _log_ratio(colors[0, n], colors[1, n], colors[2, n], floor, white, -np.inf)


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
        Levels at the centres of the bins.
    floor, white : (8, S), (6, S) float64
        Parameters of the densities relative to that of any colour, at brightnesses of 1 / `FINE` counts.
    clip, unit : float
        Bound of the ratio, and one unit of the table, nats.
    out : (65536,) int8
        Filled, in the order blue, green, red.
    """
    at = 0
    for b in range(blue.shape[0]):
        for g in range(green.shape[0]):
            for r in range(red.shape[0]):
                value = _log_ratio(blue[b], green[g], red[r], floor, white, -clip)
                value = max(-clip, min(clip, value)) / unit
                out[at] = np.int8(int(value + 0.5) if value >= 0 else -int(0.5 - value))
                at += 1


@compiled
def light_on_floor(
    samples: UInt8Array,
    llr: Int8Array,
    sure: int,
    step_of_sum: UInt8Array,
    ratios: FloatArray,
) -> tuple[float, float, float, float]:
    """Measure brightness and hue of the samples that are certainly floor.

    Parameters
    ----------
    samples : (K, M, 3) uint8
    llr : (K, M) int8
        The floor's log-likelihood ratio, 0 where not valid.
    sure : int
        Least ratio of a sample that is used.
    step_of_sum : (1021,) uint8
        Brightness step of each R + 2 G + B.
    ratios : (2, L) float64
        Expected R/G and B/G of the floor at each step of brightness.

    Returns
    -------
    tuple
        Ratio of the samples that are certainly floor; brightness of the sunlit part, in steps, 0 at the middle of the
        first step; differences of log(R/G) and log(B/G) from those expected.
    """
    steps = ratios.shape[1]
    counts = np.zeros(steps, np.int64)
    number, red, blue, expected_red, expected_blue = 0, 0.0, 0.0, 0.0, 0.0
    rows, columns = llr.shape
    for k in range(0, rows, _ROW_STRIDE):
        for m in range(columns):
            if llr[k, m] >= sure:
                b, g, r = samples[k, m, 0], samples[k, m, 1], samples[k, m, 2]
                step = step_of_sum[np.intp(r) + 2 * np.intp(g) + np.intp(b)]
                counts[step] += 1
                number += 1
                red += r
                blue += b
                expected_red += ratios[0, step] * g
                expected_blue += ratios[1, step] * g
    if number == 0:
        return 0.0, 0.0, 0.0, 0.0
    wanted, darker, level = _SUNNY_RATIO * number, 0, steps - 0.5
    for step in range(steps):
        if darker + counts[step] > wanted:
            # the darkest step is open-ended, so nothing is interpolated in it
            level = step + ((wanted - darker) / counts[step] - 0.5 if step > 0 else 0.5)
            break
        darker += counts[step]
    red_cast = math.log(max(red, 1.0) / max(expected_red, 1.0))
    blue_cast = math.log(max(blue, 1.0) / max(expected_blue, 1.0))
    return number * _ROW_STRIDE / llr.size, level, red_cast, blue_cast
