"""Compiled test above and below a blob: the bands of beacons and posts continue there, balls do not."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.balls.blobs import Bgr, FloorTable

# distances of the rows above and below a blob, and of the outer places, from its middle: half sizes and pixels
_ABOVE_RATIO, _BESIDE_RATIO, _BEYOND_PX = 1.35, 1.35, 2.0
# places in a row: those within the blob's width, and all
_WITHIN, _PLACES = 3, 5
# an object continues if the colours on both sides differ from it by more than this number of levels plus this multiple
# of its own spread
_MIN_STEP, _SPREADS = 15.0, 2.0


@compiled
def count_upright(
    frame: UInt8Array,
    middle: tuple[float, float],
    halves: tuple[float, float],
    up: tuple[float, float],
    table: FloorTable,
) -> int:
    """Count the directions, up and down, in which an object of the blob's width continues in a colour other than floor.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    middle : (float, float)
        Middle of the blob, u and v.
    halves : (float, float)
        Its half sizes upwards and aside, pixels.
    up : (float, float)
        Unit vector in the picture.
    table : FloorTable
        Floor colours; may be a plain tuple.
    """
    table = FloorTable(*table)
    colors, found = np.empty((_PLACES, 3)), 0
    for way in (1.0, -1.0):
        ahead = way * (_ABOVE_RATIO * halves[0] + _BEYOND_PX)
        if _read_row(frame, (middle[0] + ahead * up[0], middle[1] + ahead * up[1]), halves[1], up, colors):
            inner, outer = colors[:_WITHIN], colors[_WITHIN:]
            found += not _is_floor(inner, table) and _differs(inner, outer)
    return found


@compiled
def _read_row(
    frame: UInt8Array, middle: tuple[float, float], half_px: float, up: tuple[float, float], out: FloatArray
) -> bool:
    """Write mean colours (5, 3) of 3 x 3 pixels in a row: three places within the blob's width, two beside it.

    Returns whether all places are in the picture.
    """
    height, width, _ = frame.shape
    beside = _BESIDE_RATIO * half_px + _BEYOND_PX
    aside = (-0.5 * half_px, 0.0, 0.5 * half_px, -beside, beside)
    for n in range(_PLACES):
        u, v = int(round(middle[0] + aside[n] * up[1])), int(round(middle[1] - aside[n] * up[0]))
        if u < 1 or v < 1 or u > width - 2 or v > height - 2:
            return False
        for c in range(3):
            total = 0
            for y in range(v - 1, v + 2):
                for x in range(u - 1, u + 2):
                    total += frame[y, x, c]
            out[n, c] = total / 9.0
    return True


@compiled
def _is_floor(colors: FloatArray, table: FloorTable) -> bool:
    for n in range(len(colors)):
        packed = 0
        for c in range(3):
            packed += table.packing[c, int(colors[n, c] + 0.5)]
        if table.floor_llr[packed] > 0:
            return True
    return False


@compiled
def _differs(inner: FloatArray, outer: FloatArray) -> bool:
    """Whether all outer colours differ from the mean of the inner colours by more than the inner ones do."""
    count = len(inner)
    blue, green, red = inner[:, 0].sum() / count, inner[:, 1].sum() / count, inner[:, 2].sum() / count
    spread, apart = 0.0, np.inf
    for n in range(count):
        spread = max(spread, _apart(inner[n], (blue, green, red)))
    for n in range(len(outer)):
        apart = min(apart, _apart(outer[n], (blue, green, red)))
    return bool(apart > _MIN_STEP + _SPREADS * spread)


@compiled
def _apart(color: FloatArray, other: Bgr) -> float:
    return float(max(abs(color[0] - other[0]), abs(color[1] - other[1]), abs(color[2] - other[2])))
