"""Compiled: the fraction of a patch of floor covered by a painted line or arc, and whether a point is on the carpet."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

_ZERO, _HALF, _LEAST = np.float32(0.0), np.float32(0.5), np.float32(1e-6)


SHADE_REACH = 3.0  # reach of a ball's shade on the floor, in its radii


@compiled(inline="always")
def overlap(offset: np.float32, half: np.float32, size: np.float32) -> np.float32:
    """Return the fraction of an interval of `size` around `offset` that lies within `half` of 0."""
    reach = max(size, _LEAST) * _HALF
    covered = min(offset + reach, half) - max(offset - reach, -half)
    return max(covered, _ZERO) / (reach + reach)


@compiled(inline="always")
def share_of_line(
    off_x: np.float32,
    off_y: np.float32,
    line: tuple[np.float32, np.float32, np.float32, np.float32],
    along_ray: np.float32,
    across_ray: np.float32,
    radial: np.float32,
    tangential: np.float32,
) -> np.float32:
    """Return the painted fraction of a rectangular patch that a straight line covers.

    Parameters
    ----------
    off_x, off_y : float32
        Middle of the patch relative to that of the line, metres.
    line : (float32, float32, float32, float32)
        Unit direction x, y, half the length, half the width of the line.
    along_ray, across_ray : float32
        Absolute cosine and sine of the angle between the line and the patch's radial sides.
    radial, tangential : float32
        Size of the patch, metres.
    """
    t_x, t_y, long, half = line
    covered = overlap(off_x * t_y - off_y * t_x, half, across_ray * radial + along_ray * tangential)
    size = along_ray * radial + across_ray * tangential
    return covered * overlap(off_x * t_x + off_y * t_y, long + half, size)


@compiled(inline="always")
def share_of_arc(
    off_x: np.float32,
    off_y: np.float32,
    arc: tuple[np.float32, np.float32, np.float32, np.float32, np.float32],
    cos: np.float32,
    sin: np.float32,
    radial: np.float32,
    tangential: np.float32,
) -> np.float32:
    """Return the painted fraction of a rectangular patch that an arc covers.

    Parameters
    ----------
    off_x, off_y : float32
        Middle of the patch relative to the arc's centre, metres.
    arc : (float32, float32, float32, float32, float32)
        Radius, unit direction x, y of the arc's middle, cosine of half the sweep, half the width.
    cos, sin : float32
        Unit direction of the patch's radial sides.
    radial, tangential : float32
        Size of the patch, metres.
    """
    radius, aim_x, aim_y, sweep, half = arc
    away = max(np.float32(math.sqrt(off_x * off_x + off_y * off_y)), _LEAST)
    across = abs(cos * off_x + sin * off_y) * radial + abs(cos * off_y - sin * off_x) * tangential
    covered = overlap(away - radius, half, across / away)
    return covered if off_x * aim_x + off_y * aim_y >= away * sweep else _ZERO


@compiled(inline="always")
def light_beside_ball(away2: np.float32, per_radius2: np.float32) -> np.float32:
    """Return the fraction of the light that a ball's shade leaves on the floor at a squared distance from it."""
    return np.float32(1.0) - np.float32(0.55) * np.float32(math.exp(-away2 * per_radius2))


@compiled(error_model="numpy")
def is_inside(edges: FloatArray, x_m: float, y_m: float) -> bool:
    """Return whether a point lies inside a polygon, (K, 4) float64: x0, y0, x1, y1 of its edges."""
    inside = False
    for k in range(len(edges)):
        x0, y0, x1, y1 = edges[k]
        if (y0 > y_m) != (y1 > y_m) and x_m < x0 + (y_m - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return inside
