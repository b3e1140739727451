"""Goals that others stand before: nobody passes for a post, and what is left tells no more than it shows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.goal.half_goal import PRIOR_STD_M
from robocup_vision.localization.goal.pose_estimator import GoalPoseEstimator
from sim2d.match.setups import camera_for
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Robot, Scene
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

FIELD = load_field("four_legged_2007")
CAMERA = camera_for(FIELD)
FRAMES = 2
# the camera, who stands before the goal that it sees, and what is left to see of that
HALF_HIDDEN = [
    (Pose2(-1.04, -1.03, -0.01), ((1.54, -0.27), (1.56, -0.7), (-0.39, -1.36))),
    (Pose2(0.6, 1.51, -0.76), ((2.42, 0.27), (2.13, 0.69), (2.49, -0.58), (1.67, -0.47))),
    (Pose2(-0.19, 0.9, -0.59), ((1.74, 0.77), (0.78, 0.87), (0.69, -0.81), (1.29, -0.08))),
    (Pose2(0.65, 1.32, -0.84), ((2.21, 0.51), (2.1, 0.76), (1.9, -0.55))),
    (Pose2(-0.36, -0.72, 2.58), ((-1.72, 0.02), (-1.3, -0.79), (-1.24, 1.21), (-0.7, 0.22))),
    (Pose2(-0.48, 0.76, -2.6), ((-2.21, -0.31), (-2.16, 0.72), (-2.52, 0.03))),
]
FAR = (Pose2(-1.2, -0.56, 0.27), ((2.29, 0.3), (0.1, -0.18), (0.35, -0.05)))
# beside the goal, and how far the prior is off: the far post would be the near one of a goal seen edge on
ASIDE = [(Pose2(2.33, 1.11, -1.43), (0.24, 0.0, -0.09)), (Pose2(2.31, 1.1, -1.5), (0.15, 0.2, -0.15))]
# a single post, and a finger's breadth of what may be its bar
ONE_POST = (Pose2(0.25, -0.92, 0.08), ((0.85, -0.76), (0.77, -0.91), (2.24, 0.45)))


@pytest.fixture(scope="module")
def estimator():
    return GoalPoseEstimator(FIELD, CAMERA)


def located(estimator, pose, others, off=(0.1, -0.1, 0.05)):
    """Estimates from noisy frames of one scene, under priors a little off."""
    robots = tuple(Robot(x, y, 0.15, 0.28) for x, y in others)
    image = render_pinhole(CAMERA, Scene(FIELD, (), robots, None, MATCH_LIGHT, MATCH_ROOM, 0.5), pose, supersample=2)
    off = np.array(off)
    return [
        estimator.locate(
            MATCH_SENSOR.expose(image, np.random.default_rng(seed)), Pose2(*(pose.array + (-1) ** seed * off))
        )
        for seed in range(FRAMES)
    ]


@pytest.mark.parametrize(
    ("pose", "others"), [HALF_HIDDEN[0], *(pytest.param(*one, marks=pytest.mark.slow) for one in HALF_HIDDEN[1:])]
)
def test_who_stands_before_a_post_is_not_taken_for_it(estimator, pose, others):
    """The slow cases, each a scene that once misled, alone find somebody who passes for a post."""
    estimates = located(estimator, pose, others)
    assert all(estimates)
    for estimate in estimates:
        off = estimate.pose.array - pose.array
        off[2] = wrap_angle(off[2])
        assert math.hypot(*off[:2]) < 0.3
        # 11.3: exceeded once in a hundred
        assert off @ np.linalg.solve(estimate.covariance, off) < 11.3


def test_half_a_goal_from_far_reports_less_than_the_prior_and_says_so(estimator):
    estimates = [estimate for estimate in located(estimator, *FAR) if estimate]
    assert estimates
    for estimate in estimates:
        assert math.sqrt(np.linalg.eigvalsh(estimate.covariance[:2, :2])[-1]) > PRIOR_STD_M


@pytest.mark.parametrize(("pose", "off"), ASIDE)
def test_a_post_is_not_a_goal_seen_edge_on(estimator, pose, off):
    for estimate in located(estimator, pose, (), off):
        assert not estimate or estimate.pose.error_to(pose)[0] < 0.3


def test_a_post_alone_is_no_half_goal(estimator):
    for estimate in located(estimator, *ONE_POST):
        assert not estimate
