"""Compiled radius at each bearing and moments of the convex hull of the floor."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


@compiled
def hull_radius(cos_b: FloatArray, sin_b: FloatArray, radius: FloatArray, out: FloatArray) -> int:
    """Write the image radius (K,) of the convex hull of the points (bearing, radius) at every bearing.

    `radius` is NaN for bearings without a point. Returns the number of bearings with points.
    """
    count = radius.shape[0]
    stack = np.empty(count + 1, np.int64)
    farthest, top, known = -1, 0, 0
    for k in range(count):
        if radius[k] > 0:
            known += 1
            if farthest < 0 or radius[k] > radius[farthest]:
                farthest = k
    if known < 3:
        return known
    for step in range(count + 1):
        k = (farthest + step) % count
        if not radius[k] > 0:
            continue
        x, y = radius[k] * cos_b[k], radius[k] * sin_b[k]
        while top >= 2:
            a, b = stack[top - 2], stack[top - 1]
            ax, ay = radius[a] * cos_b[a], radius[a] * sin_b[a]
            bx, by = radius[b] * cos_b[b], radius[b] * sin_b[b]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            top -= 1
        stack[top] = k
        top += 1
    for i in range(top - 1):
        a, b = stack[i], stack[i + 1]
        ax, ay = radius[a] * cos_b[a], radius[a] * sin_b[a]
        dx, dy = radius[b] * cos_b[b] - ax, radius[b] * sin_b[b] - ay
        span = (b - a) % count
        if span == 0:
            span = count
        for step in range(span + 1):
            k = (a + step) % count
            across = cos_b[k] * dy - sin_b[k] * dx
            out[k] = (ax * dy - ay * dx) / across if across > 1e-9 else radius[a]
    return known


@compiled
def star_moments(cos_b: FloatArray, sin_b: FloatArray, range_m: FloatArray) -> tuple[float, float, float]:
    """Return centroid x, y and the principal axis' direction of the star-shaped polygon of points (bearing, range)."""
    area, mx, my, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = range_m.shape[0]
    for k in range(count):
        n = (k + 1) % count
        x0, y0 = range_m[k] * cos_b[k], range_m[k] * sin_b[k]
        x1, y1 = range_m[n] * cos_b[n], range_m[n] * sin_b[n]
        cross = x0 * y1 - x1 * y0
        area += cross / 2
        mx += cross * (x0 + x1) / 6
        my += cross * (y0 + y1) / 6
        sxx += cross * (x0 * x0 + x0 * x1 + x1 * x1) / 12
        syy += cross * (y0 * y0 + y0 * y1 + y1 * y1) / 12
        sxy += cross * (2 * x0 * y0 + x0 * y1 + x1 * y0 + 2 * x1 * y1) / 24
    mx, my = mx / area, my / area
    sxx, syy, sxy = sxx / area - mx * mx, syy / area - my * my, sxy / area - mx * my
    return mx, my, 0.5 * math.atan2(2 * sxy, sxx - syy)


@compiled
def hull_moments(
    cos_b: FloatArray, sin_b: FloatArray, radius: FloatArray, first_px: float, step_px: float, q_of_radius: FloatArray
) -> tuple[int, float, float, float]:
    """Return moments of the floor inside the convex hull, taken in the image, of the points (bearing, radius).

    `q_of_radius` tabulates the inverse range from image radius `first_px` in steps of `step_px`. Returns the number of
    bearings with points, and the centroid x, y and the direction of the principal axis of the hull on the floor.
    """
    count = radius.shape[0]
    hull = np.empty(count)
    known = hull_radius(cos_b, sin_b, radius, hull)
    if known < 3:
        return known, 0.0, 0.0, 0.0
    last = q_of_radius.shape[0] - 1.001
    for k in range(count):
        place = max(0.0, min(last, (hull[k] - first_px) / step_px))
        cell = int(place)
        hull[k] = 1.0 / (q_of_radius[cell] + (place - cell) * (q_of_radius[cell + 1] - q_of_radius[cell]))
    x, y, axis = star_moments(cos_b, sin_b, hull)
    return known, x, y, axis
