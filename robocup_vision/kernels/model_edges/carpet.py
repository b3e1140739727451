"""Colours of a picture: the carpet's own, told from the picture, and whether a colour is carpet or a mark's paint.

Search and verdict ask both for every sample: a line lies between carpets, and what hides it is no carpet.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import BoolArray
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.model_edges.tables import FloatArray, Int64Array, UInt8Array

GRID = 24  # places along each image axis at which the carpet is looked at
TONES = 24
# of all light, by which green leads in a surely green tone, and of the pixels, that a carpet beside somebody near fills
MIN_GREEN, MIN_BESIDE = 0.1, 0.1
# of a paint: shadows leave less than half of it, blur mixes the background in, lamps have a tint
MIN_PAINT, MIN_HUE_COS, MIN_WHITENESS = 0.3, 0.7, 0.5


@compiled(fastmath=True, error_model="numpy")
def _leads_in_green(i: int, j: int) -> float:
    """By how much of all light green leads over blue and red in a cell of tones."""
    blue, red = (i - 0.5) / (TONES - 1), (j - 0.5) / (TONES - 1)
    return 1.0 - blue - red - max(blue, red)


@compiled(fastmath=True, error_model="numpy")
def _with_neighbours(tones: Int64Array, i: int, j: int) -> int:
    """Pixels of a cell and of those around it: their mode does not depend on where cells begin."""
    near = 0
    for k in range(-1, 2):
        for m in range(-1, 2):
            near += tones[i + k, j + m]
    return near


@compiled(fastmath=True, error_model="numpy")
def _commonest(tones: Int64Array, total: int) -> tuple[int, int]:
    """Cell of the commonest tone; where that is not green but another common one is, of the latter.

    Somebody near may fill more of the picture than the carpet does.
    """
    best, bi, bj = -1, 1, 1
    for i in range(1, TONES + 1):
        for j in range(1, TONES + 1):
            near = _with_neighbours(tones, i, j) + tones[i, j]
            if near > best:
                best, bi, bj = near, i, j
    if _leads_in_green(bi, bj) > MIN_GREEN:
        return bi, bj
    greenest, gi, gj = int(MIN_BESIDE * total), bi, bj
    for i in range(1, TONES + 1):
        for j in range(1, TONES + 1):
            # the noise of a grey tone reaches into the cells around it
            if _leads_in_green(i, j) <= MIN_GREEN or max(abs(i - bi), abs(j - bj)) <= 2:
                continue
            near = _with_neighbours(tones, i, j)
            if near > greenest:
                greenest, gi, gj = near, i, j
    return gi, gj


@compiled(fastmath=True, error_model="numpy")
def carpet_look(image: UInt8Array, horizon_row: int, carpet: FloatArray) -> None:
    """Estimate the carpet's colour and the picture's noise from a grid of pixels below the horizon.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    horizon_row : int
        Where the floor may begin.
    carpet : (5,) float64
        Result: blue, green, red of the carpet's tone (`_commonest`), the noise of a channel (grey levels), how many
        pixels had that tone as a fraction.
    """
    height, width = image.shape[0], image.shape[1]
    top = min(max(horizon_row + 2, 1), height - 12)
    tones = np.zeros((TONES + 2, TONES + 2), dtype=np.int64)
    rough = np.zeros(64, dtype=np.int64)
    lit = np.empty((GRID * GRID, 3))
    cells = np.empty((GRID * GRID, 2), dtype=np.int64)
    total, count = 0, variable(0)
    for i in range(GRID):
        y = top + (height - 2 - top) * i // (GRID - 1)
        for j in range(GRID):
            x = 2 + (width - 5) * j // (GRID - 1)
            b, g, r = float(image[y, x, 0]), float(image[y, x, 1]), float(image[y, x, 2])
            bend = abs(int(image[y, x - 1, 1]) - 2 * int(image[y, x, 1]) + int(image[y, x + 1, 1]))
            rough[min(bend, 63)] += 1
            total += 1
            light = b + g + r
            if light > 60.0:
                lit[count, 0], lit[count, 1], lit[count, 2] = b, g, r
                cells[count, 0] = 1 + int(b / light * (TONES - 1))
                cells[count, 1] = 1 + int(r / light * (TONES - 1))
                tones[cells[count, 0], cells[count, 1]] += 1
                count += 1
    bi, bj = _commonest(tones, total)
    sums = np.zeros(3)
    number = 0
    for k in range(count):
        if abs(cells[k, 0] - bi) <= 1 and abs(cells[k, 1] - bj) <= 1:
            number += 1
            for c in range(3):
                sums[c] += lit[k, c]
    for c in range(3):
        carpet[c] = sums[c] / max(number, 1)
    half, k = 0, 0
    while k < 63 and half + rough[k] < total // 2:
        half += rough[k]
        k += 1
    # the median of |x0 - 2 x1 + x2| of Gaussian noise is 0.6745 sqrt(6) of its standard deviation
    median = k + (total // 2 - half) / max(rough[k], 1) - 0.5
    carpet[3] = max(median / (0.6745 * math.sqrt(6.0)), 0.8)
    carpet[4] = number / max(total, 1)


@compiled(fastmath=True, error_model="numpy")
def is_carpet(b: float, g: float, r: float, carpet: FloatArray, noise_ratio: float = 1.0) -> bool:
    """Return whether a colour is the carpet's, somewhat brighter or darker; its noise is so much of a pixel's."""
    light, known = b + g + r, carpet[0] + carpet[1] + carpet[2]
    if light < 0.45 * known or light > 1.6 * known or light < 1.0 or known < 1.0:
        return False
    slack = 0.05 + 2.0 * noise_ratio * carpet[3] / light
    return bool(abs(b / light - carpet[0] / known) < slack and abs(r / light - carpet[2] / known) < slack)


def carpet_mask(image: UInt8Array, carpet: FloatArray) -> BoolArray:
    """Return (H, W) bool: which pixels of an image are carpet; the same as `is_carpet`, of whole arrays."""
    light, known = image.sum(axis=-1, dtype=np.float64), float(carpet[:3].sum())
    if known < 1.0:
        return np.zeros(light.shape, dtype=np.bool_)
    level = np.maximum(light, 1.0)
    slack = 0.05 + 2.0 * carpet[3] / level
    is_lit = (light >= max(0.45 * known, 1.0)) & (light <= 1.6 * known)
    is_blue = np.abs(image[..., 0] / level - carpet[0] / known) < slack
    is_red = np.abs(image[..., 2] / level - carpet[2] / known) < slack
    return np.asarray(is_lit & is_blue & is_red)


@compiled(fastmath=True, error_model="numpy")
def is_paint(b: float, g: float, r: float, channel: FloatArray, brightness: float) -> bool:
    """Whether a colour may be a channel's paint: of its hue, or white; any colour may be a grey or black paint."""
    mean = (b + g + r) / 3.0
    if channel[7] > 0.0:
        return bool(min(b, g, r) > MIN_WHITENESS * max(b, g, r) and mean > MIN_PAINT * channel[7] * brightness)
    size = math.sqrt(channel[4] ** 2 + channel[5] ** 2 + channel[6] ** 2)
    if size == 0.0:
        return True
    b, g, r = b - mean, g - mean, r - mean
    along = (b * channel[4] + g * channel[5] + r * channel[6]) / size
    return bool(along > MIN_PAINT * size * brightness and along > MIN_HUE_COS * math.sqrt(b * b + g * g + r * r))
