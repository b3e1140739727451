"""Compiled measures that the search for patterned balls begins with: the frame's carpet, and what may be ball."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles

# what a pixel may be of
CARPET, NEUTRAL, COLORED = 0, 1, 2
# weight of the blue: it says less than the red, for a white ball on carpet in warm light is yellow
BLUE_WEIGHT = 3 / 20
# a pixel's noise, added to its level before the logarithm is taken
NOISE_COUNTS = 8.0
# added to the sum of the channels: the darker a pixel, the less its hue says
DARK_COUNTS = 30.0
# logarithms beyond which a pixel is coloured: red beside green, blue beside green
_MAX_RED, _MAX_BLUE = 0.6, 0.4
# pixels from one that is looked at to the next, along rows and columns: at least so many, and so many in a wide row,
# for a few thousand tell quartiles to a hundredth of what carpet varies
STRIDE, PER_ROW = 4, 80
# radii from a ball's middle, within which pixels are looked at
BEYOND = 4.0


@compiled(error_model="numpy")
def measure_carpet(
    blurred: UInt8Array, first: int, logs: FloatArray, max_hue: float, min_green: float, scratch: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Return how much of a frame's lower part is carpet, quartiles of its hue, median greenness and green.

    Parameters
    ----------
    blurred : (H, W, 3) uint8
        Blue, green and red.
    first : int
        Row that the lower part begins with.
    logs : (256,) float64
        Logarithm of each level, with the noise of a dark pixel added to it.
    max_hue, min_green : float
        Below this hue and above this greenness a pixel may be carpet: see `classify`.
    scratch : (4, N) float64
        Room for as many pixels as are looked at, and one more.
    """
    height, width, _ = blurred.shape
    hues, greens, levels = scratch[0], scratch[1], scratch[2]
    count, number, stride = 0, 0, max(STRIDE, width // PER_ROW)
    for v in range(first, height, stride):
        for u in range(0, width, stride):
            number += 1
            b, g, r = blurred[v, u, 0], blurred[v, u, 1], blurred[v, u, 2]
            total = float(b) + float(g) + float(r)
            green = (3.0 * float(g) - total) / (total + DARK_COUNTS)
            if not green > min_green:
                continue
            hue = logs[r] - logs[g] + BLUE_WEIGHT * (logs[b] - logs[g])
            if hue < max_hue:
                hues[count], greens[count], levels[count] = hue, green, float(g)
                count += 1
    if count == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    told = np.empty(5)
    quantiles(hues[:count], np.array((0.25, 0.5, 0.75)), scratch[3], told[:3])
    quantiles(greens[:count], np.array((0.5,)), scratch[3], told[3:4])
    quantiles(levels[:count], np.array((0.5,)), scratch[3], told[4:])
    return count / number, told[0], told[1], told[2], told[3], told[4]


@compiled(error_model="numpy")
def classify(
    blurred: UInt8Array, first: int, hue: float, green: float, level: float, levels: UInt8Array, kinds: UInt8Array
) -> None:
    """Say of each pixel whether it may be carpet or ball, from a row on.

    Nothing in the loop branches or is looked up, so that several pixels are told at once.

    Parameters
    ----------
    blurred : (H, W, 3) uint8
        Blue, green and red.
    first : int
        The row. Those before it are `COLORED`.
    hue : float
        The carpet's pixels have less: logarithm of red by green, and `BLUE_WEIGHT` times that of blue by green, with
        `NOISE_COUNTS` added to each.
    green : float
        And more of this: twice the green less red and blue, by their sum and `DARK_COUNTS`.
    level : float
        And their green is at least this: black in the carpet's reflected light is as green as carpet, but darker.
    levels : (H, W) uint8
        Filled with the green, from that row on.
    kinds : (H, W) uint8
        Filled with `CARPET`, `NEUTRAL` or `COLORED`.
    """
    height, width, _ = blurred.shape
    # powers in the place of logarithms: the 20th of red by green times the third of blue by green
    most, least, dark = np.float32(math.exp(20.0 * hue)), np.float32(green), np.float32(level)
    max_red, max_blue = np.float32(math.exp(_MAX_RED)), np.float32(math.exp(_MAX_BLUE))
    noise, counts, three = np.float32(NOISE_COUNTS), np.float32(DARK_COUNTS), np.float32(3.0)
    blues, reds = np.empty((2, width), np.uint8)
    for v in range(first):
        for u in range(width):
            kinds[v, u] = COLORED
    for v in range(first, height):
        # channels apart, a row at a time
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
            # black patches are as green as grey is, or nearly; white in warm light is as red as it is green
            is_carpet = (
                (g >= dark)
                & (three * g - total > least * (total + counts))
                & (tenth * tenth * (blue * blue * blue) < most)
            )
            other = np.uint8(COLORED) if (red > max_red) | (blue > max_blue) else np.uint8(NEUTRAL)
            kinds[v, u] = np.uint8(CARPET) if is_carpet else other
