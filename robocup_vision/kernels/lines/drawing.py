"""Field lines drawn as a pinhole camera shows them: thinner than a pixel, blurred, light adding up where they meet."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera

_STEP_PX = 0.8
_REACH = 2


@compiled
def draw_lines(
    points: FloatArray,
    max_apart_m: float,
    view: FloatArray,
    p: FloatArray,
    line_width_m: float,
    blur_px: float,
    first_row: int,
    drawing: Float32Array,
) -> None:
    """Draw lines into a picture of the fraction of paint in each pixel, 0 to 1.

    Parameters
    ----------
    points : (N, 2) float64
        Along the lines, one line after the other, field frame, metres.
    max_apart_m : float
        Neighbours farther apart belong to different lines.
    view, p
        See `kernels.goal.picture.predict_goal`.
    line_width_m : float
        Of the paint.
    blur_px : float
        Standard deviation of the picture's blur, the pixel's own size included.
    first_row : int
        Of the image, that `drawing` begins with.
    drawing : (H, W) float32
        Result.
    """
    height, width = drawing.shape
    drawing[:, :] = 0.0
    axes = camera_axes(p[2], p[3], p[4])
    (r00, r01, r02), (r10, r11, r12), _ = axes
    fu, fv = view[0] * math.exp(p[6]), view[1] * math.exp(p[6])
    z = -p[5]
    curve = 0.5 / blur_px**2
    apart = np.exp(-curve * np.arange(_REACH + 1.0) ** 2)
    side_u, side_v = np.empty(2 * _REACH + 1), np.empty(2 * _REACH + 1)
    before_u, before_v, before_depth = 0.0, 0.0, -1.0
    for k in range(points.shape[0]):
        x, y = points[k, 0] - p[0], points[k, 1] - p[1]
        depth, left, up = in_camera(axes, x, y, z)
        if depth < 0.1:
            before_depth = -1.0
            continue
        u, v = ideal_pixel(fu, fv, view[2], view[3], depth, left, up)
        v -= first_row
        last_u, last_v, last_depth = before_u, before_v, before_depth
        before_u, before_v, before_depth = u, v, depth
        if k == 0 or last_depth < 0.0:
            continue
        dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
        length_m = math.hypot(dx, dy)
        if length_m > max_apart_m or length_m < 1e-9:
            continue
        if (
            max(u, last_u) < -3.0
            or min(u, last_u) > width + 2.0
            or max(v, last_v) < -3.0
            or min(v, last_v) > height + 2.0
        ):
            continue
        # seen width, from a step across on the floor at the segment's end
        nx, ny = -dy / length_m, dx / length_m
        a = (view[2] - u) / fu
        b = (view[3] - v - first_row) / fv
        across_u = -fu * (nx * (r01 - a * r00) + ny * (r11 - a * r10)) / depth
        across_v = -fv * (nx * (r02 - b * r00) + ny * (r12 - b * r10)) / depth
        length = math.hypot(u - last_u, v - last_v)
        if length < 1e-6:
            continue
        wide = abs(across_u * (v - last_v) - across_v * (u - last_u)) / length * line_width_m
        steps = int(length / _STEP_PX) + 1
        strokes = int(wide / _STEP_PX) + 1
        weight = wide / strokes * length / steps / (2.0 * math.pi * blur_px * blur_px)
        for s in range(strokes):
            off = ((s + 0.5) / strokes - 0.5) * line_width_m
            for i in range(steps):
                t = (i + 0.5) / steps
                cu = last_u + t * (u - last_u) + off * across_u
                cv = last_v + t * (v - last_v) + off * across_v
                iu, iv = int(round(cu)), int(round(cv))
                if iu < -_REACH or iu >= width + _REACH or iv < -_REACH or iv >= height + _REACH:
                    continue
                # a normal curve at neighbouring pixels: one of three factors is the same everywhere, one a power
                peak_u, ratio_u = math.exp(-curve * (iu - cu) ** 2), math.exp(-2.0 * curve * (iu - cu))
                peak_v, ratio_v = math.exp(-curve * (iv - cv) ** 2), math.exp(-2.0 * curve * (iv - cv))
                side_u[_REACH], side_v[_REACH] = peak_u, weight * peak_v
                up_u, up_v, down_u, down_v = peak_u, weight * peak_v, peak_u, weight * peak_v
                for j in range(1, _REACH + 1):
                    up_u, up_v = up_u * ratio_u, up_v * ratio_v
                    down_u, down_v = down_u / ratio_u, down_v / ratio_v
                    side_u[_REACH + j], side_v[_REACH + j] = up_u * apart[j], up_v * apart[j]
                    side_u[_REACH - j], side_v[_REACH - j] = down_u * apart[j], down_v * apart[j]
                low, high = max(0, _REACH - iu), min(2 * _REACH + 1, width - iu + _REACH)
                for j in range(max(0, _REACH - iv), min(2 * _REACH + 1, height - iv + _REACH)):
                    row = iv + j - _REACH
                    for m in range(low, high):
                        drawing[row, iu + m - _REACH] += side_v[j] * side_u[m]
