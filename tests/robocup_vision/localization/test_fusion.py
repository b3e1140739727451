"""One pose by several: products of Gaussians against their information form, and who agrees with whom."""

import math

import numpy as np
import pytest

from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.fusion import agrees, fused, is_unambiguous, largest_group, moved

WIDE = np.array([[0.04, 0.01, 0.002], [0.01, 0.02, -0.001], [0.002, -0.001, 0.003]])
TURNED = np.array([[0.01, -0.004, 0.001], [-0.004, 0.03, 0.002], [0.001, 0.002, 0.005]])


def estimate(*candidates, covariance=WIDE):
    return PoseEstimate(candidates[0], covariance, 0.8, 0.3, candidates)


def test_a_product_adds_information():
    one, other = estimate(Pose2(1.0, 0.5, 3.1)), estimate(Pose2(1.1, 0.4, -3.12), covariance=TURNED)
    together = fused(one, other)
    information = np.linalg.inv(WIDE) + np.linalg.inv(TURNED)
    offset = np.array([0.1, -0.1, math.tau - 6.22])
    mean = np.linalg.solve(information, np.linalg.solve(TURNED, offset))
    assert together.covariance == pytest.approx(np.linalg.inv(information))
    assert together.pose.x_m == pytest.approx(1.0 + mean[0])
    assert together.pose.y_m == pytest.approx(0.5 + mean[1])
    assert together.pose.theta_rad == pytest.approx(Pose2(0, 0, 3.1 + mean[2]).theta_rad)


def test_the_order_of_two_does_not_matter():
    one, other = estimate(Pose2(1.0, 0.5, 0.1)), estimate(Pose2(1.1, 0.4, 0.2), covariance=TURNED)
    first, second = fused(one, other), fused(other, one)
    assert first.pose.array == pytest.approx(second.pose.array)
    assert first.covariance == pytest.approx(second.covariance)


def test_a_camera_that_tells_the_half_decides_for_both():
    pose = Pose2(1.0, 0.5, 0.1)
    both, one = estimate(pose, pose.half_turn()), estimate(pose.half_turn())
    together = fused(both, one)
    assert len(together.candidates) == 1
    assert together.pose.array == pytest.approx(pose.half_turn().array)
    # both half turns stay where nothing tells, the first one's order too
    assert len(fused(both, both).candidates) == 2
    assert fused(both, both).pose.array == pytest.approx(pose.array)


def test_places_apart_are_not_one():
    assert fused(estimate(Pose2(0, 0, 0)), estimate(Pose2(2.0, 0, 0))) is None
    assert not agrees(estimate(Pose2(0, 0, 0)), estimate(Pose2(0, 0, 1.0)))


def test_most_decide_and_else_the_prior():
    here, there = estimate(Pose2(0, 0, 0)), estimate(Pose2(2.0, 0, 0))
    near = estimate(Pose2(0.1, 0.1, 0.05))
    assert largest_group([here, there, near], None) == [[0, 2]]
    assert largest_group([here, there], None) == [[0], [1]]
    assert largest_group([here, there], estimate(Pose2(2.1, 0, 0))) == [[1]]


def test_a_half_turn_leaves_no_choice_and_another_place_does():
    pose = Pose2(1.0, 0.5, 0.1)
    assert is_unambiguous(estimate(pose, pose.half_turn()))
    assert not is_unambiguous(estimate(pose, Pose2(-1.0, 0.5, 0.1)))


def test_a_motion_moves_every_candidate_and_widens():
    pose, motion = Pose2(1.0, 0.5, 0.1), Pose2(0.2, 0.1, 0.3)
    after = moved(estimate(pose, pose.half_turn()), motion, np.diag([1e-4, 1e-4, 1e-4]))
    assert after.candidates == (pose.compose(motion), pose.half_turn().compose(motion))
    assert np.linalg.det(after.covariance) > np.linalg.det(WIDE)
