"""Compiled estimate of the floor's tone from the pixels nearest to the robot, for the search for lines."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles
from robocup_vision.kernels.floor.common_tone import greenest_common_tone

# logarithms of R/G and B/G are clipped at minus this
_SPAN = 2.0
# standard deviation of a tone's logarithms before it has been measured
_FIRST_SPREAD = 0.08
# levels from which a channel is clipped, and below which its ratio is unreliable
_BRIGHTEST, _DARKEST = 250, 3
# green of a vivid green, in which dark red or blue is allowed because its logarithm is clipped anyway
_VIVID = _DARKEST * math.exp(_SPAN)


class ToneRules(NamedTuple):
    """Bounds of a floor's tone.

    Parameters
    ----------
    min_samples : int
        Least number of pixels of a tone.
    stds : float
        Largest deviation of a floor colour from the floor's tone, in robust standard deviations.
    min_spread : float
        Least standard deviation of a tone's logarithm, due to quantisation of a dark floor.
    dark_ratio, bright_ratio : float
        Green of the darkest and brightest floor, in deep shadow and in a spot of light, divided by the median green of
        the nearest floor.
    slack : float
        Sensor noise, in grey levels, by which a channel may leave the tone's ratios.
    """

    min_samples: int = 50
    stds: float = 4.0
    min_spread: float = 0.04
    dark_ratio: float = 0.35
    bright_ratio: float = 1.9
    slack: float = 2.0


@compiled(error_model="numpy")
def learn_tone(frame: UInt8Array, near: Int64Array, rules: ToneRules, tone: Float32Array) -> bool:
    """Estimate the floor's tone.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR, smoothed.
    near : (N,) int64
        Pixels v W + u that show the nearest floor.
    rules : ToneRules
        May be plain.
    tone : (7,) float32
        Filled, as in `floor_mask_by_tone`.

    Returns
    -------
    bool
        False, and `tone` is not written, if too few pixels have one tone.
    """
    known = ToneRules(*rules)
    flat, count = frame.reshape(-1), 0
    # rows: logarithms of R/G and B/G, then G, R and B
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
    mode[0], mode[1] = greenest_common_tone(seen[0, :count], seen[1, :count], np.ones(count))
    spread = np.full(2, _FIRST_SPREAD)
    members, scratch, usual = np.empty(count), np.empty(count + 1), np.empty(1)
    half, chosen, is_member = np.full(1, 0.5), 0, np.empty(count, np.bool_)
    for _ in range(3):
        chosen = 0
        for n in range(count):
            is_member[n] = abs(seen[0, n] - mode[0]) < known.stds * spread[0]
            is_member[n] &= abs(seen[1, n] - mode[1]) < known.stds * spread[1]
            chosen += is_member[n]
        if chosen < known.min_samples:
            return False
        _pick(seen[2, :count], is_member, members)
        quantiles(members[:chosen], half, scratch, usual)
        for i in range(2):
            _pick(seen[i, :count], is_member, members)
            mode[i], around = _middle_and_spread(members[:chosen], scratch)
            spread[i] = max(around, known.min_spread)
            if mode[i] - known.stds * spread[i] > -_SPAN:
                continue
            # the spread of a channel whose ratio is clipped is measured in levels
            ratio = math.exp(mode[i])
            _pick_off(seen[3 + i, :count], seen[2, :count], ratio, is_member, members)
            _, around = _middle_and_spread(members[:chosen], scratch)
            spread[i] = max(spread[i], around / (ratio * usual[0]))
    for i in range(2):
        least, most = mode[i] - known.stds * spread[i], mode[i] + known.stds * spread[i]
        # the bound towards grey is half-way, unless the tone's own spread reaches farther
        most = min(most, max(0.5 * mode[i], mode[i] + 2.0 * spread[i]))
        tone[2 * i], tone[2 * i + 1] = math.exp(least) if least > -_SPAN else 0.0, math.exp(most)
    tone[4], tone[5], tone[6] = known.dark_ratio * usual[0], known.bright_ratio * usual[0], known.slack
    return True


@compiled(inline="always")
def _log_ratio(channel: int, green: int) -> float:
    """Return the logarithm of a channel's ratio to green, clipped at -`_SPAN`."""
    return max(math.log(max(channel, 1) / green), -_SPAN)


@compiled
def _middle_and_spread(values: FloatArray, scratch: FloatArray) -> tuple[float, float]:
    """Return the median of values and their robust standard deviation; overwrites the values."""
    half, median = np.full(1, 0.5), np.empty(1)
    quantiles(values, half, scratch, median)
    middle = median[0]
    for n in range(values.shape[0]):
        values[n] = abs(values[n] - middle)
    quantiles(values, half, scratch, median)
    return middle, 1.48 * median[0]


@compiled
def _pick(values: FloatArray, chosen: BoolArray, out: FloatArray) -> None:
    """Write the chosen values consecutively."""
    count = 0
    for n in range(values.shape[0]):
        if chosen[n]:
            out[count] = values[n]
            count += 1


@compiled
def _pick_off(channel: FloatArray, green: FloatArray, ratio: float, chosen: BoolArray, out: FloatArray) -> None:
    """Write the differences of the chosen values of a channel from a ratio of green, consecutively."""
    count = 0
    for n in range(channel.shape[0]):
        if chosen[n]:
            out[count] = channel[n] - ratio * green[n]
            count += 1
