"""A camera's lens or mirror in compiled code: slopes to distorted slopes, with derivatives, and pixels back to slopes.

A lens is one row of numbers for all models, written by `camera.lens_table`. Its radial part is a table over the cosine
of the angle off the axis, of g = (image radius) / sin(angle), which is smooth for every model, also on the axis.
A ray's slopes are its components to the right and down, divided by its component ahead.
"""

from __future__ import annotations

import math

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# columns of the row; those before BENT are focal length and centre along u and v, and the picture's size. BENT: whether
# the lens distorts. P1, P2: of OpenCV. MAX_SLOPE2: greatest squared slope. WIDE, TALL: greatest slopes right and down
BENT, P1, P2, MAX_SLOPE2, WIDE, TALL = 6, 7, 8, 9, 10, 11
# cosine at which the table begins, cells for each unit of cosine, and cells of the inverse for each unit of squared
# image radius
LOWEST_COSINE, PER_COSINE, PER_RADIUS2 = 12, 13, 14
# rotation from the camera's axes to those of its mounting, by rows: tilt and roll are of the mounting
MOUNT = 15
# a cell of the table holds a cubic of g; a cell of the inverse holds cubics of cosine and of sin(angle) / (image
# radius)
FORWARD, CELLS, INVERSE_CELLS = 24, 64, 128
INVERSE = FORWARD + 4 * CELLS
LENGTH = INVERSE + 8 * INVERSE_CELLS


@compiled(fastmath=True, error_model="numpy")
def distorted(lens: FloatArray, a: float, b: float) -> tuple[float, float, float, float, float, float]:
    """Return distorted slopes and their derivatives, row by row. The slopes must be within the greatest slope."""
    if lens[BENT] == 0.0:
        return a, b, 1.0, 0.0, 0.0, 1.0
    p1, p2 = lens[P1], lens[P2]
    r2 = a * a + b * b
    cosine = 1.0 / math.sqrt(1.0 + r2)
    place = (cosine - lens[LOWEST_COSINE]) * lens[PER_COSINE]
    cell = int(min(max(place, 0.0), CELLS - 1.0))
    t, at = place - cell, FORWARD + 4 * cell
    c1, c2, c3 = lens[at + 1], lens[at + 2], lens[at + 3]
    g = lens[at] + t * (c1 + t * (c2 + t * c3))
    dg = (c1 + t * (2.0 * c2 + t * 3.0 * c3)) * lens[PER_COSINE]
    f = g * cosine
    df = -0.5 * cosine * cosine * cosine * (dg * cosine + g)
    x = a * f + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
    y = b * f + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
    xa = f + 2.0 * a * a * df + 2.0 * p1 * b + 6.0 * p2 * a
    xb = 2.0 * a * b * df + 2.0 * p1 * a + 2.0 * p2 * b
    yb = f + 2.0 * b * b * df + 6.0 * p1 * b + 2.0 * p2 * a
    return x, y, xa, xb, xb, yb


@compiled(fastmath=True, error_model="numpy")
def is_in_lens(lens: FloatArray, u: float, v: float) -> bool:
    """Whether a pixel lies in the circle that the lens fills, as far as its slopes are useful."""
    if lens[BENT] == 0.0:
        return True
    x, y = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    return bool((x * x + y * y) * lens[PER_RADIUS2] <= INVERSE_CELLS)


@compiled(fastmath=True, error_model="numpy")
def slopes_at(lens: FloatArray, u: float, v: float) -> tuple[float, float]:
    """Return the slopes of a pixel's ray. Tangential distortion is neglected."""
    x, y = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    if lens[BENT] == 0.0:
        return x, y
    place = min((x * x + y * y) * lens[PER_RADIUS2], INVERSE_CELLS - 1e-6)
    cell = int(place)
    t, at = place - cell, INVERSE + 8 * cell
    cosine = lens[at] + t * (lens[at + 1] + t * (lens[at + 2] + t * lens[at + 3]))
    scale = lens[at + 4] + t * (lens[at + 5] + t * (lens[at + 6] + t * lens[at + 7]))
    scale /= max(cosine, 1e-3)
    return x * scale, y * scale
