"""Compiled learning of the floor's tone from the pixels nearest to the robot, before lines are looked for on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles

# ratios R/G and B/G are counted in bins of their logarithms
_BIN, _SPAN, _BINS = 0.08, 2.0, 50
# burnt out, and dark, channels tell no ratio
_BRIGHTEST, _DARKEST = 250, 3


class ToneRules(NamedTuple):
    """As the `LineSettings` of `line_points` say; see there."""

    min_samples: int
    common_tone_ratio: float
    tone_stds: float
    min_tone_spread: float
    dark_ratio: float
    bright_ratio: float
    slack: float


@compiled(error_model="numpy")
def learn_tone(frame: UInt8Array, near: Int64Array, rules: ToneRules, tone: Float32Array) -> bool:
    """Learn the floor's colour.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR, smoothed.
    near : (N,) int64
        Pixels v W + u that show the nearest floor.
    rules : ToneRules
        May be plain.
    tone : (7,) float32
        Result, as `floor_mask_by_tone` takes it.

    Returns
    -------
    bool
        False, and no result, where too few pixels are of one tone.
    """
    known = ToneRules(*rules)
    flat, count = frame.reshape(-1), 0
    # logarithms of R/G and B/G, and G
    seen = np.empty((3, near.shape[0]))
    for n in range(near.shape[0]):
        at = 3 * near[n]
        blue, green, red = flat[at], flat[at + 1], flat[at + 2]
        if max(blue, green, red) < _BRIGHTEST and min(blue, green, red) >= _DARKEST:
            seen[0, count], seen[1, count] = math.log(red / green), math.log(blue / green)
            seen[2, count] = green
            count += 1
    if count < known.min_samples:
        return False
    mode = np.empty(2)
    mode[0], mode[1] = _common_tone(seen[0, :count], seen[1, :count], known.common_tone_ratio)
    spread = np.full(2, _BIN)
    members, scratch, middle = np.empty(count), np.empty(count + 1), np.empty(1)
    half, chosen, is_member = np.full(1, 0.5), 0, np.empty(count, np.bool_)
    for _ in range(3):
        chosen = 0
        for n in range(count):
            is_member[n] = abs(seen[0, n] - mode[0]) < known.tone_stds * spread[0]
            is_member[n] &= abs(seen[1, n] - mode[1]) < known.tone_stds * spread[1]
            chosen += is_member[n]
        if chosen < known.min_samples:
            return False
        for i in range(2):
            _pick(seen[i, :count], is_member, members)
            quantiles(members[:chosen], half, scratch, middle)
            mode[i] = middle[0]
            for n in range(chosen):
                members[n] = abs(members[n] - mode[i])
            quantiles(members[:chosen], half, scratch, middle)
            spread[i] = max(1.48 * middle[0], known.min_tone_spread)
    _pick(seen[2, :count], is_member, members)
    quantiles(members[:chosen], half, scratch, middle)
    for i in range(2):
        reach = known.tone_stds * spread[i]
        tone[2 * i], tone[2 * i + 1] = math.exp(mode[i] - reach), math.exp(mode[i] + reach)
    tone[4], tone[5], tone[6] = known.dark_ratio * middle[0], known.bright_ratio * middle[0], known.slack
    return True


@compiled
def _pick(values: FloatArray, chosen: BoolArray, out: FloatArray) -> None:
    """Write the chosen ones of some values side by side."""
    count = 0
    for n in range(values.shape[0]):
        if chosen[n]:
            out[count] = values[n]
            count += 1


@compiled
def _common_tone(red: FloatArray, blue: FloatArray, common_ratio: float) -> tuple[float, float]:
    """Return the greenest of the tones that are nearly as common as the commonest: logarithms of R/G and B/G.

    A robot at the carpet's edge sees the hall's floor as near as the carpet: of tones that both cover much of the ring
    the carpet is the greener one, under any light.
    """
    # with a border of zeros, so that neighbours need no checks
    counts = np.zeros((_BINS + 2, _BINS + 2), np.int64)
    for n in range(red.shape[0]):
        if abs(red[n]) <= _SPAN and abs(blue[n]) <= _SPAN:
            row, column = int((red[n] + _SPAN) / _BIN), int((blue[n] + _SPAN) / _BIN)
            counts[min(row, _BINS - 1) + 1, min(column, _BINS - 1) + 1] += 1
    around, most = np.zeros((_BINS, _BINS), np.int64), 0
    for row in range(_BINS):
        for column in range(_BINS):
            for i in range(3):
                for j in range(3):
                    around[row, column] += counts[row + i, column + j]
            most = max(most, around[row, column])
    best, best_row, best_column = _BINS, 0, 0
    for row in range(_BINS):
        for column in range(_BINS):
            if around[row, column] >= common_ratio * most and max(row, column) < best:
                best, best_row, best_column = max(row, column), row, column
    return (best_row + 0.5) * _BIN - _SPAN, (best_column + 0.5) * _BIN - _SPAN
