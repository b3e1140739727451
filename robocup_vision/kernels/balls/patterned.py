"""Compiled search for balls with dark patches: round objects that do not have the carpet's colour, on carpet.

Discs of each size are tested in steps of a fraction of their radius. Nearly nothing inside a disc may be green. Most of
its surroundings must be, except for lines, posts and other balls.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array, UInt64Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.bits import EVERY_BIT, NO_BITS, ONE, eight_equal, lowest
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
# number of directions of a rim, and their unit vectors, (DIRECTIONS, 2)
DIRECTIONS = 24
_TURNS = np.arange(DIRECTIONS) * math.tau / DIRECTIONS
_DIRECTIONS = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
# directions of a first test, of which three must agree: half a rim has four, and one may be wrong
_ROUGH = 8
_LAST = np.uint64(63)
# columns of a disc: centre and radius (px); ratio of directions that agree, and of ball inside (`measure_disc`); level
# of white, and ratio of dark places (`measure_patches`); level and ratio of carpet around it (`_surroundings`); ratio
# of directions in view
U, V, RADIUS, AGREE, INSIDE, WHITE, DARK, CARPET_LEVEL, AROUND, SHOWN, COLUMNS = range(11)
# distances, in radii, at which carpet around a disc is counted
_AROUND = (2.0, 3.0)
# sine of the angle below which a rim is the ball's underside, which reflects the carpet
_UNDERSIDE = 0.5
# discs at one place whose radii differ by this ratio are separate candidates
_OTHER_SIZE = 1.3
# samples inside and outside the rim, in radii, and pixels added to the outer ones for the picture's blur
_INNER, _OUTER, _BEYOND_PX = 0.82, 1.12, 1.5
# step between places, in radii
_STEPS = 0.25
# least ratio of inner samples that are not carpet, and of visible directions that are ball inside and carpet outside
_MIN_INSIDE, _MIN_AGREE = 0.8, 0.5
# of two discs of similar size that are closer than this number of radii, one is kept
_APART = 0.7
# greatest level of a dark patch, relative to the white; least ratio of a disc's pixels that are dark
_MAX_DARK, _MIN_DARK = 0.55, 0.04


@compiled(error_model="numpy")
def measure_carpet(
    blurred: UInt8Array, first: int, scratch: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Return the ratio of carpet in a frame's lower part, its hue's quartiles, and medians of greenness and green.

    Parameters
    ----------
    blurred : (H, W, 3) uint8
        Blue, green and red.
    first : int
        First row of the lower part.
    scratch : (4, N) float64
        Work space; N is at least one more than the number of sampled pixels.
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


@compiled
def measure_disc(kinds: UInt8Array, u: float, v: float, radius: float) -> tuple[int, int, float]:
    """Return the number of directions with ball inside and carpet outside, the number in view, and the ratio of ball.

    Places of the underside that have the carpet's colour are not counted.
    """
    height, width = kinds.shape
    agree, shown, inside, count = 0, 0, 0, 0
    far = _OUTER * radius + _BEYOND_PX
    for k in range(DIRECTIONS):
        c, s = _DIRECTIONS[k, 0], _DIRECTIONS[k, 1]
        x, y = int(u + _INNER * radius * c + 0.5), int(v + _INNER * radius * s + 0.5)
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
def _bits(kinds: UInt8Array, kind: int, outside: np.uint64, words: int, beyond: int) -> UInt64Array:
    """Return a bit for each pixel, whether it is of a kind: rows of words, padded on both sides by `beyond`.

    The padding and one more row at the bottom are `outside`.
    """
    height, width = kinds.shape
    flat = kinds.reshape(-1)
    bits = np.empty((height + 1, words + 2 * beyond), dtype=np.uint64)
    for at in range(words + 2 * beyond):
        bits[height, at] = outside
    for v in range(height):
        for at in range(beyond):
            bits[v, at] = bits[v, beyond + words + at] = outside
        for word in range(words):
            first = 64 * word
            count = min(width - first, 64)
            here = outside if count < 64 else NO_BITS
            here = (here >> np.uint64(count % 64)) << np.uint64(count % 64)
            eights = count // 8
            for k in range(eights):
                here |= eight_equal(flat, np.uint64(v * width + first + 8 * k), kind) << np.uint64(8 * k)
            for k in range(8 * eights, count):
                here |= np.uint64(kinds[v, first + k] == kind) << np.uint64(k)
            bits[v, beyond + word] = here
    return bits


@compiled
def _beside(bits: UInt64Array, row: int, word: int, offset: int) -> np.uint64:
    """Return the bits of a word that is shifted to the right by `offset` pixels; the padding must be that wide."""
    at, shift = word + (offset >> 6), np.uint64(offset & 63)
    return np.uint64((bits[row, at] >> shift) | ((bits[row, at + 1] << ONE) << (_LAST - shift)))


@compiled
def find_discs(
    kinds: UInt8Array,
    radii: FloatArray,
    row_radii: FloatArray,
    out: FloatArray,
) -> int:
    """Write the discs that may be balls into `out` (N, COLUMNS), and return their number.

    Bit operations test 64 neighbouring places together, so that few are left to be measured.

    Parameters
    ----------
    kinds : (H, W) uint8
        From `classify`.
    radii : (R,) float64
        Radii to test, px.
    row_radii : (H, 2) float64
        Least and greatest radius of a disc whose middle is in each row.
    """
    height, width = kinds.shape
    found = 0
    # outside the picture there may be ball, but no carpet
    words = (width + 63) // 64
    beyond = (int(_OUTER * radii.max() + _BEYOND_PX) + 64) // 64 if len(radii) else 1
    ball = _bits(kinds, variable(NEUTRAL), EVERY_BIT, words, beyond)
    carpet = _bits(kinds, variable(CARPET), NO_BITS, words, beyond)
    rim, far = np.empty((_ROUGH, 2), dtype=np.int64), np.empty((_ROUGH, 2), dtype=np.int64)
    places = np.empty(words, dtype=np.uint64)
    for n in range(len(radii)):
        radius = radii[n]
        step = max(int(_STEPS * radius + 0.5), 1)
        near = int(0.6 * radius)
        for k in range(_ROUGH):
            c, s = _DIRECTIONS[k * DIRECTIONS // _ROUGH]
            within, reach = _INNER * radius, _OUTER * radius + _BEYOND_PX
            rim[k, 0], rim[k, 1] = math.floor(within * c + 0.5), math.floor(within * s + 0.5)
            far[k, 0], far[k, 1] = math.floor(reach * c + 0.5), math.floor(reach * s + 0.5)
        for word in range(words):
            places[word] = NO_BITS
        for u in range(0, width, step):
            places[u // 64] |= ONE << np.uint64(u % 64)
        for v in range(0, height, step):
            if not row_radii[v, 0] <= radius <= row_radii[v, 1]:
                continue
            above, below = v - near if v >= near else height, v + near if v + near < height else height
            for word in range(words):
                at = word + beyond
                # the middle and at least three of its four neighbours must be ball
                here = places[word] & ball[v, at]
                if here == NO_BITS:
                    continue
                a, b = _beside(ball, v, at, -near), _beside(ball, v, at, near)
                c, d = ball[above, at], ball[below, at]
                here &= (a & b & (c | d)) | (c & d & (a | b))
                if here == NO_BITS:
                    continue
                once, twice, often = NO_BITS, NO_BITS, NO_BITS
                for k in range(_ROUGH):
                    y = v + far[k, 1]
                    if y < 0 or y >= height:
                        continue
                    parts = here & _beside(carpet, y, at, far[k, 0])
                    if parts == NO_BITS:
                        continue
                    parts &= _beside(ball, v + rim[k, 1], at, rim[k, 0])
                    often |= twice & parts
                    twice |= once & parts
                    once |= parts
                here &= often
                while here != NO_BITS:
                    u = 64 * word + lowest(here)
                    here &= here - ONE
                    agree, shown, inside = measure_disc(kinds, float(u), float(v), radius)
                    is_disc = shown >= DIRECTIONS // 2 and agree >= _MIN_AGREE * shown
                    if is_disc and inside >= _MIN_INSIDE and found < len(out):
                        out[found, U], out[found, V], out[found, RADIUS] = u, v, radius
                        out[found, AGREE], out[found, INSIDE] = agree / shown, inside
                        found += 1
    return found


@compiled
def best_discs(kinds: UInt8Array, level: UInt8Array, found: FloatArray, out: FloatArray) -> int:
    """Keep the best of similar discs (N, COLUMNS) that overlap, fit their places and sizes, and measure their patches.

    Returns the number of those that it writes into `out` (M, COLUMNS). `kinds` and `level` (H, W) are from `classify`;
    the level is green, in which carpet is not dark.
    """
    # prefers larger discs slightly, because a disc within a ball agrees nearly as well
    score = np.empty(len(found))
    for n in range(len(found)):
        score[n] = found[n, AGREE] + found[n, INSIDE] + 0.003 * found[n, RADIUS]
    kept, tried = 0, np.empty((4 * len(out), 3))
    for n in range(len(tried)):
        best = int(np.argmax(score)) if len(score) else 0
        if len(score) == 0 or score[best] < 0.0:
            break
        tried[n, U], tried[n, V], tried[n, RADIUS] = found[best, U], found[best, V], found[best, RADIUS]
        for m in range(len(score)):
            far = _APART * max(found[m, RADIUS], tried[n, RADIUS])
            # a ball and the line that it touches look like a larger ball: other sizes stay, for later tests to decide
            size = max(found[m, RADIUS], tried[n, RADIUS]) / min(found[m, RADIUS], tried[n, RADIUS])
            if score[m] >= 0.0 and size < _OTHER_SIZE:
                if math.hypot(found[m, U] - tried[n, U], found[m, V] - tried[n, V]) < far:
                    score[m] = -1.0
        rough = measure_patches(kinds, level, tried[n, U], tried[n, V], tried[n, RADIUS])
        if rough[1] < _MIN_DARK:
            continue
        if kept == len(out):
            break
        _refine(kinds, tried[n], out[kept])
        row = out[kept]
        row[WHITE], row[DARK] = measure_patches(kinds, level, row[U], row[V], row[RADIUS])
        row[CARPET_LEVEL], row[AROUND] = _surroundings(kinds, level, row)
        kept += 1
    return kept


@compiled
def _refine(kinds: UInt8Array, start: FloatArray, out: FloatArray) -> None:
    """Write the best disc near a start, over small changes of place and size."""
    best = -1.0
    for k in range(5):
        radius = start[2] * (0.9 + 0.055 * k)
        step = max(0.12 * radius, 1.0)
        for i in range(-1, 2):
            for j in range(-1, 2):
                u, v = start[0] + step * i, start[1] + step * j
                agree, shown, inside = measure_disc(kinds, u, v, radius)
                if shown >= DIRECTIONS // 2 and agree / shown + inside > best + 1e-9:
                    best = agree / shown + inside
                    out[U], out[V], out[RADIUS], out[AGREE], out[INSIDE] = u, v, radius, agree / shown, inside
                    out[SHOWN] = shown / DIRECTIONS


@compiled
def _surroundings(kinds: UInt8Array, level: UInt8Array, row: FloatArray) -> tuple[float, float]:
    """Return the mean level of the carpet at a disc's rim, and the ratio of carpet farther out."""
    height, width = kinds.shape
    near = _OUTER * row[RADIUS] + _BEYOND_PX
    total, count, carpet, shown = 0.0, 0, 0, 0
    for k in range(DIRECTIONS):
        x, y = int(row[U] + near * _DIRECTIONS[k, 0] + 0.5), int(row[V] + near * _DIRECTIONS[k, 1] + 0.5)
        if 0 <= x < width and 0 <= y < height and kinds[y, x] == CARPET:
            total += level[y, x]
            count += 1
        for ratio in _AROUND:
            far = ratio * row[RADIUS]
            x, y = int(row[U] + far * _DIRECTIONS[k, 0] + 0.5), int(row[V] + far * _DIRECTIONS[k, 1] + 0.5)
            if 0 <= x < width and 0 <= y < height:
                shown += 1
                carpet += kinds[y, x] == CARPET
    return total / max(count, 1), carpet / max(shown, 1)


@compiled
def measure_patches(kinds: UInt8Array, level: UInt8Array, u: float, v: float, radius: float) -> tuple[float, float]:
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
        if k < _MAX_DARK * white:
            dark += bins[k]
    return white, dark / count
