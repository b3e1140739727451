"""Leaves out candidates for the side of a post or beacon that are the outline of a robot before it.

A dark robot before a bright wall shows steps like those of a white post, as straight and as strong. But a post ends at
its foot: below it there is carpet, while the outline of a nearer robot goes on.
"""

from __future__ import annotations

import math

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.model_edges.tables import EDGE, UPRIGHT, Buffers, UInt8Array

MIN_ACROSS = 0.8  # of a side's normal, along the rows: bars and rings lie level
# of a step: pixels on each side, and rows above and below; how far beside a candidate it may go on, as no border is
# quite upright
INNER_PX, ROWS, BESIDE_PX = 2, 1, 2
# of the candidate's step, what goes on; and of the carpet's noise, the least
MIN_PART, MIN_NOISES = 0.3, 3.0
APART_PX = 5.0  # between the two places below a foot that are looked at


@compiled(fastmath=True, error_model="numpy")
def _step(image: UInt8Array, u: float, v: float) -> float:
    """Greatest step of the three colours across column u at row v; -1 where it is not all in the picture."""
    column, row = int(math.floor(u + 0.5)), int(math.floor(v + 0.5))
    inside = column >= INNER_PX and column + INNER_PX <= image.shape[1]
    if not inside or row < ROWS or row + ROWS >= image.shape[0]:
        return -1.0
    greatest = 0.0
    for c in range(3):
        difference = 0.0
        for y in range(row - ROWS, row + ROWS + 1):
            for x in range(INNER_PX):
                difference += float(image[y, column + x, c]) - float(image[y, column - 1 - x, c])
        greatest = max(greatest, abs(difference))
    return greatest / (INNER_PX * (2 * ROWS + 1))


@compiled(fastmath=True, error_model="numpy")
def _goes_on(image: UInt8Array, u: float, v: float, least: float) -> bool:
    """Whether such a step is at a place or a little beside it."""
    for beside in range(-BESIDE_PX, BESIDE_PX + 1):
        if _step(image, u + beside, v) >= least:
            return True
    return False


@compiled(fastmath=True, error_model="numpy")
def leave_out_borders(image: UInt8Array, noise: float, clear_px: float, buffers: Buffers, count: int) -> None:
    """Drop the candidates of upright sides that go on below the foot.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    noise : float
        Of the carpet.
    clear_px : float
        How far a foot may be from where it is predicted.
    buffers : Buffers
        Its samples, `count` of them, and what was found at them.
    count : int
        Samples.
    """
    samples, found = buffers.samples, buffers.found
    for n in range(count):
        nu, nv = samples.normal[n, 0], samples.normal[n, 1]
        if samples.place[n] != UPRIGHT or samples.kind[n] != EDGE or abs(nu) < MIN_ACROSS or found.candidates[n] < 1:
            continue
        per_m = math.sqrt(samples.jacobian[n, 0] ** 2 + samples.jacobian[n, 1] ** 2 + samples.jacobian[n, 5] ** 2)
        down_u, down_v = (-nv, nu) if nu > 0.0 else (nv, -nu)
        foot_px = samples.point_m[n, 2] * per_m
        kept = 0
        for k in range(found.candidates[n]):
            offset = found.offset_px[n, k]
            u, v = samples.uv[n, 0] + nu * offset, samples.uv[n, 1] + nv * offset
            least = max(MIN_PART * _step(image, u, v), MIN_NOISES * noise)
            is_border = True
            for place in range(2):
                below = foot_px + clear_px + place * APART_PX
                is_border = is_border and _goes_on(image, u + down_u * below, v + down_v * below, least)
            if is_border:
                continue
            found.offset_px[n, kept], found.strength[n, kept] = offset, found.strength[n, k]
            kept += 1
        found.candidates[n] = kept
