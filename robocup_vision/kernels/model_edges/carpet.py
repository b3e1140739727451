"""Estimates the carpet's colour from a picture, and classifies a colour as carpet or as a marking's paint.

Search and verdict use both for every sample: a line has carpet on both sides, and what hides a line is not carpet.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled, flag, variable
from robocup_vision.kernels.model_edges.tables import FloatArray, Int64Array, UInt8Array

ONE, TWO = np.uintp(1), np.uintp(2)
GRID = 24  # places along each image axis at which the carpet is looked at
TONES = 24  # cells of the histogram of tones, along the fraction of blue and along that of red
# least excess of green in a surely green tone, as a fraction of all light; and least fraction of the pixels that the
# carpet fills beside a near robot
MIN_SURE_GREEN, MIN_BESIDE = 0.1, 0.1
# the same excess of green of a carpet bleached by glare, which noisy grey does not reach; and the least fraction of the
# pixels that a carpet in other light fills
MIN_GREEN, MIN_OTHER = 0.03, 0.05
# a patch of carpet in other light is wider than the picture's width divided by this, a blurred line is not; and the
# fraction by which the light of neighbouring grass may differ
PATCHES, SAME_LIGHT = 60, 0.4
# least sum of the channels of a pixel that has a tone; in a dark hall, as a fraction of the mean
MIN_LIGHT, DARK_RATIO = 60.0, 0.5
# fraction of the carpet's saturation that is left beside something white; fraction of blue or red in grey light
MIN_SATURATION, GREY = 0.5, 1.0 / 3.0
# numbers that describe a carpet, see `carpet_look`; of one in sun and shade
CARPET, LIT_CARPET = 5, 8
# rows of carpet below its end, and columns between those in which it is looked for
END_ROWS, END_STRIDE = 3, 4
# least brightness, cosine of hue and whiteness of a paint, relative to the nominal one: shadows leave less than half,
# blur mixes the background in, lamps have a tint
MIN_PAINT, MIN_HUE_COS, MIN_WHITENESS = 0.3, 0.7, 0.5


@compiled(fastmath=True, error_model="numpy")
def _green_excess(i: int, j: int) -> float:
    """Return the excess of green over the greater of blue and red in a cell of tones, as a fraction of all light."""
    blue, red = (i - 0.5) / (TONES - 1), (j - 0.5) / (TONES - 1)
    return 1.0 - blue - red - max(blue, red)


@compiled(fastmath=True, error_model="numpy")
def _with_neighbours(tones: Int64Array, i: int, j: int) -> int:
    """Count the pixels of a cell and its neighbours: the mode of this count does not depend on where cells begin."""
    near = 0
    for k in range(-1, 2):
        for m in range(-1, 2):
            near += tones[i + k, j + m]
    return near


@compiled(fastmath=True, error_model="numpy")
def _commonest(tones: Int64Array, total: int) -> tuple[int, int]:
    """Return the cell of the commonest tone; where that is not green, the commonest green one if it is common enough.

    A near robot may fill more of the picture than the carpet does.
    """
    best, bi, bj = -1, 1, 1
    for i in range(1, TONES + 1):
        for j in range(1, TONES + 1):
            near = _with_neighbours(tones, i, j) + tones[i, j]
            if near > best:
                best, bi, bj = near, i, j
    if _green_excess(bi, bj) > MIN_SURE_GREEN:
        return bi, bj
    greenest, gi, gj = int(MIN_BESIDE * total), bi, bj
    for i in range(1, TONES + 1):
        for j in range(1, TONES + 1):
            # the noise of a grey tone reaches into the cells around it
            if _green_excess(i, j) <= MIN_SURE_GREEN or max(abs(i - bi), abs(j - bj)) <= 2:
                continue
            near = _with_neighbours(tones, i, j)
            if near > greenest:
                greenest, gi, gj = near, i, j
    return gi, gj


@compiled(fastmath=True, error_model="numpy")
def _is_green(b: float, g: float, r: float) -> bool:
    """Return whether green is the strongest channel, as it is even in a carpet bleached by glare."""
    return g - max(b, r) > MIN_GREEN * (b + g + r)


@compiled(fastmath=True, error_model="numpy")
def _other_light(greens: Int64Array, total: int, bi: int, bj: int) -> tuple[int, int]:
    """Return the cell of the common green tone farthest from the carpet's; the carpet's own cell if there is none.

    Glare and overexposure bleach a carpet in the sun, and cameras deepen the colours of shadows.
    """
    farthest, fi, fj = 4, bi, bj
    for i in range(1, TONES + 1):
        for j in range(1, TONES + 1):
            away2 = (i - bi) ** 2 + (j - bj) ** 2
            if away2 > farthest and greens[i, j] > 0 and _with_neighbours(greens, i, j) > MIN_OTHER * total:
                farthest, fi, fj = away2, i, j
    return fi, fj


@compiled(fastmath=True, error_model="numpy")
def _lies_in_patches(image: UInt8Array, top: int, i: int, j: int, least: float) -> bool:
    """Return whether most pixels of a green tone have equally light green neighbours on three sides.

    The tone then is a patch of carpet, and not a line that blur mixes with carpet.
    """
    height, width = image.shape[0], image.shape[1]
    away = max(width // PATCHES, 2)
    number, inside = 0, 0
    for row in range(GRID):
        y = top + (height - 2 - top) * row // (GRID - 1)
        for column in range(GRID):
            x = 2 + (width - 5) * column // (GRID - 1)
            b, g, r = float(image[y, x, 0]), float(image[y, x, 1]), float(image[y, x, 2])
            light = b + g + r
            if light <= least or not _is_green(b, g, r):
                continue
            if abs(1 + int(b / light * (TONES - 1)) - i) > 1 or abs(1 + int(r / light * (TONES - 1)) - j) > 1:
                continue
            number += 1
            sides = 0
            for k in range(4):
                shift = away * (1 - 2 * (k // 2))
                v = min(max(y + (shift if k % 2 == 0 else 0), 0), height - 1)
                u = min(max(x + (shift if k % 2 == 1 else 0), 0), width - 1)
                b, g, r = float(image[v, u, 0]), float(image[v, u, 1]), float(image[v, u, 2])
                if abs(b + g + r - light) < SAME_LIGHT * light and _is_green(b, g, r):
                    sides += 1
            inside += 1 if sides >= 3 else 0
    return 2 * inside > number


@compiled(fastmath=True, error_model="numpy")
def _mean_tone(
    lit: FloatArray, cells: Int64Array, count: int, i: int, j: int, green_only: bool, mean: FloatArray
) -> int:
    """Fill in the mean colour of the pixels, or of the green ones, in and around a cell; returns their number."""
    number = 0
    for c in range(3):
        mean[c] = 0.0
    for k in range(count):
        if abs(cells[k, 0] - i) <= 1 and abs(cells[k, 1] - j) <= 1:
            if green_only and not _is_green(lit[k, 0], lit[k, 1], lit[k, 2]):
                continue
            number += 1
            for c in range(3):
                mean[c] += lit[k, c]
    for c in range(3):
        mean[c] /= max(number, 1)
    return number


@compiled(fastmath=True, error_model="numpy")
def carpet_look(image: UInt8Array, horizon_row: int, carpet: FloatArray) -> None:
    """Estimate the carpet's colour and the picture's noise from a grid of pixels below the horizon.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    horizon_row : int
        Row below which the floor may begin.
    carpet : (5,) or (8,) float64
        Result: blue, green and red of the carpet's tone (`_commonest`), the noise of a channel (grey levels), and the
        fraction of the pixels that had this tone. In an array of 8 also blue, green and red of the carpet in other
        light (`_other_light`); the same tone again if there is none.
    """
    height, width = image.shape[0], image.shape[1]
    top = min(max(horizon_row + 2, 1), height - 12)
    tones = np.zeros((TONES + 2, TONES + 2), dtype=np.int64)
    rough = np.zeros(64, dtype=np.int64)
    greens = np.zeros((TONES + 2, TONES + 2), dtype=np.int64)
    lit = np.empty((GRID * GRID, 3))
    cells = np.empty((GRID * GRID, 2), dtype=np.int64)
    total, count, sum_light = variable(0), variable(0), 0
    for i in range(GRID):
        y = top + (height - 2 - top) * i // (GRID - 1)
        for j in range(GRID):
            x = 2 + (width - 5) * j // (GRID - 1)
            sum_light += int(image[y, x, 0]) + int(image[y, x, 1]) + int(image[y, x, 2])
    least = min(MIN_LIGHT, DARK_RATIO * sum_light / GRID**2)
    for i in range(GRID):
        y = top + (height - 2 - top) * i // (GRID - 1)
        for j in range(GRID):
            x = 2 + (width - 5) * j // (GRID - 1)
            b, g, r = float(image[y, x, 0]), float(image[y, x, 1]), float(image[y, x, 2])
            roughness = abs(int(image[y, x - 1, 1]) - 2 * int(image[y, x, 1]) + int(image[y, x + 1, 1]))
            rough[min(roughness, 63)] += 1
            total += 1
            light = b + g + r
            if light > least:
                lit[count, 0], lit[count, 1], lit[count, 2] = b, g, r
                cells[count, 0] = 1 + int(b / light * (TONES - 1))
                cells[count, 1] = 1 + int(r / light * (TONES - 1))
                tones[cells[count, 0], cells[count, 1]] += 1
                if carpet.shape[0] > CARPET and _is_green(b, g, r):
                    greens[cells[count, 0], cells[count, 1]] += 1
                count += 1
    bi, bj = _commonest(tones, total)
    number = _mean_tone(lit, cells, count, bi, bj, flag(False), carpet[:3])
    if carpet.shape[0] > CARPET:
        for c in range(3):
            carpet[5 + c] = carpet[c]
        if _is_green(carpet[0], carpet[1], carpet[2]):
            oi, oj = _other_light(greens, total, bi, bj)
            if (oi != bi or oj != bj) and _lies_in_patches(image, top, oi, oj, least):
                _mean_tone(lit, cells, count, oi, oj, flag(True), carpet[5:])
    half, k = 0, 0
    while k < 63 and half + rough[k] < total // 2:
        half += rough[k]
        k += 1
    # the median of |x0 - 2 x1 + x2| of Gaussian noise is 0.6745 sqrt(6) of its standard deviation
    median = k + (total // 2 - half) / max(rough[k], 1) - 0.5
    carpet[3] = max(median / (0.6745 * math.sqrt(6.0)), 0.8)
    carpet[4] = number / max(total, 1)


@compiled(fastmath=True, error_model="numpy")
def other_light(carpet: FloatArray) -> float:
    """Return the sum of blue, green and red of the carpet's second tone; of its only tone where it has one."""
    if carpet.shape[0] > CARPET:
        return float(carpet[5] + carpet[6] + carpet[7])
    return float(carpet[0] + carpet[1] + carpet[2])


