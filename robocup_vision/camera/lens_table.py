"""Table of a camera's lens for compiled loops, in one format for all lens models."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.algebra.lens import CELLS, INVERSE_CELLS

# margins of the table's squared slopes and of the view's slopes beyond those in the picture
_MARGIN2, _MARGIN = 1.1, 1.02
# step of the radius's numerical derivative: errors of rounding and curvature are both below 1e-9
_ANGLE_STEP_RAD = 1e-5
_BORDER = 33


def lens_table(camera: PinholeCamera) -> FloatArray:
    """Return the table of `kernels.algebra.lens` for a camera: (24,) float64 without distortion, else (1304,).

    It covers the picture, but not beyond the camera's widest slope.
    """
    width, height = camera.size_px
    u, v = np.linspace(0.0, width - 1.0, _BORDER), np.linspace(0.0, height - 1.0, _BORDER)
    border = np.concatenate(
        [np.stack([u, np.full(_BORDER, row)], 1) for row in (v[0], v[-1])]
        + [np.stack([np.full(_BORDER, column), v], 1) for column in (u[0], u[-1])]
    )
    slopes = camera.ideal_slopes(border)
    seen = np.isfinite(slopes).all(axis=1)
    slopes = slopes[seen]
    # if parts of the picture are beyond the lens's circle, the limit is that of the lens
    widest = np.abs(slopes).max(axis=0) if seen.all() else np.full(2, camera.widest_slope)
    most2 = _MARGIN2 * float((slopes**2).sum(axis=1).max()) if seen.all() else math.inf
    if camera.is_bent:
        most2 = min(most2, camera.widest_slope**2)
    mount = camera.mount.ravel()
    numbers = [*camera.focal_px, *camera.center_px, width, height, float(camera.is_bent)]
    numbers += [*camera.tangential, most2, *(_MARGIN * widest)]
    if not camera.is_bent:
        return read_only([*numbers, 0.0, 0.0, 0.0, *mount])
    lowest = 1.0 / math.sqrt(1.0 + most2)
    cosine = np.linspace(lowest, 1.0, CELLS + 1)
    angle = np.arccos(np.minimum(cosine, 1.0))
    forward = _cells(cosine, *_stretch(camera, angle))
    radius = _radius_and_slope(camera, np.array([angle[0]]))[0][0]
    squared = np.linspace(0.0, radius**2, INVERSE_CELLS + 1)
    angle = camera.angle_of_radius(np.sqrt(squared))
    inverse = np.concatenate([_cells(squared, *each) for each in _inverse(camera, angle)], axis=1)
    cells = np.concatenate([forward.ravel(), inverse.ravel()])
    return read_only([*numbers, lowest, CELLS / (1.0 - lowest), INVERSE_CELLS / radius**2, *mount, *cells])


def _radius_and_slope(camera: PinholeCamera, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the image radius, for a focal length of one, and its derivative by the angle."""
    low = np.maximum(angle - _ANGLE_STEP_RAD, 0.0)
    radius = camera.image_radius(angle)
    return radius, (camera.image_radius(angle + _ANGLE_STEP_RAD) - camera.image_radius(low)) / (
        angle + _ANGLE_STEP_RAD - low
    )


def _stretch(camera: PinholeCamera, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return g = (image radius) / sin(angle), and its derivative by the cosine."""
    near = np.maximum(angle, 1e-3)  # g is even in the angle, and constant near the axis to 1e-6
    radius, slope = _radius_and_slope(camera, near)
    sine = np.sin(near)
    g = radius / sine
    return g, -(slope - g * np.cos(near)) / sine**2


def _inverse(camera: PinholeCamera, angle: FloatArray) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Return the angle's cosine, and sin(angle) / (image radius), each with its derivative by the squared radius."""
    near = np.maximum(angle, 1e-3)
    radius, slope = _radius_and_slope(camera, near)
    by_squared = 1.0 / (2.0 * radius * slope)
    scale = np.sin(near) / radius
    return (
        (np.cos(angle), -np.sin(near) * by_squared),
        (scale, (np.cos(near) - scale * slope) / radius * by_squared),
    )


def _cells(at: FloatArray, values: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return Hermite cells (N, 4): coefficients of cubics in the position within each cell, 0 to 1."""
    step = np.diff(at)
    begin, end = values[:-1], values[1:]
    out, into = slopes[:-1] * step, slopes[1:] * step
    return np.stack([begin, out, 3 * (end - begin) - 2 * out - into, 2 * (begin - end) + out + into], axis=1)
