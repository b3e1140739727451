"""Compiled measures that the search for patterned balls begins with: the frame's carpet, and a ball's size by row."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.order import quantiles
from robocup_vision.kernels.algebra.pinhole import camera_axes
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


@compiled
def bound_radii(
    rays: FloatArray,
    held_rad: tuple[float, float],
    focal_px: float,
    ratio: float,
    slack_rad: float,
    size_std: float,
    rows: int,
    min_radius_px: float,
    out: FloatArray,
) -> int:
    """Write the least and greatest radius of a ball on the floor in each row of the frame.

    Returns the first row that any ball of at least `min_radius_px` reaches; H if there is none.

    Parameters
    ----------
    rays : (N, M, 3) float64
        Unit directions of some pixels of each `rows`-th row of the frame and of its last one; camera frame.
    held_rad : (float, float)
        The camera's tilt and roll.
    focal_px : float
        Focal length.
    ratio : float
        The ball's radius by the height of the camera above its centre.
    slack_rad : float
        What the tilt may be off.
    size_std : float
        What a radius may be off, of the radius.
    rows : int
        From one of the rows to the next; between two of them the radii lie between theirs.
    min_radius_px : float
        Smaller balls are not looked for.
    out : (H, 2) float64
        Filled; none is possible where the first is greater than the second.
    """
    count, columns, _ = rays.shape
    up = camera_axes(0.0, held_rad[0], held_rad[1])[2]
    bounds = np.empty((count, 2))
    for n in range(count):
        least, most = math.inf, -math.inf
        for m in range(columns):
            x, y, z = rays[n, m, 0], rays[n, m, 1], rays[n, m, 2]
            sine = x * up[0] + y * up[1] + z * up[2]
            # not a number where the lens shows nothing
            if not abs(sine) <= 1.0:
                continue
            fall = -math.asin(sine)
            radius = _radius_px(fall, ratio, focal_px / x)
            below = radius - _radius_px(fall - slack_rad, ratio, focal_px / x)
            above = _radius_px(fall + slack_rad, ratio, focal_px / x) - radius
            least = min(least, radius - math.hypot(size_std * radius, below))
            most = max(most, radius + math.hypot(size_std * radius, above))
        bounds[n, 0], bounds[n, 1] = least, most
    height = out.shape[0]
    top = height
    for v in range(height):
        n = v // rows
        out[v, 0], out[v, 1] = min(bounds[n, 0], bounds[n + 1, 0]), max(bounds[n, 1], bounds[n + 1, 1])
        if out[v, 1] >= min_radius_px:
            # beyond the frame's upper rim nothing is looked at, however large the ball
            top = min(top, int(max(v - BEYOND * out[v, 1], 0.0)))
    return int(top)


@compiled
def _radius_px(fall_rad: float, ratio: float, px_per_rad: float) -> float:
    """Return the radius in the picture of a ball whose centre lies so far below the level."""
    return math.asin(min(ratio * math.sin(min(max(fall_rad, 0.0), math.pi / 2)), 1.0)) * px_per_rad
