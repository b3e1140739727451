"""Speeds among known opponents: fast in the open, slow between two, none where even the slowest may touch."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import path_following as kernel
from robocup_vision.planning import Disc, MotionLimits, PathFollower, PoseNoise, SpeedPlanner

LIMITS = MotionLimits(1.5, 3.0)
FOLLOWER = PathFollower(LIMITS)
LOOK = np.diag([0.025, 0.025, 0.02]) ** 2
NOISE = PoseNoise(0.06, 0.12, LOOK)
PLANNER = SpeedPlanner(FOLLOWER, 0.09, NOISE, 0.8)
PATH = np.array([[0.0, 0.0], [4.0, 0.0]])


def pair(width, x=2.0):
    return [Disc(x, side * (width / 2 + 0.09), 0.09, 0.012**2 * np.eye(2)) for side in (-1, 1)]


def plan(x, discs, covariance=LOOK, velocity=(0.0, 0.0), **options):
    return PLANNER.plan(PATH, Pose2(x, 0.0, 0.0), covariance, velocity, discs, **options)


def test_in_the_open_it_goes_full_speed():
    assert plan(0.0, []).speed_mps == LIMITS.speed_mps
    assert plan(0.0, []).reason == "full speed: nothing near"
    assert plan(0.0, pair(0.4, 9.0)).reason.startswith("full speed: ")


def test_before_a_gap_it_slows_down_and_says_why():
    slow = plan(1.5, pair(0.45))
    assert slow.safe
    assert 0.0 < slow.speed_mps < 0.8 * LIMITS.speed_mps
    assert slow.reason == f"slow, {slow.speed_mps:.2f} m/s: gap 0.45 m, sigma 0.03 m"
    assert slow.clearance_m >= 0.0


def test_the_better_the_pose_the_sooner_the_look_and_the_wider_the_gap_the_faster():
    vague, sharp = (plan(1.6, pair(0.45), k * LOOK).speed_mps for k in (1.0, 0.1))
    assert vague < sharp
    assert plan(1.5, pair(0.45)).speed_mps < plan(1.5, pair(0.45), until_look_s=0.3).speed_mps
    speeds = [plan(1.4, pair(width), velocity=(0.3, 0.0)).speed_mps for width in np.linspace(0.36, 0.96, 13)]
    assert speeds == sorted(speeds)
    assert speeds[0] < speeds[4] < LIMITS.speed_mps == speeds[-1]


def test_below_two_widths_there_is_no_safe_speed():
    none = plan(1.95, pair(0.33))
    assert not none.safe
    assert none.speed_mps == 0.0
    assert none.clearance_m < 0.0
    assert none.reason == "no safe speed: gap 0.33 m, sigma 0.03 m"


@given(st.floats(0.005, 0.04), st.floats(0.002, 0.03))
def test_the_limit_is_what_three_deviations_of_pose_and_opponents_fill(pose_std, disc_std):
    """The robot and three standard deviations to either side; a little more for the way to the next look."""
    filled = 2 * 0.09 + 2 * 3 * math.hypot(pose_std, disc_std)
    planner = SpeedPlanner(FOLLOWER, 0.09, PoseNoise(0.0, 0.0, np.diag([pose_std, pose_std, 1e-4]) ** 2), 0.8)

    def safe(width):
        discs = [Disc(2.0, s * (width / 2 + 0.09), 0.09, disc_std**2 * np.eye(2)) for s in (-1, 1)]
        # near enough that the slowest speed brings it into the gap before the next look
        at = Pose2(2.0 - 0.05, 0.0, 0.0)
        return planner.plan(PATH, at, planner.noise.look_covariance, (0.0, 0.0), discs).safe

    assert not safe(filled - 0.002)
    assert safe(filled + 0.01)


def test_who_is_too_near_already_may_leave_but_not_come_nearer():
    near = [Disc(0.19, 0.0, 0.09, 0.012**2 * np.eye(2))]
    assert not plan(0.0, near).safe
    behind = [Disc(-0.19, 0.0, 0.09, 0.012**2 * np.eye(2))]
    away = plan(0.0, behind, 1e-4 * LOOK)
    assert away.safe
    assert away.speed_mps > 0.0


def test_a_single_opponent_is_named_by_its_place():
    alone = plan(1.4, [Disc(2.0, 0.1, 0.09, 0.012**2 * np.eye(2))], velocity=(0.3, 0.0))
    assert "opponent at (2.00, 0.10)" in alone.reason


@pytest.mark.parametrize("x", [0.0, 0.8, 1.2, 1.5, 1.7, 1.9])
@pytest.mark.parametrize("side", [-1, 1])
def test_after_a_safe_plan_it_gets_to_the_next_look_and_can_stop(x, side):
    """Wherever within three deviations of pose and odometry it is in truth."""
    discs = pair(0.5)
    speed = plan(x, discs).speed_mps
    assert speed > 0.0
    believed, truth, velocity, pending = (x, 0.0), (x, side * 3 * 0.025), (0.0, 0.0), (0.0, 0.0)
    for step in range(60):
        command = FOLLOWER.command(PATH, Pose2(*believed, 0.0), speed if step < 24 else 0.0)
        before = truth
        truth, velocity = kernel.drive(truth, velocity, pending, tuple(command), 3.0, 0.03, 1 / 30)
        pending = tuple(command)
        believed = (believed[0] + truth[0] - before[0], believed[1] + truth[1] - before[1])
        assert all(math.dist(truth, (d.x_m, d.y_m)) > d.radius_m + 0.09 for d in discs)


def test_the_command_is_in_the_robots_frame():
    turned = FOLLOWER.command(PATH, Pose2(1.0, 0.0, math.pi / 2), 0.5)
    np.testing.assert_allclose(turned, [0.0, -0.5], atol=1e-12)
    assert np.hypot(*FOLLOWER.command(PATH, Pose2(1.0, 0.0, 0.0), 9.0)) == pytest.approx(LIMITS.speed_mps)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PathFollower(LIMITS, ahead_s=0.0), "ahead_s must be positive"),
        (lambda: FOLLOWER.command(PATH[:1], Pose2(0, 0, 0), 1.0), r"a path must be \(P, 2\), P at least 2"),
        (lambda: PoseNoise(-0.1, 0.1, LOOK), "along must not be negative"),
        (lambda: PoseNoise(0.1, 0.1, np.eye(2)), r"look_covariance must be \(3, 3\)"),
        (lambda: SpeedPlanner(FOLLOWER, 0.0, NOISE, 0.5), "robot_radius_m must be positive"),
        (lambda: SpeedPlanner(FOLLOWER, 0.1, NOISE, math.inf), "look_period_s must be positive"),
        (lambda: plan(0.0, [], np.eye(2)), r"covariance must be \(3, 3\)"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
