"""The plain NumPy picture of a goal that the compiled one is tested against."""

import numpy as np

from robocup_vision.camera.projection import camera_rotation
from robocup_vision.localization.goal.geometry import (
    BLOOM,
    HEADING,
    LOG_FOCAL,
    ROLL,
    TILT,
    foot_points,
    project,
    silhouette_normals,
)


def silhouette_lines(shape, view, unknowns):
    """Lines (..., 6, 3) of posts and bar in the ideal image: a u + b v + c = px outside the edge, bloom included."""
    p = np.asarray(unknowns, dtype=np.float64)
    rotation = camera_rotation(p[..., HEADING], p[..., TILT], p[..., ROLL])
    n = silhouette_normals(shape, p) @ rotation
    scale = np.exp(p[..., LOG_FOCAL])[..., None]
    a, b = -n[..., 1] / (view.focal_px[0] * scale), -n[..., 2] / (view.focal_px[1] * scale)
    c = n[..., 0] - a * view.center_px[0] - b * view.center_px[1]
    norm = np.hypot(a, b)
    return np.stack([a / norm, b / norm, c / norm - p[..., BLOOM, None]], axis=-1)


def feet_px(shape, view, unknowns, offsets):
    """Pixels (2, K, 2) of both posts' feet."""
    return project(view, unknowns, foot_points(shape, unknowns, offsets).reshape(-1, 3)).reshape(2, -1, 2)


def floor_px(view, unknowns, points_m):
    """Pixels (N, 2) of floor points (N, 2)."""
    return project(view, unknowns, np.column_stack([points_m, np.zeros(len(points_m))]))


def derivative(function, unknowns, step=1e-6):
    """Central differences (8, ...) of a function of the unknowns."""
    return np.array([(function(unknowns + step * e) - function(unknowns - step * e)) / (2 * step) for e in np.eye(8)])
