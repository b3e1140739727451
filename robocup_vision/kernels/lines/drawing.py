"""Field lines drawn as a pinhole camera shows them: thinner than a pixel, blurred, light adding up where they meet.

Drawings have a margin of `MARGIN` pixels around the picture, so that no stroke need be cut. They are zero where nothing
is drawn, and those who use one clear the rows that hold paint.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera

MARGIN = 4
AROUND = 2 * MARGIN + 1  # side of the square whose mean light is taken off
_ALONG_PX, _ACROSS_PX = 1.2, 0.8  # between strokes: along a line blur leaves no gap even there
_REACH = 2
_WIDE = 2 * _REACH + 1
_PARTS = 64  # of a pixel, for which strokes are made in advance

_SUMS = {"reassoc", "nsz", "contract"}


class LinePen(NamedTuple):
    """What is drawn, and how.

    Parameters
    ----------
    points : (N, 2) float64
        Along the lines, one line after the other, field frame, metres.
    starts : (L + 1,) int64
        Each line's first point, and N.
    width_m : float
        Of the paint.
    strokes : (P, 5) float32
        See `stroke_table`.
    """

    points: FloatArray
    starts: Int64Array
    width_m: float
    strokes: Float32Array


class LitCarpet(NamedTuple):
    """What a drawing is compared with, (H, W) float32 each.

    Parameters
    ----------
    on : (H, W) float32
        1 on carpet, else 0.
    share : (H, W) float32
        Of a sum over the square around a pixel that makes it a mean over the carpet there.
    light : (H, W) float32
        Light over that of the carpet nearby, 0 off the carpet.
    """

    on: Float32Array
    share: Float32Array
    light: Float32Array


def stroke_table(blur_px: float) -> Float32Array:
    """Make light (65, 5) in five pixels of strokes from half a pixel left to half a pixel right of the middle one.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the picture's blur, the pixel's own size included.
    """
    off = np.arange(_PARTS + 1)[:, None] / _PARTS - 0.5
    at = np.arange(-_REACH, _REACH + 1)
    return np.asarray(np.exp(-0.5 * ((at - off) / blur_px) ** 2) / (math.sqrt(math.tau) * blur_px), np.float32)


@compiled(fastmath={"contract"})
def _draw_stroke(strokes: Float32Array, u: float, v: float, weight: float, drawing: Float32Array) -> None:
    """Add one stroke at a place in the drawing, margin included, at least `_REACH` pixels inside it."""
    iu, iv = int(u + 0.5), int(v + 0.5)
    at_u, at_v = (u - iu + 0.5) * _PARTS, (v - iv + 0.5) * _PARTS
    ku, kv = min(max(int(at_u), 0), _PARTS - 1), min(max(int(at_v), 0), _PARTS - 1)
    fu, fv = np.float32(at_u - ku), np.float32(at_v - kv)
    light = np.float32(weight)
    s0 = strokes[ku, 0] + fu * (strokes[ku + 1, 0] - strokes[ku, 0])
    s1 = strokes[ku, 1] + fu * (strokes[ku + 1, 1] - strokes[ku, 1])
    s2 = strokes[ku, 2] + fu * (strokes[ku + 1, 2] - strokes[ku, 2])
    s3 = strokes[ku, 3] + fu * (strokes[ku + 1, 3] - strokes[ku, 3])
    s4 = strokes[ku, 4] + fu * (strokes[ku + 1, 4] - strokes[ku, 4])
    left = iu - _REACH
    for j in range(_WIDE):
        row = iv + j - _REACH
        side = light * (strokes[kv, j] + fv * (strokes[kv + 1, j] - strokes[kv, j]))
        drawing[row, left] += side * s0
        drawing[row, left + 1] += side * s1
        drawing[row, left + 2] += side * s2
        drawing[row, left + 3] += side * s3
        drawing[row, left + 4] += side * s4


@compiled
def draw_lines(
    pen: LinePen, first: int, last: int, view: FloatArray, p: FloatArray, first_row: int, drawing: Float32Array
) -> tuple[int, int, int, int]:
    """Draw lines into a picture of the fraction of paint in each pixel, 0 to 1.

    Parameters
    ----------
    pen : LinePen
        What and how.
    first, last : int
        Lines that are drawn: from the first to before the last.
    view, p
        See `kernels.goal.picture.predict_goal`.
    first_row : int
        Of the image, that the picture begins with.
    drawing : (H + 2 MARGIN, W + 2 MARGIN) float32
        Where paint is added.

    Returns
    -------
    (int, int, int, int)
        First row and column of the drawing that may hold paint, and the first ones after it.
    """
    points = pen.points
    height, width = drawing.shape
    axes = camera_axes(p[2], p[3], p[4])
    (r00, r01, r02), (r10, r11, r12), _ = axes
    fu, fv = view[0] * math.exp(p[6]), view[1] * math.exp(p[6])
    middle_u, middle_v = view[2] + MARGIN, view[3] + MARGIN - first_row
    z = -p[5]
    low, high_u, high_v = float(_REACH), width - _REACH - 1.0, height - _REACH - 1.0
    least_u, least_v, most_u, most_v = 1e9, 1e9, -1e9, -1e9
    for line in range(first, last):
        is_before = False
        before_u, before_v = 0.0, 0.0
        end = pen.starts[line + 1]
        for k in range(pen.starts[line], end):
            depth, left, up = in_camera(axes, points[k, 0] - p[0], points[k, 1] - p[1], z)
            if depth < 0.1:
                is_before = False
                continue
            u, v = ideal_pixel(fu, fv, middle_u, middle_v, depth, left, up)
            from_u, from_v, is_first = before_u, before_v, not is_before
            before_u, before_v, is_before = u, v, True
            length = math.hypot(u - from_u, v - from_v)
            if (
                is_first
                or length < 1e-6
                or max(u, from_u) < 0.0
                or min(u, from_u) > width
                or max(v, from_v) < 0.0
                or min(v, from_v) > height
            ):
                continue
            # seen width, from a step across on the floor at the segment's end
            dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
            length_m = math.hypot(dx, dy)
            nx, ny = -dy / length_m, dx / length_m
            a, b = (middle_u - u) / fu, (middle_v - v) / fv
            across_u = -fu * (nx * (r01 - a * r00) + ny * (r11 - a * r10)) / depth
            across_v = -fv * (nx * (r02 - b * r00) + ny * (r12 - b * r10)) / depth
            wide = abs(across_u * (v - from_v) - across_v * (u - from_u)) / length * pen.width_m
            steps, strokes = int(length / _ALONG_PX) + 1, int(wide / _ACROSS_PX) + 1
            weight = wide / strokes * length / steps
            for s in range(strokes):
                off = ((s + 0.5) / strokes - 0.5) * pen.width_m
                for i in range(steps):
                    t = (i + 0.5) / steps
                    cu = from_u + t * (u - from_u) + off * across_u
                    cv = from_v + t * (v - from_v) + off * across_v
                    if cu >= low and cu < high_u and cv >= low and cv < high_v:
                        _draw_stroke(pen.strokes, cu, cv, weight, drawing)
                        least_u, most_u = min(least_u, cu), max(most_u, cu)
                        least_v, most_v = min(least_v, cv), max(most_v, cv)
    if most_v < least_v:
        return 0, 0, 0, 0
    return (
        int(least_v + 0.5) - _REACH,
        int(least_u + 0.5) - _REACH,
        int(most_v + 0.5) + _REACH + 1,
        int(most_u + 0.5) + _REACH + 1,
    )


@compiled
def _reflected(at: int, count: int) -> int:
    """Index of a place beyond a row of at least `MARGIN` + 1, reflected about its end."""
    if at < 0:
        return -at
    return at if at < count else 2 * (count - 1) - at


@compiled
def _add_light(
    frame: UInt8Array, carpet: UInt8Array, row: int, sign: int, counts: Int32Array, lights: Int32Array
) -> None:
    for u in range(carpet.shape[1]):
        if carpet[row, u]:
            counts[MARGIN + u] += sign
            lights[MARGIN + u] += sign * min(frame[row, u, 0], frame[row, u, 2])


@compiled
def light_carpet(frame: UInt8Array, carpet: UInt8Array, max_levels: float, lit: LitCarpet) -> tuple[int, float]:
    """Measure the light of a carpet over that of the carpet nearby.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    carpet : (H, W) uint8
        Non-zero on carpet; H is greater than `MARGIN`.
    max_levels : float
        Grey levels over the mean that count, and below it.
    lit : LitCarpet
        Result.

    Returns
    -------
    (int, float)
        Pixels of carpet, and the sum of the squared light.
    """
    height, width = carpet.shape
    counts, lights = np.zeros(width + 2 * MARGIN, np.int32), np.zeros(width + 2 * MARGIN, np.int32)
    least = np.float32(1e-3 * AROUND**2)
    pixels, square = variable(0), 0.0
    for other in range(-MARGIN, MARGIN):
        _add_light(frame, carpet, _reflected(other, height), variable(1), counts, lights)
    for row in range(height):
        _add_light(frame, carpet, _reflected(row + MARGIN, height), variable(1), counts, lights)
        for m in range(1, MARGIN + 1):
            for sums in (counts, lights):
                sums[MARGIN - m] = sums[MARGIN + m]
                sums[MARGIN + width - 1 + m] = sums[MARGIN + width - 1 - m]
        count, light = variable(0), variable(0)
        for u in range(2 * MARGIN):
            count += counts[u]
            light += lights[u]
        for u in range(width):
            count += counts[u + 2 * MARGIN]
            light += lights[u + 2 * MARGIN]
            share = np.float32(1.0) / max(np.float32(count), least)
            is_on = carpet[row, u] > 0
            over = 0.0
            if is_on:
                over = min(frame[row, u, 0], frame[row, u, 2]) - light * share
                over = min(max(over, -max_levels), max_levels)
                pixels += 1
                square += over * over
            lit.on[row, u], lit.share[row, u], lit.light[row, u] = np.float32(is_on), share, over
            count -= counts[u]
            light -= lights[u]
        _add_light(frame, carpet, _reflected(row - MARGIN, height), variable(-1), counts, lights)
    return pixels, square


@compiled(fastmath=_SUMS)
def _add_row(drawing: Float32Array, on: Float32Array, row: int, sign: float, sums: Float32Array) -> None:
    factor = np.float32(sign)
    for u in range(on.shape[1]):
        sums[MARGIN + u] += factor * on[row, u] * drawing[row + MARGIN, u + MARGIN]


@compiled(fastmath=_SUMS)
def _level_row(
    sums: Float32Array, drawn: Float32Array, on: Float32Array, share: Float32Array, level: Float32Array
) -> None:
    for u in range(on.shape[0]):
        around = sums[u] + sums[u + 1] + sums[u + 2] + sums[u + 3] + sums[u + 4]
        around += sums[u + 5] + sums[u + 6] + sums[u + 7] + sums[u + 8]
        level[u] = (drawn[u + MARGIN] - around * share[u]) * on[u]


@compiled(fastmath=_SUMS)
def _sum_row(level: Float32Array, light: Float32Array) -> tuple[float, float]:
    own, both = np.float32(0.0), np.float32(0.0)
    for u in range(level.shape[0]):
        own += level[u] * level[u]
        both += level[u] * light[u]
    return float(own), float(both)


@compiled
def _level_next(
    carpet: LitCarpet, drawing: Float32Array, row: int, begin: int, sums: Float32Array, level: Float32Array
) -> None:
    """Levels (W,) of a drawing over the mean nearby, in the row after the one before, from row `begin` on.

    `sums` (W + 2 MARGIN,) goes on from row to row.
    """
    on = carpet.on
    height, width = on.shape
    if row == begin:
        sums[:] = 0.0
        for other in range(row - MARGIN, row + MARGIN):
            _add_row(drawing, on, _reflected(other, height), 1.0, sums)
    else:
        _add_row(drawing, on, _reflected(row - MARGIN - 1, height), -1.0, sums)
    _add_row(drawing, on, _reflected(row + MARGIN, height), 1.0, sums)
    for m in range(1, MARGIN + 1):
        sums[MARGIN - m] = sums[MARGIN + m]
        sums[MARGIN + width - 1 + m] = sums[MARGIN + width - 1 - m]
    _level_row(sums, drawing[row + MARGIN], on[row], carpet.share[row], level)


@compiled
def compare_drawing(
    carpet: LitCarpet, pen: LinePen, view: FloatArray, p: FloatArray, first_row: int, drawing: Float32Array
) -> tuple[float, float]:
    """Draw all lines, less the mean nearby, and sum the drawing's squares, and its products with the light.

    Parameters
    ----------
    carpet : LitCarpet
        What the drawing is compared with.
    pen, view, p, first_row, drawing
        See `draw_lines`; the drawing is zero before and after.

    Returns
    -------
    (float, float)
        Squares, and products.
    """
    top, _, bottom, _ = draw_lines(pen, variable(0), pen.starts.shape[0] - 1, view, p, first_row, drawing)
    height, width = carpet.on.shape
    sums, level = np.empty(width + 2 * MARGIN, np.float32), np.empty(width, np.float32)
    own, both = 0.0, 0.0
    # rows of the picture: of the drawing, less its margin, and as far as the square reaches
    begin = max(0, top - 2 * MARGIN)
    for row in range(begin, min(height, bottom)):
        _level_next(carpet, drawing, row, begin, sums, level)
        of_row, with_light = _sum_row(level, carpet.light[row])
        own += of_row
        both += with_light
    drawing[top:bottom, :] = 0.0
    return own, both


@compiled
def compare_each_line(
    carpet: LitCarpet,
    pen: LinePen,
    view: FloatArray,
    p: FloatArray,
    first_row: int,
    drawing: Float32Array,
    sums: FloatArray,
) -> None:
    """Part the sums of `compare_drawing` by lines: over the pixels in which each makes more than half of the paint.

    Parameters
    ----------
    carpet, pen, view, p, first_row, drawing
        See `compare_drawing`.
    sums : (2, L) float64
        Results: squares and products.
    """
    lines = pen.starts.shape[0] - 1
    top, _, bottom, _ = draw_lines(pen, variable(0), lines, view, p, first_row, drawing)
    height, width = carpet.on.shape
    levels, whole = np.zeros((height, width), np.float32), drawing.copy()
    around = np.empty(width + 2 * MARGIN, np.float32)
    begin = max(0, top - 2 * MARGIN)
    for row in range(begin, min(height, bottom)):
        _level_next(carpet, drawing, row, begin, around, levels[row])
    drawing[top:bottom, :] = 0.0
    for line in range(lines):
        top, left, bottom, right = draw_lines(pen, line, line + 1, view, p, first_row, drawing)
        own, both = 0.0, 0.0
        for row in range(max(top - MARGIN, 0), min(bottom - MARGIN, height)):
            for u in range(max(left - MARGIN, 0), min(right - MARGIN, width)):
                if drawing[row + MARGIN, u + MARGIN] > np.float32(0.5) * whole[row + MARGIN, u + MARGIN]:
                    own += levels[row, u] * levels[row, u]
                    both += levels[row, u] * carpet.light[row, u]
        drawing[top:bottom, left:right] = 0.0
        sums[0, line], sums[1, line] = own, both


@compiled(fastmath=_SUMS)
def _products(first: Float32Array, second: Float32Array, third: Float32Array, fourth: Float32Array) -> float:
    total = np.float32(0.0)
    for u in range(first.shape[0]):
        total += (second[u] - first[u]) * (fourth[u] - third[u])
    return float(total)


@compiled
def move_drawings(
    pen: LinePen,
    view: FloatArray,
    cameras: FloatArray,
    first_row: int,
    drawings: Float32Array,
    products: FloatArray,
) -> float:
    """Draw lines for pairs of cameras, and sum the products of what changes from the first to the second of each.

    Parameters
    ----------
    pen, view, first_row
        See `draw_lines`.
    cameras : (2 K, 8) float64
        Pairs, one after the other.
    drawings : (2 K, H + 2 MARGIN, W + 2 MARGIN) float32
        Results, zero before.
    products : (K, K) float64
        Results: sums over the picture.

    Returns
    -------
    float
        Sum of the squared slopes of the first drawing.
    """
    height, width = drawings.shape[1] - 2 * MARGIN, drawings.shape[2] - 2 * MARGIN
    begin, end = height, 0
    for k in range(cameras.shape[0]):
        top, _, bottom, _ = draw_lines(
            pen, variable(0), pen.starts.shape[0] - 1, view, cameras[k], first_row, drawings[k]
        )
        if bottom > top:
            begin, end = min(begin, max(top, MARGIN)), max(end, min(bottom, height + MARGIN))
    steepness = 0.0
    products[:, :] = 0.0
    for row in range(begin, end):
        own = drawings[0, row, MARGIN : width + MARGIN]
        steepness += _products(own[:-1], own[1:], own[:-1], own[1:])
        if row + 1 < height + MARGIN:
            below = drawings[0, row + 1, MARGIN : width + MARGIN]
            steepness += _products(own, below, own, below)
        for i in range(products.shape[0]):
            for j in range(i + 1):
                products[i, j] += _products(
                    drawings[2 * i, row, MARGIN : width + MARGIN],
                    drawings[2 * i + 1, row, MARGIN : width + MARGIN],
                    drawings[2 * j, row, MARGIN : width + MARGIN],
                    drawings[2 * j + 1, row, MARGIN : width + MARGIN],
                )
    if begin > MARGIN and begin < end:  # the step down into the first row that holds paint
        above, own = drawings[0, begin - 1, MARGIN : width + MARGIN], drawings[0, begin, MARGIN : width + MARGIN]
        steepness += _products(above, own, above, own)
    for i in range(products.shape[0]):
        for j in range(i):
            products[j, i] = products[i, j]
    return steepness
