"""A forward camera's lens in compiled code: slopes to distorted slopes, with derivatives, and pixels back to slopes.

A lens is one row of numbers, whatever its model: `camera.lens_table` writes it. Its radial part is a table over the
cosine of the angle off the axis. There g = (image radius) / sin(angle) is smooth for every model, on the axis as well.
A slope is how far right or down a ray goes for each unit ahead.
"""

from __future__ import annotations

import math

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# places in the row: focal length and centre along u and v, the picture's size, whether the lens distorts, OpenCV's p1
# and p2, the greatest squared slope, the picture's greatest slopes right and down
BENT, P1, P2, MAX_SLOPE2, WIDE, TALL = 6, 7, 8, 9, 10, 11
# the cosine at which the table begins, its cells for each unit of cosine, and those of the inverse for each unit of
# squared image radius
LOWEST_COSINE, PER_COSINE, PER_RADIUS2 = 12, 13, 14
# then CELLS cells of a cubic of g; INVERSE_CELLS cells of cubics of the cosine, and of sin(angle) / (image radius)
FORWARD, CELLS, INVERSE_CELLS = 15, 64, 128
INVERSE = FORWARD + 4 * CELLS
LENGTH = INVERSE + 8 * INVERSE_CELLS


@compiled(fastmath=True, error_model="numpy")
def distorted(lens: FloatArray, a: float, b: float) -> tuple[float, float, float, float, float, float]:
    """Distort slopes; also the derivative, row by row. Not for slopes beyond the greatest."""
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
def slopes_at(lens: FloatArray, u: float, v: float) -> tuple[float, float]:
    """Return the slopes that a pixel shows, by the radial part of the lens alone."""
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