@compiled(fastmath=True, error_model="numpy")
def is_carpet(
    b: float,
    g: float,
    r: float,
    carpet: FloatArray,
    noise_ratio: float = 1.0,
    min_saturation: float = MIN_SATURATION,
) -> bool:
    """Return whether a colour may be the carpet's, somewhat brighter, darker or paler.

    `noise_ratio` is the noise of the colour divided by that of one pixel; `min_saturation` is the least saturation as a
    fraction of the carpet's.
    """
    light, usual = b + g + r, carpet[0] + carpet[1] + carpet[2]
    other = other_light(carpet)
    if light < 1.0 or usual < 1.0 or light < 0.45 * min(usual, other) or light > 1.6 * max(usual, other):
        return False
    slack = 0.05 + 2.0 * noise_ratio * carpet[3] / light
    blue, red = carpet[0] / usual, carpet[2] / usual
    if other != usual:
        # between light and shade every tone between the two is carpet
        to_blue, to_red = carpet[5] / other - blue, carpet[7] / other - red
        fraction = (b / light - blue) * to_blue + (r / light - red) * to_red
        fraction = min(max(fraction / max(to_blue * to_blue + to_red * to_red, 1e-9), 0.0), 1.0)
        blue += fraction * to_blue
        red += fraction * to_red
        # a bleached carpet's tone is not far from grey
        lead = 0.5 * light * (1.0 - blue - red - max(blue, red))
        if g - max(b, r) < lead - 2.0 * noise_ratio * carpet[3]:
            return False
    # white that lens, demosaicing and chroma subsampling mix in takes saturation, but neither hue nor light
    to_blue, to_red = blue - GREY, red - GREY
    grey_blue, grey_red = b / light - GREY, r / light - GREY
    saturation = (grey_blue * to_blue + grey_red * to_red) / max(to_blue * to_blue + to_red * to_red, 1e-9)
    saturation = max(saturation, min(min_saturation * max(usual / light, 1.0), 1.0))
    return bool(abs(grey_blue - saturation * to_blue) < slack and abs(grey_red - saturation * to_red) < slack)


