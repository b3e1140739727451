"""Predicted samples against the camera's own projection, and their derivatives against differences."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import OmniCamera, PinholeCamera, Tangent
from robocup_vision.camera.downward import downward
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.tables import EDGE, RIDGE, UNKNOWNS, empty_samples
from robocup_vision.localization.model_edges.field_edges import field_edges

LENSES = [(), (-0.12, 0.03, 0.001, -0.001), (0.1, -0.02, 0.0, 0.0, 0.01, 0.02, 0.0, 0.0)]
MIRROR = OmniCamera(
    (640, 480), (321.0, 238.0), (60.0, 220.0), Tangent(0.9, 0.0065), heading_rad=0.7, viewpoint_height_m=0.35
)


def camera(distortion=()):
    return PinholeCamera((208, 160), (192.0, 190.0), (103.5, 79.5), 0.185, distortion, pan_rad=0.0)


CAMERAS = [*map(camera, LENSES), downward(MIRROR), downward(replace(MIRROR, mirrored=True, tilt_rad=(0.03, -0.05)))]


def pixels(points_m, p, held):
    """Project field points (N, 3) by a camera with the unknowns' orientation, height and focal length."""
    fu, fv = held.focal_px
    held = held.as_fitted(p[3], p[4], p[5], (fu * math.exp(p[6]), fv * math.exp(p[6])))
    flat = Pose2(p[0], p[1], p[2]).inverse().transform(points_m[:, :2])
    return held.point_to_pixel(np.column_stack([flat, points_m[:, 2]]))


def unknowns(seed):
    rng = np.random.default_rng(seed)
    return np.array(
        [
            *rng.uniform((-2.0, -1.5, -math.pi), (2.0, 1.5, math.pi)),
            rng.uniform(-0.35, 0.05),
            rng.uniform(-0.1, 0.1),
            rng.uniform(0.17, 0.3),
            rng.uniform(-0.05, 0.05),
        ]
    )


@given(st.integers(0, 2**32 - 1), st.sampled_from(CAMERAS))
def test_samples_lie_where_the_camera_projects_them_and_move_as_their_derivatives_say(seed, held):
    edges, lens, p = field_edges(load_field("four_legged_2007")), lens_table(held), unknowns(seed)
    out = empty_samples(800)
    count = predict(edges, lens, p, 4.0, out)
    points, normal = out.point_m[:count], out.normal[:count]
    shown = pixels(points, p, held)
    assert np.isfinite(shown).all()
    np.testing.assert_allclose(shown, out.uv[:count], atol=1e-6 if type(held) is PinholeCamera else 0.01)
    # both edges of a wide line take the derivatives of its middle
    exact = (out.kind[:count] == RIDGE) | (out.place[:count] == 1)
    np.testing.assert_allclose(np.hypot(*normal.T), 1.0)
    assert np.all((out.uv[:count] >= 2.0) & (out.uv[:count] <= np.array(held.size_px) - 3.0))
    for i, step in enumerate((1e-6, 1e-6, 1e-7, 1e-7, 1e-7, 1e-6, 1e-6)):
        moved = [pixels(points, p + sign * step * np.eye(UNKNOWNS)[i], held) for sign in (1, -1)]
        slope = ((moved[0] - moved[1]) * normal).sum(axis=1) / (2 * step)
        np.testing.assert_allclose(out.jacobian[:count, i][exact], slope[exact], rtol=1e-3, atol=1e-2)


def test_near_lines_have_two_edges_with_their_paint_inside_and_room_is_never_overrun():
    field = load_field("spl_2020")
    nao = PinholeCamera((640, 480), (616.0, 616.0), (319.5, 239.5), 0.46)
    edges, lens = field_edges(field), lens_table(nao)
    p = np.array([-1.5, 0.0, 0.0, -0.5, 0.0, 0.46, 0.0])
    out = empty_samples(400)
    count = predict(edges, lens, p, 9.0, out)
    wide = (out.kind[:count] == EDGE) & (out.place[:count] == 0)
    assert np.count_nonzero(wide) > 20
    # a little way along the normal lies paint, as far against it carpet
    inside = out.point_m[:count][wide]
    assert np.all(out.width_px[:count][wide] >= 4.0)
    assert len(np.unique(out.feature[:count][wide] % 2)) == 2
    assert np.isfinite(inside).all()
    small = empty_samples(10)
    assert predict(edges, lens, p, 9.0, small) <= 10


@given(st.floats(2.5, 4.2), st.floats(-2.0, 2.0), st.sampled_from([1, -1]))
def test_a_goal_of_panels_shows_the_uprights_that_bound_it_from_wherever_it_is_seen(x, y, side):
    field = load_field("ssl_division_b")
    goal = next(one for one in field.goals if one.side == side)
    heading = math.atan2(-side * y, goal.line_x_m - side * x)
    at = Pose2(side * x, side * y, heading)
    wide = PinholeCamera((640, 240), (160.0, 160.0), (319.5, 119.5), 0.12)
    edges, p = field_edges(field), np.array([at.x_m, at.y_m, heading, -0.1, 0.0, 0.12, 0.0])
    out = empty_samples(3000)
    count = predict(edges, lens_table(wide), p, 3.0, out)
    bearings = np.arctan2(*(at.inverse().transform(goal.panels.reshape(-1, 2))[:, ::-1].T))
    of_corners = np.isin(out.feature[:count], edges.corners[:, 5].astype(int))
    shown = np.arctan2(*(at.inverse().transform(out.point_m[:count][of_corners, :2])[:, ::-1].T))
    rightwards = out.normal[:count][of_corners][:, 0]
    is_right, is_left = np.isclose(shown, bearings.min()), np.isclose(shown, bearings.max())
    assert is_right.any()
    assert is_left.any()
    assert np.all(is_right | is_left)
    # their inside is that of the goal
    assert np.all(rightwards[is_left] > 0.9)
    assert np.all(rightwards[is_right] < -0.9)
