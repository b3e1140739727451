"""The verdict on goals: washed ones are found, boxes are not, and cameras that are alike make one uncertain."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.localization.goal.camera_estimate import CameraEstimate
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from robocup_vision.localization.goal.verdict import with_spread
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, NEGATIVE_VIEWS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
STREAKS = GOAL_CONDITIONS["streaks_416x320"]


def streaked(index):
    """Render a goal along whose posts lamps draw white streaks."""
    return next(sample_goal(FIELD, STREAKS, 91, 66, places=paper_places(FIELD), indices=[index], supersample=3))


def placed(x_m, y_m, std_m):
    """Place a camera, as certain of everything as said."""
    unknowns = np.zeros(8)
    unknowns[:2] = x_m, y_m
    return CameraEstimate(unknowns, np.eye(8) * std_m**2, (1,), None, None)


@pytest.mark.parametrize("index", [44, 49])
def test_a_goal_behind_streaks_of_light_is_located(index):
    sample = streaked(index)
    estimate = GoalPoseEstimator(FIELD, STREAKS.camera).locate(sample.frame)
    assert estimate
    assert estimate.pose.error_to(sample.pose)[0] < 0.1


@given(
    offset_m=st.floats(0.0, 0.19),
    std_m=st.floats(0.001, 0.05),
    behind_nats=st.floats(0.0, 100.0),
)
def test_a_camera_is_as_uncertain_as_its_neighbours_differ(offset_m, std_m, behind_nats):
    best, other = placed(0.0, 0.0, std_m), placed(offset_m, 0.0, std_m)
    doubted = with_spread(best, [(300.0, best), (300.0 - behind_nats, other)], 0.2, 15.0)
    share = math.exp(-behind_nats / 15.0)
    expected = std_m**2 + offset_m**2 * share / (1.0 + share)
    assert doubted.covariance[0, 0] == pytest.approx(expected)
    assert doubted.covariance[1, 1] == pytest.approx(std_m**2)
    assert doubted.unknowns is best.unknowns


def test_a_camera_elsewhere_is_another_answer():
    best, other = placed(0.0, 0.0, 0.01), placed(0.5, 0.0, 0.01)
    assert with_spread(best, [(300.0, best), (299.0, other)], 0.2, 15.0).covariance == pytest.approx(best.covariance)


@pytest.mark.parametrize(("name", "index"), [("mild_glare_208x160", 5), ("streaks_416x320", 0)])
def test_boxes_before_lines_are_no_goal(name, index):
    condition = GOAL_CONDITIONS[name]
    sample = next(sample_goal(FIELD, condition, 778, 25, views=NEGATIVE_VIEWS, indices=[index], supersample=2))
    answer = GoalPoseEstimator(FIELD, condition.camera).locate(sample.frame)
    assert not answer
    assert answer.reason.startswith("no ")
