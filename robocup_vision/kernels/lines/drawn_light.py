"""Compiled comparison of drawn lines with the light of the carpet, relative to the mean light nearby."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, draw_lines

AROUND = 2 * MARGIN + 1  # side of the square whose mean light is taken off

_SUMS = {"reassoc", "nsz", "contract"}


class LitCarpet(NamedTuple):
    """Light of the carpet with which drawings are compared, (H, W) float32 each.

    Parameters
    ----------
    on : (H, W) float32
        1 on carpet, else 0.
    share : (H, W) float32
        Factor that makes a sum over the square around a pixel a mean over the carpet in it.
    light : (H, W) float32
        Light minus the mean light of the carpet nearby; 0 off the carpet.
    """

    on: Float32Array
    share: Float32Array
    light: Float32Array


@compiled
def _reflected(at: int, count: int) -> int:
    """Return an index beyond the end of a row of at least `MARGIN` + 1 pixels, reflected about that end."""
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
def light_carpet(frame: UInt8Array, carpet: UInt8Array, lit: LitCarpet) -> tuple[int, float]:
    """Measure the light of a carpet relative to the mean nearby.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        BGR.
    carpet : (H, W) uint8
        Non-zero on carpet; H is greater than `MARGIN`.
    lit : LitCarpet
        Filled.

    Returns
    -------
    (int, float)
        Number of pixels of carpet, and the sum of their squared light.
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
    """Write the levels (W,) of a drawing relative to the mean nearby, of the next row; `begin` is the first row.

    `sums` (W + 2 MARGIN,) is updated from row to row.
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
    """Draw all lines relative to the mean nearby; sum the squares of the drawing and its products with the light.

    Parameters
    ----------
    carpet : LitCarpet
        Light of the carpet.
    pen, view, p, first_row, drawing
        See `draw_lines`; the drawing is zero before and after.

    Returns
    -------
    (float, float)
        Sum of squares, and sum of products.
    """
    top, bottom = draw_lines(pen, view, p, first_row, drawing)
    height, width = carpet.on.shape
    sums, level = np.empty(width + 2 * MARGIN, np.float32), np.empty(width, np.float32)
    own, both = 0.0, 0.0
    # rows of the picture that the square around a stroke reaches
    begin = max(0, top - 2 * MARGIN)
    for row in range(begin, min(height, bottom)):
        _level_next(carpet, drawing, row, begin, sums, level)
        of_row, with_light = _sum_row(level, carpet.light[row])
        own += of_row
        both += with_light
    drawing[top:bottom, :] = 0.0
    return own, both
