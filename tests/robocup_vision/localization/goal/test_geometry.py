"""Laws of the goal's picture: tangents touch, feet stand before their posts."""

import math

import numpy as np
import pytest
from goal_samples import SCENE, SHAPE, VIEW, silhouette_normals
from hypothesis import assume, given
from hypothesis import strategies as st

from field_models import ArgumentError, load_field
from robocup_vision.kernels.goal.edge_places import goal_outline
from robocup_vision.kernels.goal.picture import predict_goal
from robocup_vision.localization.goal.geometry import EDGES, goal_shape, project

xs = st.floats(-2.5, 2.2)
ys = st.floats(-1.8, 1.8)
small = st.floats(-0.15, 0.15)


def looking_at_goal(x, y, pan=0.0, tilt=0.0, roll=0.0, bloom=0.0):
    heading = math.atan2(-y, SHAPE.line_x_m - x) + pan
    return np.array([x, y, heading, tilt, roll, 0.185, 0.0, bloom])


def silhouette_lines(p):
    lines = np.empty((EDGES, 3))
    predict_goal(SCENE, p, lines, np.empty((2, len(SCENE.offsets), 2)))
    return lines


@given(xs, ys, small, small, small)
def test_silhouettes_touch_the_cylinders(x, y, pan, tilt, roll):
    p = looking_at_goal(x, y, pan, tilt, roll)
    normals = silhouette_normals(SHAPE, p)
    lines = silhouette_lines(p)
    for edge in range(EDGES):
        post_y = SHAPE.post_y_m[0 if edge < 2 else 1]
        center = (SHAPE.line_x_m, post_y, 0.2) if edge < 4 else (SHAPE.line_x_m, 0.1, SHAPE.height_m)
        touch = np.array(center) + SHAPE.radius_m * normals[edge]
        u, v = project(VIEW, p, touch[None])[0]
        assume(math.isfinite(u))
        assert lines[edge] @ (u, v, 1.0) == pytest.approx(0.0, abs=1e-6)
        # the axis lies inside, at the negative side
        u, v = project(VIEW, p, np.array(center)[None])[0]
        assert lines[edge] @ (u, v, 1.0) < 0


def test_bloom_moves_every_edge_outwards():
    plain = silhouette_lines(looking_at_goal(0.0, 0.5))
    grown = silhouette_lines(looking_at_goal(0.0, 0.5, bloom=0.7))
    np.testing.assert_allclose(grown[:, 2], plain[:, 2] - 0.7)
    np.testing.assert_allclose(grown[:, :2], plain[:, :2])


@given(xs, ys, st.floats(-0.95, 0.95))
def test_feet_lie_on_the_near_half_of_the_post(x, y, offset):
    outline = np.empty((16, 3))
    goal_outline(SCENE._replace(offsets=np.array([offset])), x, y, 0.185, outline)
    feet = outline[12:14] + np.array([x, y, 0.185])
    for (px, py, pz), post_y in zip(feet, SHAPE.post_y_m, strict=True):
        assert math.hypot(px - SHAPE.line_x_m, py - post_y) == pytest.approx(SHAPE.radius_m)
        assert math.hypot(px - x, py - y) < math.hypot(SHAPE.line_x_m - x, post_y - y)
        assert pz == pytest.approx(0.0)


@pytest.mark.parametrize(("name", "kind"), [("four_legged_2005", "panels"), ("msl_6x4", "none")])
def test_fields_without_posts_are_refused(name, kind):
    with pytest.raises(ArgumentError, match=f"no goals of posts and a bar .its goals: {kind}"):
        goal_shape(load_field(name))