@compiled(fastmath=True, error_model="numpy")
def is_carpet_at(
    flat: UInt8Array, at: int, step: int, beside: int, carpet: FloatArray, min_saturation: float = MIN_SATURATION
) -> bool:
    """Return whether the mean of the nine pixels about pixel `at` of a flattened picture may be the carpet's colour.

    The mean is taken because noise tints dark pixels.
    """
    blue, green, red = 0, 0, 0
    for i in range(-1, 2):
        for j in range(-1, 2):
            k = np.uintp(at + i * step + j * beside)
            blue += int(flat[k])
            green += int(flat[k + ONE])
            red += int(flat[k + TWO])
    return is_carpet(blue / 9.0, green / 9.0, red / 9.0, carpet, 1.0 / 3.0, min_saturation)


@compiled(fastmath=True, error_model="numpy")
def mark_carpet(image: UInt8Array, carpet: FloatArray, rows: int, columns: int, marks: UInt8Array) -> None:
    """Fill in marks (R, C): whether pixels of an image, `rows` and `columns` apart, may be carpet."""
    for i in range(marks.shape[0]):
        for j in range(marks.shape[1]):
            y, x = i * rows, j * columns
            b, g, r = float(image[y, x, 0]), float(image[y, x, 1]), float(image[y, x, 2])
            marks[i, j] = is_carpet(b, g, r, carpet)


