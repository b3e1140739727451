"""Plain forms of what the landmarks' kernels compute."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera


def pixel_by_point(camera: PinholeCamera, points_m: FloatArray) -> FloatArray:
    """Return derivatives (N, 2, 3) of ideal pixels by points in the camera frame."""
    depth = points_m[:, 0]
    fx, fy = camera.focal_px
    jacobian = np.zeros((len(points_m), 2, 3))
    jacobian[:, 0, 0] = fx * points_m[:, 1] / depth**2
    jacobian[:, 0, 1] = -fx / depth
    jacobian[:, 1, 0] = fy * points_m[:, 2] / depth**2
    jacobian[:, 1, 2] = -fy / depth
    return jacobian
