"""What stands fixed on a field, as static shapes of the physics: walls, goals, beacons, boxes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from field_models import Field
from sim2d.rendering.scene import Box, Scene

WALL_THICKNESS_M = 0.05  # outwards: the inner face stands at the place in the field file
PANEL_HALF_THICKNESS_M = 0.005


def add_ground(space: pymunk.Space, field: Field, boxes: Sequence[Box], collision_type: int) -> None:
    """Add everything fixed to a space, always in the same order."""
    shapes: list[pymunk.Shape] = []
    fixed = space.static_body
    if field.is_bounded:
        corners = field.floor_polygon
        for (x0, y0), (x1, y1) in zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True):
            half, length = WALL_THICKNESS_M / 2, math.hypot(x1 - x0, y1 - y0)
            # counter-clockwise, so outwards is to the right of the edge
            ox, oy = half * (y1 - y0) / length, -half * (x1 - x0) / length
            shapes.append(pymunk.Segment(fixed, (x0 + ox, y0 + oy), (x1 + ox, y1 + oy), half))
    for goal in field.goals:
        if goal.kind == "panels":
            for x0, y0, x1, y1 in goal.panels.tolist():
                shapes.append(pymunk.Segment(fixed, (x0, y0), (x1, y1), PANEL_HALF_THICKNESS_M))
    shapes += [pymunk.Circle(fixed, post.radius_m, (post.x_m, post.y_m)) for post in Scene(field).posts()]
    shapes += [pymunk.Poly(fixed, [(x, y) for x, y in box.corners.tolist()]) for box in boxes]
    for shape in shapes:
        shape.elasticity, shape.friction = 0.7, 0.1
        shape.collision_type = collision_type
        space.add(shape)