def carpet_marks(image: UInt8Array, carpet: FloatArray, rows: int, columns: int) -> UInt8Array:
    """Return whether pixels of an image (H, W, 3), `rows` and `columns` apart, may be carpet: (R, C) uint8, 0 or 1."""
    height, width = image.shape[:2]
    marks = np.zeros((-(-height // rows), -(-width // columns)), dtype=np.uint8)
    mark_carpet(image, carpet, rows, columns, marks)
    return marks


def carpet_ends(image: UInt8Array, horizon_row: int) -> FloatArray:
    """Return where the carpet ends at the top of image columns below the horizon, as at the foot of a wall.

    Returns
    -------
    (N, 3) float64
        Pixels u and v, and 0: see `bands.line_points`. A column whose carpet reaches the horizon is left out.
    """
    top, carpet = max(horizon_row + 1, 0), np.zeros(CARPET)
    if top + END_ROWS >= image.shape[0]:
        return np.zeros((0, 3))
    carpet_look(image, horizon_row, carpet)
    marks = carpet_marks(image[top:], carpet, 1, END_STRIDE)
    begins = np.min([marks[k : len(marks) - END_ROWS + k] for k in range(END_ROWS)], axis=0)
    first = begins.argmax(axis=0)
    ends = (first > 0) & begins.any(axis=0)
    columns = END_STRIDE * np.arange(marks.shape[1])
    return np.asarray(np.column_stack([columns, top + first - 0.5, np.zeros(len(columns))])[ends])


@compiled(fastmath=True, error_model="numpy")
def is_paint(b: float, g: float, r: float, channel: FloatArray, brightness: float) -> bool:
    """Return whether a colour may be a channel's paint, by its hue or whiteness; grey or black paint accepts any."""
    mean = (b + g + r) / 3.0
    if channel[7] > 0.0:
        return bool(min(b, g, r) > MIN_WHITENESS * max(b, g, r) and mean > MIN_PAINT * channel[7] * brightness)
    size = math.sqrt(channel[4] ** 2 + channel[5] ** 2 + channel[6] ** 2)
    if size == 0.0:
        return True
    b, g, r = b - mean, g - mean, r - mean
    along = (b * channel[4] + g * channel[5] + r * channel[6]) / size
    return bool(along > MIN_PAINT * size * brightness and along > MIN_HUE_COS * math.sqrt(b * b + g * g + r * r))
