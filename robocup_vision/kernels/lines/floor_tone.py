"""Compiled learning of the floor's tone from the pixels nearest to the robot, before lines are looked for on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles

# ratios R/G and B/G are counted in bins of their logarithms; one that is smaller counts as the smallest
_BIN, _SPAN, _BINS = 0.08, 2.0, 50
# burnt out, and dark, channels tell no ratio
_BRIGHTEST, _DARKEST = 250, 3
# but that it is smaller than any that is counted, in a vivid green: one so bright, and twice as bright as the others
_VIVID = _DARKEST * math.exp(_SPAN)


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
    # logarithms of R/G and B/G, G, R and B
    seen = np.empty((5, near.shape[0]))
    for n in range(near.shape[0]):
        at = 3 * near[n]
        blue, green, red = flat[at], flat[at + 1], flat[at + 2]
        is_vivid = green >= _VIVID and 2 * max(np.int64(blue), np.int64(red)) < green
        if max(blue, green, red) < _BRIGHTEST and (min(blue, green, red) >= _DARKEST or is_vivid):
            seen[0, count], seen[1, count] = _log_ratio(red, green), _log_ratio(blue, green)
            seen[2, count], seen[3, count], seen[4, count] = green, red, blue
            count += 1
    if count < known.min_samples:
        return False
    mode = np.empty(2)
    mode[0], mode[1] = _common_tone(seen[0, :count], seen[1, :count], known.common_tone_ratio)
    spread = np.full(2, _BIN)
    members, scratch, usual = np.empty(count), np.empty(count + 1), np.empty(1)
    half, chosen, is_member = np.full(1, 0.5), 0, np.empty(count, np.bool_)
    for _ in range(3):
        chosen = 0
        for n in range(count):
            is_member[n] = abs(seen[0, n] - mode[0]) < known.tone_stds * spread[0]
            is_member[n] &= abs(seen[1, n] - mode[1]) < known.tone_stds * spread[1]
            chosen += is_member[n]
        if chosen < known.min_samples:
            return False
        _pick(seen[2, :count], is_member, members)
        quantiles(members[:chosen], half, scratch, usual)
        for i in range(2):
            _pick(seen[i, :count], is_member, members)
            mode[i], around = _middle_and_spread(members[:chosen], scratch)
            spread[i] = max(around, known.min_tone_spread)
            if mode[i] - known.tone_stds * spread[i] > -_SPAN:
                continue
            # a channel so dark that its ratio is cut off varies by counts
            ratio = math.exp(mode[i])
            _pick_off(seen[3 + i, :count], seen[2, :count], ratio, is_member, members)
            _, around = _middle_and_spread(members[:chosen], scratch)
            spread[i] = max(spread[i], around / (ratio * usual[0]))
    for i in range(2):
        least, most = mode[i] - known.tone_stds * spread[i], mode[i] + known.tone_stds * spread[i]
        # grey is no carpet whose own tone is clear of it
        most = min(most, max(0.5 * mode[i], mode[i] + 2.0 * spread[i]))
        tone[2 * i], tone[2 * i + 1] = math.exp(least) if least > -_SPAN else 0.0, math.exp(most)
    tone[4], tone[5], tone[6] = known.dark_ratio * usual[0], known.bright_ratio * usual[0], known.slack
    return True


@compiled(inline="always")
def _log_ratio(channel: int, green: int) -> float:
    """Return the logarithm of a channel's ratio to green, no less than the least that is counted."""
    return max(math.log(max(channel, 1) / green), -_SPAN)


@compiled
def _middle_and_spread(values: FloatArray, scratch: FloatArray) -> tuple[float, float]:
    """Return the median of some values and their robust standard deviation; they are overwritten."""
    half, median = np.full(1, 0.5), np.empty(1)
    quantiles(values, half, scratch, median)
    middle = median[0]
    for n in range(values.shape[0]):
        values[n] = abs(values[n] - middle)
    quantiles(values, half, scratch, median)
    return middle, 1.48 * median[0]


@compiled
def _pick(values: FloatArray, chosen: BoolArray, out: FloatArray) -> None:
    """Write the chosen ones of some values side by side."""
    count = 0
    for n in range(values.shape[0]):
        if chosen[n]:
            out[count] = values[n]
            count += 1


@compiled
def _pick_off(channel: FloatArray, green: FloatArray, ratio: float, chosen: BoolArray, out: FloatArray) -> None:
    """Write how far the chosen values of a channel are off a ratio of green, side by side."""
    count = 0
    for n in range(channel.shape[0]):
        if chosen[n]:
            out[count] = channel[n] - ratio * green[n]
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
