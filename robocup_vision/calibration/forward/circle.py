"""The circle that a fisheye fills in its pictures: found by the dark rim around it.

What is dark in every picture of a camera and reaches a corner of it is beyond the lens, or a part of the robot. The
border of the lens is a circle that is not far off the picture's middle; that of a robot's part is none.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array

# of the brightness of the picture's middle third: a rim is darker in every picture; light strays into it
_DARK = 0.15
# of the radius: how near to the circle the border is; and of all directions in which a circle has a border in the
# picture, those in which it is found there
_NEAR, _MIN_FOUND = 0.01, 0.8
_DIRECTIONS = 360
_MIN_DIRECTIONS = 40
# of the greatest radius, what is used: lenses fade towards the rim
_USED = 0.98


def dark_rim(frames: Sequence[UInt8Array]) -> tuple[float, float, float] | None:
    """Return centre u, v and radius (px) of the circle outside of which all pictures are dark; None without one.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8
        BGR, of one camera: the more of them, the less often something dark is taken for the rim.
    """
    brightest = np.max([cv2.blur(np.max(frame, axis=-1), (3, 3)) for frame in frames], axis=0).astype(np.float64)
    height, width = brightest.shape
    middle = brightest[height // 3 : -(height // 3), width // 3 : -(width // 3)]
    lit = brightest > _DARK * float(np.median(middle))
    border = _outermost(lit)
    for _ in range(3):
        if len(border) < _MIN_DIRECTIONS:
            return None
        u, v, radius = _circle(border)
        border = border[np.abs(np.hypot(border[:, 0] - u, border[:, 1] - v) - radius) < 3 * _NEAR * radius]
    if np.hypot(u - (width - 1) / 2, v - (height - 1) / 2) > 0.15 * max(width, height):
        return None
    near = np.abs(np.hypot(border[:, 0] - u, border[:, 1] - v) - radius) < _NEAR * radius
    angle = np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    on_circle = np.stack([u + radius * np.cos(angle), v + radius * np.sin(angle)], axis=1)
    visible = ((on_circle > 2.0) & (on_circle < (width - 3.0, height - 3.0))).all(axis=1)
    if np.count_nonzero(near) < max(_MIN_FOUND * np.count_nonzero(visible), _MIN_DIRECTIONS):
        return None
    return u, v, radius


def circle_of(rim: tuple[float, float, float], center_px: tuple[float, float]) -> tuple[float, float]:
    """Return the inner and outer radius (px) about a lens's centre that a rim leaves in use."""
    u, v, radius = rim
    return 0.0, _USED * radius - float(np.hypot(u - center_px[0], v - center_px[1]))


def _outermost(lit: BoolArray) -> FloatArray:
    """(N, 2) float64: the last lit pixels along rays from the middle that are dark from there to the border."""
    height, width = lit.shape
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    found = []
    for angle in np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False):
        way = np.array([np.cos(angle), np.sin(angle)])
        length = float(np.min(middle / np.maximum(np.abs(way), 1e-9)))
        steps = np.arange(0.0, length, 0.5)
        column, row = np.rint(middle[:, None] + way[:, None] * steps).astype(np.intp)
        shown = np.flatnonzero(lit[row, column])
        if len(shown) and steps[shown[-1]] < length - 3.0:
            found.append(middle + way * (steps[shown[-1]] + 0.25))
    return np.array(found).reshape(-1, 2)


def _circle(points: FloatArray) -> tuple[float, float, float]:
    """Centre and radius of the circle through points (N, 2), by least squares of the squared radius."""
    design = np.column_stack([2.0 * points, np.ones(len(points))])
    (u, v, rest), *_ = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)
    return float(u), float(v), float(np.sqrt(max(rest + u * u + v * v, 1e-9)))
