"""Compiled fit of a whole ball to the part of it that the picture shows."""

from __future__ import annotations

import math

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.balls.blobs import BallSize

# sample points along the diameter of a disc, and iterations
_ACROSS, _STEPS = 33, 12


@compiled
def fit_cut_ball(
    u: float, v: float, width: int, height: int, size: BallSize
) -> tuple[float, float, float, int, float, float]:
    """Fit a whole ball so that the centre of its part inside the picture agrees with the centre that was measured.

    Parameters
    ----------
    u, v : float
        Measured centre of the part.
    width, height : int
        Size of the picture.
    size : BallSize
        Size of a ball; may be a plain tuple.

    Returns
    -------
    u, v : float
        Centre of the whole ball.
    ratio : float
        Visible ratio of the ball.
    count : int
        Sample points that the picture shows; 0 if none.
    along, across : float
        Half sizes of the visible part along and across the ray to it: twice its standard deviations.
    """
    size = BallSize(*size)
    center_u, center_v, ratio = u, v, 1.0
    part_u, part_v = u - size.axis_u, v - size.axis_v
    reach = max(math.hypot(part_u, part_v), 1e-9)
    part_u, part_v = part_u / reach, part_v / reach
    shown, along_std, across_std = 0, 0.0, 0.0
    last, middle = len(size.along_px) - 1, _ACROSS // 2
    for _ in range(_STEPS):
        ray_u, ray_v = center_u - size.axis_u, center_v - size.axis_v
        radius = math.hypot(ray_u, ray_v)
        index = min(int(round(radius)), last)
        ray_u, ray_v = ray_u / max(radius, 1e-9), ray_v / max(radius, 1e-9)
        along_u, along_v = size.along_px[index] * ray_u / middle, size.along_px[index] * ray_v / middle
        across_u, across_v = -size.across_px[index] * ray_v / middle, size.across_px[index] * ray_u / middle
        count, number, sum_u, sum_v, sum_uu, sum_uv, sum_vv = 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(-middle, middle + 1):
            for j in range(-middle, middle + 1):
                if i * i + j * j > middle * middle:
                    continue
                number += 1
                # relative to the centre of the part, to avoid cancellation
                x = center_u + i * along_u + j * across_u
                y = center_v + i * along_v + j * across_v
                if x >= -0.5 and y >= -0.5 and x <= width - 0.5 and y <= height - 0.5:
                    x, y = x - u, y - v
                    count += 1
                    sum_u += x
                    sum_v += y
                    sum_uu += x * x
                    sum_uv += x * y
                    sum_vv += y * y
        if count == 0:
            break
        shown, ratio = count, count / number
        mean_u, mean_v = sum_u / count, sum_v / count
        uu, uv, vv = sum_uu / count - mean_u**2, sum_uv / count - mean_u * mean_v, sum_vv / count - mean_v**2
        along_std = math.sqrt(max(part_u**2 * uu + 2.0 * part_u * part_v * uv + part_v**2 * vv, 0.0))
        across_std = math.sqrt(max(part_v**2 * uu - 2.0 * part_u * part_v * uv + part_u**2 * vv, 0.0))
        center_u, center_v = center_u - mean_u, center_v - mean_v
    return center_u, center_v, ratio, shown, 2.0 * along_std, 2.0 * across_std
