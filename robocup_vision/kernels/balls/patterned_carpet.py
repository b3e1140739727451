"""Compiled measure that the search for patterned balls begins with: the frame's carpet."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles
from robocup_vision.kernels.balls.patterned import BLUE_WEIGHT, DARK_COUNTS

# pixels from one that is looked at to the next, along rows and columns: at least so many, and so many in a wide row,
# for a few thousand tell quartiles to a hundredth of what carpet varies
STRIDE, PER_ROW = 4, 80
# radii from a ball's middle, within which pixels are looked at
BEYOND = 4.0
# what is told of the carpet
RATIO, QUARTER, HUE, THREE_QUARTERS, GREEN, LEVEL, TOLD = range(7)


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
