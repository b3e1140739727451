"""Yako et al.'s method: laws of its angles, and poses on rendered frames."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from field_models import ArgumentError, load_field
from robocup_vision.localization.baselines.goal_angles import (
    GoalAngles,
    GoalAnglesEstimator,
    angles_between,
    position_from_angles,
    theoretical_angles,
)
from robocup_vision.localization.goal.geometry import IdealView, goal_shape, project
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
CLEAN = GOAL_CONDITIONS["clean_416x320"]
SHAPE = goal_shape(FIELD)
VIEW = IdealView((384.0, 380.0), (207.5, 159.5))
xs = st.floats(-2.5, 2.2)
ys = st.floats(-1.8, 1.8)
small = st.floats(-0.15, 0.15)


def looking_at_goal(x, y, pan=0.0, tilt=0.0, roll=0.0):
    heading = math.atan2(-y, SHAPE.line_x_m - x) + pan
    return np.array([x, y, heading, tilt, roll, 0.185, 0.0, 0.0])


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


@pytest.fixture(scope="module")
def clean():
    places = paper_places(FIELD)
    return list(sample_goal(FIELD, CLEAN, 3, 66, places=places, indices=[6, 12, 20, 33], supersample=3))


@pytest.mark.slow
@pytest.mark.parametrize("closed_form", [False, True])
def test_poses_come_near(clean, closed_form):
    reference = GoalAnglesEstimator(FIELD, CLEAN.camera, closed_form=closed_form)
    errors = []
    for sample in clean:
        estimate = reference.locate(sample.frame)
        errors.append(estimate.pose.error_to(sample.pose)[0] if estimate else np.inf)
    assert np.median(errors) < 0.6
    assert min(errors) < 0.2


def test_an_empty_frame_is_refused():
    estimate = GoalAnglesEstimator(FIELD, CLEAN.camera).locate(np.zeros((320, 416, 3), np.uint8))
    assert not estimate
    assert "region" in estimate.reason


def test_white_goals_are_refused():
    with pytest.raises(ArgumentError, match="those of 'spl_2020' are white"):
        GoalAnglesEstimator(load_field("spl_2020"), CLEAN.camera)
    with pytest.raises(ArgumentError, match="no goals of posts"):
        GoalAnglesEstimator(load_field("ssl_2001"), CLEAN.camera)
