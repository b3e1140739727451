"""A goal, a camera that sees it, and the samples of its edges that exact measurements would give."""

import numpy as np

from field_models import load_field
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.localization.goal.geometry import (
    BLOOM,
    HEADING,
    LOG_FOCAL,
    ROLL,
    TILT,
    IdealView,
    foot_points,
    goal_shape,
    project,
    silhouette_normals,
)

SHAPE = goal_shape(load_field("four_legged_2007"))
VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
OFFSETS = np.array([-0.7, 0.0, 0.7])
SCENE = GoalScene(
    np.array([SHAPE.line_x_m, SHAPE.width_m, SHAPE.height_m, SHAPE.radius_m]),
    np.array([384.0, 380.0, 207.5, 159.5]),
    OFFSETS,
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


def some_camera(rng):
    x, y = rng.uniform(-2.5, 1.8), rng.uniform(-1.2, 1.2)
    heading = np.arctan2(-y, SHAPE.line_x_m - x) + rng.uniform(-0.1, 0.1)
    return np.array(
        [x, y, heading, *rng.uniform(-0.1, 0.1, 2), 0.185, rng.uniform(-0.02, 0.02), rng.uniform(-0.5, 0.5)]
    )


def perfect_samples(p, per_edge=10, sigma=None):
    """Points on each predicted line, and the predicted feet."""
    lines = silhouette_lines(SHAPE, VIEW, p)
    corners = project(VIEW, p, SHAPE.corners)
    ends = [(0, 1), (0, 1), (3, 2), (3, 2), (1, 2), (1, 2)]
    edge, uv = [], []
    for e, (a, b) in enumerate(ends):
        for t in np.linspace(0.1, 0.9, per_edge):
            point = corners[a] + t * (corners[b] - corners[a])
            point = point - lines[e, :2] * (lines[e, :2] @ point + lines[e, 2])
            edge.append(e)
            uv.append(point)
    feet = feet_px(SHAPE, VIEW, p, OFFSETS).reshape(-1, 2)
    direction = np.tile([0.0, 1.0], (6, 1))
    # eight places on the goal line beside the posts
    marks = np.column_stack([np.full(8, SHAPE.line_x_m), np.linspace(-0.8, 0.8, 8)])
    return FitSamples(
        np.array(edge),
        np.array(uv),
        np.repeat([0, 1], 3),
        np.tile([0, 1, 2], 2),
        feet + p[7] * direction,
        direction,
        marks,
        floor_px(VIEW, p, marks),
        np.tile([0.6, 0.8], (8, 1)),
        np.full(len(edge) + 14, 0.1) if sigma is None else sigma,
    )
