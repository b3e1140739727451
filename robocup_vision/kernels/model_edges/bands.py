"""Bright bands between carpets, along rows and columns: lines of a camera that nobody knows the tilt of.

`verdict.line_points` asks for the width that a line has at a tilt; here the width is measured, and bounds the tilt.
"""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.model_edges.carpet import is_carpet

FLANK = 3  # pixels beside a band that blur leaves to the carpet


@compiled(fastmath=True, error_model="numpy")
def _is_carpet_at(flat: UInt8Array, at: int, step: int, beside: int, carpet: FloatArray) -> bool:
    """Whether the mean of nine pixels about one of a flattened picture is the carpet's colour: noise tints the dark."""
    blue, green, red = 0, 0, 0
    for i in range(-1, 2):
        for j in range(-1, 2):
            k = np.uintp(at + i * step + j * beside)
            blue += int(flat[k])
            green += int(flat[k + np.uintp(1)])
            red += int(flat[k + np.uintp(2)])
    return is_carpet(blue / 9.0, green / 9.0, red / 9.0, carpet, 1.0 / 3.0)


@compiled(fastmath=True, error_model="numpy")
def line_bands(
    image: UInt8Array, carpet: FloatArray, min_step: float, widest_px: int, stride: int, bands: FloatArray
) -> int:
    """Find bright bands that have carpet on both sides, and are none themselves, along some rows and columns.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    carpet : (5,) or (8,) float64
        As `carpet_look` returns.
    min_step : float
        By which blue and red together must exceed those of the carpet before the band (grey levels).
    widest_px : int
        What is wider is no line.
    stride : int
        Rows and columns between those that are read.
    bands : (P, 4) float64
        Result: pixels u, v of the middle, 1 where a row was read and 0 a column, and the width along it between the
        places of half the height.

    Returns
    -------
    int
        How many.
    """
    height, width = image.shape[0], image.shape[1]
    flat = image.reshape(-1)
    light = np.empty(max(height, width), np.int64)
    count = variable(0)
    for turn in range(2):
        by_row = turn == 1
        lines, length = (height, width) if by_row else (width, height)
        step, beside = (3, 3 * width) if by_row else (3 * width, 3)
        for at in range(max(stride // 2, 1), lines - 1, stride):
            start = 3 * at * width if by_row else 3 * at
            place = start
            for i in range(length):
                light[i] = int(flat[np.uintp(place)]) + int(flat[np.uintp(place + 2)])
                place += step
            i = variable(FLANK)
            while i < length - FLANK - 1 and count < bands.shape[0]:
                ground = 0.5 * (light[i - 3] + light[i - 2])
                if light[i] - ground < min_step:
                    i += 1
                    continue
                begin, end = _half_height(light, i, length, ground, widest_px)
                if end < 0.0:
                    i += 1
                    continue
                first, last = int(begin) - FLANK, int(end) + FLANK
                middle = int(0.5 * (begin + end) + 0.5)
                if (
                    first >= 1
                    and last + 1 < length
                    and _is_carpet_at(flat, start + first * step, step, beside, carpet)
                    and _is_carpet_at(flat, start + last * step, step, beside, carpet)
                    and not _is_carpet_at(flat, start + middle * step, step, beside, carpet)
                ):
                    along = 0.5 * (begin + end)
                    bands[count, 0], bands[count, 1] = (along, float(at)) if by_row else (float(at), along)
                    bands[count, 2], bands[count, 3] = (1.0 if by_row else 0.0), end - begin
                    count += 1
                i = int(end) + 2
    return count


@compiled(fastmath=True, error_model="numpy")
def _half_height(light: Int64Array, rise: int, length: int, ground: float, widest_px: int) -> tuple[float, float]:
    """Places between which a band that rises at `rise` is brighter than half its height; the second -1 if none ends."""
    top, i = 0.0, variable(rise)
    while i < length - 1 and i - rise <= widest_px and light[i] > 0.5 * (ground + max(top, light[rise])):
        top = max(top, float(light[i]))
        i += 1
    half = 0.5 * (ground + top)
    if i >= length - 1 or light[i] > half:
        return 0.0, -1.0
    end = i - (half - light[i]) / max(light[i - 1] - light[i], 1.0)
    k = variable(rise - 1)
    while k < i and light[k] < half:
        k += 1
    begin = k - (light[k] - half) / max(light[k] - light[k - 1], 1.0)
    return begin, end
