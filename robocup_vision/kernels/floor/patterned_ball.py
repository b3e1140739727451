"""Compiled search for balls with dark patches: round things that are not of the carpet's colour, on carpet.

A disc of each size is laid over the picture in steps of a fraction of its radius. Inside it nearly nothing may be
green; around it most must be, but for the lines, posts and other balls that it may touch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled

CARPET, NEUTRAL, COLORED = 0, 1, 2
DIRECTIONS = 24
# directions of a first look, and how many of them must show carpet: half of the rim, and one may err
_ROUGH, _MIN_ROUGH = 8, 3
# side of the cells in which it is known how far carpet is
_CELL_PX = 8
# columns of a found disc
U, V, RADIUS, AGREE, INSIDE, WHITE, DARK, CARPET_LEVEL, AROUND, SHOWN, COLUMNS = range(11)
# radii, in those of the disc, at which it is looked for carpet all around
_AROUND = (2.0, 3.0)
# sine of the angle below the level from which on a rim is the ball's underside: lit by the carpet it is green as well
_UNDERSIDE = 0.5
# from this ratio of their radii on two discs at one place are two answers
_OTHER_SIZE = 1.3
# weight of the blue: it says less than the red, for a white ball on carpet in warm light is yellow
BLUE_WEIGHT = 0.15
# added to the sum of the channels: the darker a pixel, the less its hue says
DARK_COUNTS = 30.0
# logarithms beyond which a pixel is coloured: red beside green, blue beside green
_MAX_RED, _MAX_BLUE = 0.6, 0.4


class DiscSearch(NamedTuple):
    """Where rims are looked for, and what a disc must show.

    Parameters
    ----------
    inner, outer, beyond_px : float
        Radii of the samples within and beyond the rim, in radii; pixels added to the outer one: the picture's blur.
    steps : float
        Of a radius, between places.
    min_inside, min_agree : float
        Of the samples within, those that are not carpet; of the directions shown, those that part ball from carpet.
    apart : float
        Of two discs of about one size, nearer than so many radii, one is kept.
    max_dark, min_dark : float
        Of the white, what a dark patch has at most; of the disc, what must be dark.
    """

    inner: float
    outer: float
    beyond_px: float
    steps: float
    min_inside: float
    min_agree: float
    apart: float
    max_dark: float
    min_dark: float


@compiled
def classify(
    frame: UInt8Array,
    logs: FloatArray,
    max_hue: float,
    min_green: float,
    min_level: float,
    kinds: UInt8Array,
    level: UInt8Array,
) -> None:
    """Say of each pixel whether it may be carpet or ball.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    logs : (256,) float64
        Logarithm of each level, with the noise of a dark pixel added to it.
    max_hue : float
        The carpet's pixels have less: logarithm of red by green, and `BLUE_WEIGHT` times that of blue by green.
    min_green : float
        And more of this: twice the green less red and blue, by their sum and `DARK_COUNTS`.
    min_level : float
        And its green is at least this: black in the carpet's reflected light is as green as carpet, but darker.
    kinds, level : (H, W) uint8
        Filled: with `CARPET`, `NEUTRAL` or `COLORED`, and with its green: what is carpet in part is no darker.
    """
    for v in range(frame.shape[0]):
        for u in range(frame.shape[1]):
            green = logs[frame[v, u, 1]]
            red, blue = logs[frame[v, u, 2]] - green, logs[frame[v, u, 0]] - green
            level[v, u] = frame[v, u, 1]
            b, g, r = float(frame[v, u, 0]), float(frame[v, u, 1]), float(frame[v, u, 2])
            # black patches are as green as grey is, or nearly; white in warm light is as red as it is green
            is_lit = g >= min_level
            if (
                is_lit
                and red + BLUE_WEIGHT * blue < max_hue
                and 2.0 * g - b - r > min_green * (b + g + r + DARK_COUNTS)
            ):
                kinds[v, u] = CARPET
            elif red > _MAX_RED or blue > _MAX_BLUE:
                kinds[v, u] = COLORED
            else:
                kinds[v, u] = NEUTRAL


@compiled
def measure_disc(
    kinds: UInt8Array, directions: FloatArray, u: float, v: float, radius: float, search: DiscSearch
) -> tuple[int, int, float]:
    """Return how many directions part ball from carpet at a rim, how many are shown, and the ratio of ball inside.

    Where the underside is of the carpet's colour, it speaks neither for a ball nor against it.
    """
    height, width = kinds.shape
    agree, shown, inside, count = 0, 0, 0, 0
    far = search.outer * radius + search.beyond_px
    for k in range(len(directions)):
        c, s = directions[k, 0], directions[k, 1]
        x, y = int(u + search.inner * radius * c + 0.5), int(v + search.inner * radius * s + 0.5)
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        is_ball = kinds[y, x] == NEUTRAL
        if s > _UNDERSIDE and kinds[y, x] == CARPET:
            continue
        x, y = int(u + 0.5 * radius * c + 0.5), int(v + 0.5 * radius * s + 0.5)
        if 0 <= x < width and 0 <= y < height:
            inside += kinds[y, x] == NEUTRAL
            count += 1
        inside += is_ball
        count += 1
        x, y = int(u + far * c + 0.5), int(v + far * s + 0.5)
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        shown += 1
        agree += is_ball and kinds[y, x] == CARPET
    return agree, shown, inside / max(count, 1)


@compiled
def _shows_carpet(kinds: UInt8Array, top: int, left: int) -> bool:
    """Return whether the cell that begins at a pixel shows carpet."""
    for v in range(top, min(top + _CELL_PX, kinds.shape[0])):
        for u in range(left, min(left + _CELL_PX, kinds.shape[1])):
            if kinds[v, u] == CARPET:
                return True
    return False


@compiled
def _cells_to_carpet(kinds: UInt8Array) -> Int64Array:
    """Return how many cells of `_CELL_PX` each cell lies from one that shows carpet, along rows or columns."""
    height, width = kinds.shape
    rows, columns = (height + _CELL_PX - 1) // _CELL_PX, (width + _CELL_PX - 1) // _CELL_PX
    away = np.full((rows, columns), rows + columns, dtype=np.int64)
    for i in range(rows):
        for j in range(columns):
            if _shows_carpet(kinds, i * _CELL_PX, j * _CELL_PX):
                away[i, j] = 0
    for turn in range(2):
        for n in range(rows * columns):
            at = n if turn == 0 else rows * columns - 1 - n
            i, j = at // columns, at % columns
            # the neighbours that this turn has been at
            before = -1 if turn == 0 else 1
            nearest = away[i, j]
            if 0 <= j + before < columns:
                nearest = min(nearest, away[i, j + before] + 1)
            if 0 <= i + before < rows:
                for k in range(max(j - 1, 0), min(j + 2, columns)):
                    nearest = min(nearest, away[i + before, k] + 1)
            away[i, j] = nearest
    return away


@compiled
def find_discs(
    kinds: UInt8Array,
    directions: FloatArray,
    radii: FloatArray,
    row_radii: FloatArray,
    search: DiscSearch,
    out: FloatArray,
) -> int:
    """Write the discs that may be balls into `out` (N, COLUMNS), and return how many.

    Parameters
    ----------
    kinds : (H, W) uint8
        From `classify`.
    directions : (DIRECTIONS, 2) float64
        Unit vectors.
    radii : (R,) float64
        That are tried, px.
    row_radii : (H, 2) float64
        Least and greatest radius of a disc whose middle is in a row.
    search : DiscSearch
        Where rims are looked for.
    out : (N, COLUMNS) float64
        Filled.
    """
    height, width = kinds.shape
    found, around, away = 0, np.empty((_ROUGH, 2), dtype=np.int64), _cells_to_carpet(kinds)
    for n in range(len(radii)):
        radius = radii[n]
        step = max(int(search.steps * radius + 0.5), 1)
        near = int(0.6 * radius)
        far = search.outer * radius + search.beyond_px
        for k in range(_ROUGH):
            turn = k * DIRECTIONS // _ROUGH
            around[k, 0], around[k, 1] = round(far * directions[turn, 0]), round(far * directions[turn, 1])
        # farther from carpet than this no place around is carpet
        reach = (int(far) + 1) // _CELL_PX + 1
        for v in range(0, height, step):
            if not row_radii[v, 0] <= radius <= row_radii[v, 1]:
                continue
            u = -step
            while u + step < width:
                u += step
                # the next place beyond this cell follows
                if away[v // _CELL_PX, u // _CELL_PX] > reach:
                    u += (_CELL_PX - 1 - u % _CELL_PX) // step * step
                    continue
                # the middle and most of its surroundings are ball
                if kinds[v, u] != NEUTRAL:
                    continue
                missing = 0
                if u >= near:
                    missing += kinds[v, u - near] != NEUTRAL
                if u + near < width:
                    missing += kinds[v, u + near] != NEUTRAL
                if v >= near:
                    missing += kinds[v - near, u] != NEUTRAL
                if v + near < height:
                    missing += kinds[v + near, u] != NEUTRAL
                if missing > 1:
                    continue
                carpet = 0
                for k in range(_ROUGH):
                    x, y = u + around[k, 0], v + around[k, 1]
                    if 0 <= x < width and 0 <= y < height:
                        carpet += kinds[y, x] == CARPET
                if carpet < _MIN_ROUGH:
                    continue
                agree, shown, inside = measure_disc(kinds, directions, u, v, radius, search)
                if shown < DIRECTIONS // 2 or agree < search.min_agree * shown or inside < search.min_inside:
                    continue
                if found < len(out):
                    out[found, U], out[found, V], out[found, RADIUS] = u, v, radius
                    out[found, AGREE], out[found, INSIDE] = agree / shown, inside
                    found += 1
    return found


@compiled
def best_discs(
    kinds: UInt8Array, level: UInt8Array, directions: FloatArray, search: DiscSearch, found: FloatArray, out: FloatArray
) -> int:
    """Keep the best of like discs that lie over each other, fit place and size, measure patches; return how many.

    Parameters
    ----------
    kinds, level : (H, W) uint8
        From `classify`.
    directions : (DIRECTIONS, 2) float64
        Unit vectors.
    search : DiscSearch
        Where rims are looked for.
    found : (N, COLUMNS) float64
        From `find_discs`.
    out : (M, COLUMNS) float64
        Filled.
    """
    # the rim, the inside, and a little for size: a disc within a ball agrees nearly as well
    score = found[:, AGREE] + found[:, INSIDE] + 0.003 * found[:, RADIUS]
    kept, tried = 0, np.empty((4 * len(out), 3))
    for n in range(len(tried)):
        best = int(np.argmax(score)) if len(score) else 0
        if len(score) == 0 or score[best] < 0.0:
            break
        tried[n] = found[best, : RADIUS + 1]
        for m in range(len(score)):
            far = search.apart * max(found[m, RADIUS], tried[n, RADIUS])
            # a ball and the line it touches look like a larger one: what its place says decides between them
            size = max(found[m, RADIUS], tried[n, RADIUS]) / min(found[m, RADIUS], tried[n, RADIUS])
            if score[m] >= 0.0 and size < _OTHER_SIZE:
                if math.hypot(found[m, U] - tried[n, U], found[m, V] - tried[n, V]) < far:
                    score[m] = -1.0
        rough = measure_patches(kinds, level, tried[n, U], tried[n, V], tried[n, RADIUS], search.max_dark)
        if rough[1] < search.min_dark:
            continue
        if kept == len(out):
            break
        _refine(kinds, directions, search, tried[n], out[kept])
        row = out[kept]
        row[WHITE], row[DARK] = measure_patches(kinds, level, row[U], row[V], row[RADIUS], search.max_dark)
        row[CARPET_LEVEL], row[AROUND] = _surroundings(kinds, level, directions, row, search)
        kept += 1
    return kept


@compiled
def _refine(kinds: UInt8Array, directions: FloatArray, search: DiscSearch, start: FloatArray, out: FloatArray) -> None:
    """Write the best of the discs around one, a little moved, smaller or larger, into a row."""
    best = -1.0
    for k in range(5):
        radius = start[2] * (0.9 + 0.055 * k)
        step = max(0.12 * radius, 1.0)
        for i in range(-1, 2):
            for j in range(-1, 2):
                u, v = start[0] + step * i, start[1] + step * j
                agree, shown, inside = measure_disc(kinds, directions, u, v, radius, search)
                if shown >= DIRECTIONS // 2 and agree / shown + inside > best + 1e-9:
                    best = agree / shown + inside
                    out[U], out[V], out[RADIUS], out[AGREE], out[INSIDE] = u, v, radius, agree / shown, inside
                    out[SHOWN] = shown / len(directions)


@compiled
def _surroundings(
    kinds: UInt8Array, level: UInt8Array, directions: FloatArray, row: FloatArray, search: DiscSearch
) -> tuple[float, float]:
    """Return the mean level of the carpet at a disc's rim, and the ratio of carpet farther around."""
    height, width = kinds.shape
    near = search.outer * row[RADIUS] + search.beyond_px
    total, count, carpet, shown = 0.0, 0, 0, 0
    for k in range(len(directions)):
        x, y = int(row[U] + near * directions[k, 0] + 0.5), int(row[V] + near * directions[k, 1] + 0.5)
        if 0 <= x < width and 0 <= y < height and kinds[y, x] == CARPET:
            total += level[y, x]
            count += 1
        for ratio in _AROUND:
            far = ratio * row[RADIUS]
            x, y = int(row[U] + far * directions[k, 0] + 0.5), int(row[V] + far * directions[k, 1] + 0.5)
            if 0 <= x < width and 0 <= y < height:
                shown += 1
                carpet += kinds[y, x] == CARPET
    return total / max(count, 1), carpet / max(shown, 1)


@compiled
def measure_patches(
    kinds: UInt8Array, level: UInt8Array, u: float, v: float, radius: float, max_dark: float
) -> tuple[float, float]:
    """Return the brightness of a disc's white (mean of the upper half of its levels), and the ratio of dark places."""
    height, width = kinds.shape
    reach = int(0.85 * radius + 0.5)
    bins = np.zeros(256, dtype=np.int64)
    count, of_ball = 0, 0
    for dv in range(-reach, reach + 1):
        y = int(v + 0.5) + dv
        if y < 0 or y >= height:
            continue
        half = int(math.sqrt(max(0.7225 * radius * radius - dv * dv, 0.0)) + 0.5)
        for x in range(max(int(u + 0.5) - half, 0), min(int(u + 0.5) + half + 1, width)):
            count += 1
            if kinds[y, x] == NEUTRAL:
                bins[level[y, x]] += 1
                of_ball += 1
    total, number = 0.0, 0
    for k in range(255, -1, -1):
        if 2 * number >= of_ball:
            break
        number += bins[k]
        total += k * bins[k]
    if number == 0:
        return 0.0, 0.0
    white, dark = total / number, 0
    for k in range(256):
        if k < max_dark * white:
            dark += bins[k]
    return white, dark / count
