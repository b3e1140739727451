"""Compiled fit of the whole ball of which a picture shows a part."""

from __future__ import annotations

import math

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.balls.blobs import BallSize

# points over a disc, so many along its diameter, and how often it is moved until its part in the picture fits
_ACROSS, _STEPS = 33, 12


@compiled
def fit_cut_ball(u: float, v: float, width: int, height: int, size: BallSize) -> tuple[float, float, float]:
    """Fit the whole ball of which the picture shows a part: its part is moved onto the one that is seen.

    Parameters
    ----------
    u, v : float
        Centre of the part.
    width, height : int
        Of the picture.
    size : BallSize
        What a ball looks like; may be plain.

    Returns
    -------
    u, v : float
        Centre of the whole ball.
    ratio : float
        Of it that the picture shows.
    """
    size = BallSize(*size)
    center_u, center_v, ratio = u, v, 1.0
    last, middle = len(size.along_px) - 1, _ACROSS // 2
    for _ in range(_STEPS):
        ray_u, ray_v = center_u - size.axis_u, center_v - size.axis_v
        radius = math.hypot(ray_u, ray_v)
        index = min(int(round(radius)), last)
        ray_u, ray_v = ray_u / max(radius, 1e-9), ray_v / max(radius, 1e-9)
        along_u, along_v = size.along_px[index] * ray_u / middle, size.along_px[index] * ray_v / middle
        across_u, across_v = -size.across_px[index] * ray_v / middle, size.across_px[index] * ray_u / middle
        count, number, sum_u, sum_v = 0, 0, 0.0, 0.0
        for i in range(-middle, middle + 1):
            for j in range(-middle, middle + 1):
                if i * i + j * j > middle * middle:
                    continue
                number += 1
                x = center_u + i * along_u + j * across_u
                y = center_v + i * along_v + j * across_v
                if x >= -0.5 and y >= -0.5 and x <= width - 0.5 and y <= height - 0.5:
                    count += 1
                    sum_u += x - u
                    sum_v += y - v
        if count == 0:
            break
        ratio = count / number
        center_u, center_v = center_u - sum_u / count, center_v - sum_v / count
    return center_u, center_v, ratio
