"""Compiled statistics of the carpet's colour, and classification of pixels, for the search for patterned balls."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles

# classes of pixels
CARPET, NEUTRAL, COLORED = 0, 1, 2
# the blue weighs less than the red, because a white ball in warm light is yellow
_BLUE_WEIGHT = 3 / 20
# noise of a pixel, added to its level before the logarithm is taken
_NOISE_COUNTS = 8.0
_LOGS = np.log(np.arange(256) + _NOISE_COUNTS)
# added to the sum of the channels, because the hue of a dark pixel is noise
_DARK_COUNTS = 30.0
# greatest hue and least greenness, see `classify`, of a pixel that is measured as carpet
_MAX_HUE, _MIN_GREEN = -0.12, 0.1
# logarithms of red and blue relative to green, beyond which a pixel is coloured
_MAX_RED, _MAX_BLUE = 0.6, 0.4
# sampling step in pixels, and samples in a row of a wide frame: a few thousand samples suffice for quartiles
STRIDE, PER_ROW = 4, 80
# reach of the pixels that are used, in radii from a ball's middle
BEYOND = 4.0


@compiled(error_model="numpy")
def measure_carpet(
    blurred: UInt8Array, first: int, scratch: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Return the ratio of carpet in a frame's lower part, quartiles of its hue, and medians of greenness and green.

    Parameters
    ----------
    blurred : (H, W, 3) uint8
        Blue, green and red.
    first : int
        First row of the lower part.
    scratch : (4, N) float64
        Room for one more than the number of sampled pixels.
    """
    height, width, _ = blurred.shape
    hues, greens, levels = scratch[0], scratch[1], scratch[2]
    count, number, stride = 0, 0, max(STRIDE, width // PER_ROW)
    for v in range(first, height, stride):
        for u in range(0, width, stride):
            number += 1
            b, g, r = blurred[v, u, 0], blurred[v, u, 1], blurred[v, u, 2]
            total = float(b) + float(g) + float(r)
            green = (3.0 * float(g) - total) / (total + _DARK_COUNTS)
            if not green > _MIN_GREEN:
                continue
            hue = _LOGS[r] - _LOGS[g] + _BLUE_WEIGHT * (_LOGS[b] - _LOGS[g])
            if hue < _MAX_HUE:
                hues[count], greens[count], levels[count] = hue, green, float(g)
                count += 1
    if count == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    statistics = np.empty(5)
    quantiles(hues[:count], np.array((0.25, 0.5, 0.75)), scratch[3], statistics[:3])
    quantiles(greens[:count], np.array((0.5,)), scratch[3], statistics[3:4])
    quantiles(levels[:count], np.array((0.5,)), scratch[3], statistics[4:])
    return count / number, statistics[0], statistics[1], statistics[2], statistics[3], statistics[4]


@compiled(error_model="numpy")
def classify(
    blurred: UInt8Array, first: int, hue: float, green: float, level: float, levels: UInt8Array, kinds: UInt8Array
) -> None:
    """Classify each pixel from a row on.

    The loop has neither branches nor tables, so that it vectorises.

    Parameters
    ----------
    blurred : (H, W, 3) uint8
        Blue, green and red.
    first : int
        The row. Pixels above it are `COLORED`.
    hue : float
        Carpet has less: log(red / green) + `_BLUE_WEIGHT` log(blue / green), with `_NOISE_COUNTS` added to each level.
    green : float
        Carpet has more: (2 green - red - blue) / (red + green + blue + `_DARK_COUNTS`).
    level : float
        Carpet has at least this green. Black patches that reflect the carpet are as green, but darker.
    levels : (H, W) uint8
        Filled with the green channel, from that row on.
    kinds : (H, W) uint8
        Filled with `CARPET`, `NEUTRAL` or `COLORED`.
    """
    height, width, _ = blurred.shape
    # the hue's exponential to the 20th power, because powers are faster than logarithms
    most, least, dark = np.float32(math.exp(20.0 * hue)), np.float32(green), np.float32(level)
    max_red, max_blue = np.float32(math.exp(_MAX_RED)), np.float32(math.exp(_MAX_BLUE))
    noise, counts, three = np.float32(_NOISE_COUNTS), np.float32(_DARK_COUNTS), np.float32(3.0)
    blues, reds = np.empty((2, width), np.uint8)
    for v in range(first):
        for u in range(width):
            kinds[v, u] = COLORED
    for v in range(first, height):
        # one array for each channel of a row, so that the next loop vectorises
        row, greens = blurred[v].reshape(-1), levels[v]
        for u in range(width):
            blues[u], greens[u], reds[u] = row[3 * u], row[3 * u + 1], row[3 * u + 2]
        for u in range(width):
            b, g, r = np.float32(blues[u]), np.float32(greens[u]), np.float32(reds[u])
            total, by_green = b + g + r, np.float32(1.0) / (g + noise)
            red, blue = (r + noise) * by_green, (b + noise) * by_green
            squared = red * red
            fifth = squared * squared * red
            tenth = fifth * fifth
            # carpet differs from black patches, which are nearly grey, and from white in warm light, as red as green
            is_carpet = (
                (g >= dark)
                & (three * g - total > least * (total + counts))
                & (tenth * tenth * (blue * blue * blue) < most)
            )
            other = np.uint8(COLORED) if (red > max_red) | (blue > max_blue) else np.uint8(NEUTRAL)
            kinds[v, u] = np.uint8(CARPET) if is_carpet else other
