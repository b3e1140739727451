"""Laws of the goal's picture: tangents touch, angles do not depend on the camera's pose, the closed form inverts."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from field_models import ArgumentError, load_field
from robocup_vision.localization.goal.geometry import (
    EDGES,
    GoalAngles,
    IdealView,
    angles_between,
    foot_points,
    goal_shape,
    position_from_angles,
    project,
    silhouette_lines,
    silhouette_normals,
    theoretical_angles,
)

SHAPE = goal_shape(load_field("four_legged_2007"))
VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
xs = st.floats(-2.5, 2.2)
ys = st.floats(-1.8, 1.8)
small = st.floats(-0.15, 0.15)


def looking_at_goal(x, y, pan=0.0, tilt=0.0, roll=0.0, bloom=0.0):
    heading = math.atan2(-y, SHAPE.line_x_m - x) + pan
    return np.array([x, y, heading, tilt, roll, 0.185, 0.0, bloom])


@settings(deadline=None)
@given(xs, ys)
def test_closed_form_inverts_the_angles(x, y):
    angles = GoalAngles(*theoretical_angles(SHAPE, x, y, 0.185).tolist())
    # straight ahead of the goal's middle all angles are stationary in y; the closed form is exact all the same
    found = position_from_angles(SHAPE, angles)
    assert found is not None
    assert found == pytest.approx((x, y), abs=1e-5)


def test_closed_form_refuses_what_nobody_sees():
    assert position_from_angles(SHAPE, GoalAngles(3.0, 0.1, 0.1)) is None


@settings(deadline=None)
@given(xs, ys, small, small, small)
def test_angles_do_not_depend_on_how_the_camera_is_held(x, y, pan, tilt, roll):
    p = looking_at_goal(x, y, pan, tilt, roll)
    pixels = project(VIEW, p, SHAPE.corners)
    assume(np.isfinite(pixels).all())
    slopes = (pixels - VIEW.center_px) / VIEW.focal_px
    foot_left, top_left, top_right, foot_right = np.column_stack([np.ones(4), -slopes])
    seen = angles_between(np.cross(foot_right, top_right), np.cross(foot_left, top_left), np.cross(top_left, top_right))
    np.testing.assert_allclose(seen, theoretical_angles(SHAPE, x, y, 0.185), atol=1e-9)
    left, right = (math.atan2(post_y - y, SHAPE.line_x_m - x) for post_y in SHAPE.post_y_m)
    assert seen[0] == pytest.approx(left - right, abs=1e-9)


@settings(deadline=None)
@given(xs, ys, small, small, small)
def test_silhouettes_touch_the_cylinders(x, y, pan, tilt, roll):
    p = looking_at_goal(x, y, pan, tilt, roll)
    normals = silhouette_normals(SHAPE, p)
    lines = silhouette_lines(SHAPE, VIEW, p)
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
    plain = silhouette_lines(SHAPE, VIEW, looking_at_goal(0.0, 0.5))
    grown = silhouette_lines(SHAPE, VIEW, looking_at_goal(0.0, 0.5, bloom=0.7))
    np.testing.assert_allclose(grown[:, 2], plain[:, 2] - 0.7)
    np.testing.assert_allclose(grown[:, :2], plain[:, :2])


@settings(deadline=None)
@given(xs, ys, st.floats(-0.95, 0.95))
def test_feet_lie_on_the_near_half_of_the_post(x, y, offset):
    feet = foot_points(SHAPE, looking_at_goal(x, y), np.array([offset]))
    for post, post_y in enumerate(SHAPE.post_y_m):
        px, py, pz = feet[post, 0]
        assert math.hypot(px - SHAPE.line_x_m, py - post_y) == pytest.approx(SHAPE.radius_m)
        assert math.hypot(px - x, py - y) < math.hypot(SHAPE.line_x_m - x, post_y - y)
        assert pz == 0.0


@pytest.mark.parametrize(("name", "kind"), [("four_legged_2005", "panels"), ("msl_6x4", "none")])
def test_fields_without_posts_are_refused(name, kind):
    with pytest.raises(ArgumentError, match=f"no goals of posts and a bar .its goals: {kind}"):
        goal_shape(load_field(name))
