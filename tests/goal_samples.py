"""A goal, a camera that sees it, and the samples of its edges that exact measurements would give."""

import numpy as np

from field_models import load_field
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.localization.goal.geometry import (
    BAR_BOTTOM,
    BAR_TOP,
    BLOOM,
    EDGES,
    HEADING,
    HEIGHT,
    LEFT_INNER,
    LEFT_OUTER,
    LOG_FOCAL,
    RIGHT_INNER,
    RIGHT_OUTER,
    ROLL,
    TILT,
    IdealView,
    X,
    Y,
    goal_shape,
    project,
)

SHAPE = goal_shape(load_field("four_legged_2007"))
VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
OFFSETS = np.array([-0.7, 0.0, 0.7])
SCENE = GoalScene(
    np.array([SHAPE.line_x_m, SHAPE.width_m, SHAPE.height_m, SHAPE.radius_m]),
    np.array([384.0, 380.0, 207.5, 159.5]),
    OFFSETS,
)


def silhouette_normals(shape, unknowns):
    """Outward unit normals (..., 6, 3), field frame, of the planes through the camera that touch posts and bar.

    The camera, unknowns (..., 8), must stand outside the cylinders.
    """
    p = np.asarray(unknowns, dtype=np.float64)
    dx = shape.line_x_m - p[..., X]
    normals = np.zeros((*p.shape[:-1], EDGES, 3))
    for post, (outer, inner) in enumerate(((LEFT_OUTER, LEFT_INNER), (RIGHT_OUTER, RIGHT_INNER))):
        dy = shape.post_y_m[post] - p[..., Y]
        bearing = np.arctan2(dy, dx)
        half = np.arcsin(np.minimum(1.0, shape.radius_m / np.hypot(dx, dy)))
        left, right = (outer, inner) if post == 0 else (inner, outer)
        normals[..., left, 0], normals[..., left, 1] = -np.sin(bearing + half), np.cos(bearing + half)
        normals[..., right, 0], normals[..., right, 1] = np.sin(bearing - half), -np.cos(bearing - half)
    dz = shape.height_m - p[..., HEIGHT]
    elevation = np.arctan2(dz, np.abs(dx))
    half = np.arcsin(np.minimum(1.0, shape.radius_m / np.hypot(dx, dz)))
    side = np.where(dx < 0, -1.0, 1.0)
    normals[..., BAR_TOP, 0], normals[..., BAR_TOP, 2] = -side * np.sin(elevation + half), np.cos(elevation + half)
    normals[..., BAR_BOTTOM, 0] = side * np.sin(elevation - half)
    normals[..., BAR_BOTTOM, 2] = -np.cos(elevation - half)
    return normals


def foot_points(shape, unknowns, offsets):
    """Points (..., 2, K, 3), field frame, where the near half of each post meets the floor, for cameras (..., 8).

    The offsets (K,) are across the post as seen, from -1, its left edge, to 1.
    """
    p = np.asarray(unknowns, dtype=np.float64)
    across = np.asarray(offsets, dtype=np.float64)
    along = np.sqrt(1.0 - across**2)
    posts = []
    for post_y in shape.post_y_m:
        dx, dy = shape.line_x_m - p[..., X], post_y - p[..., Y]
        distance = np.hypot(dx, dy)
        ux, uy = (dx / distance)[..., None], (dy / distance)[..., None]
        x = shape.line_x_m + shape.radius_m * (across * uy - along * ux)
        y = post_y + shape.radius_m * (-across * ux - along * uy)
        posts.append(np.stack([x, y, np.zeros_like(x)], axis=-1))
    return np.stack(posts, axis=-3)


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
