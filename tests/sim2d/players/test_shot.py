"""What a player makes of its belief when it holds the ball."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE, UNDECIDED
from sim2d.players.plan import Surroundings
from sim2d.players.shot import Shooter
from sim2d.robot_link import RobotLimits

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()


def track(number, x_m, y_m, vx_mps=0.0, vy_mps=0.0):
    covariance = np.diag([0.01, 0.01, 0.02, 0.02]) ** 2
    return Track(number, x_m, y_m, vx_mps, vy_mps, covariance, 0.99, 10, 0)


def around(pose, tracks=(), velocity_mps=(0.0, 0.0), age_s=0.0, floor=None):
    robot = PoseEstimate(pose, np.diag([0.01, 0.01, 0.02]) ** 2, 0.9, 0.5)
    return Surroundings(5.0, robot, velocity_mps, velocity_mps, tuple(tracks), age_s, floor)


def mouth_seen(state):
    cells = np.full((100, 100), state, dtype=np.uint8)
    return MapPicture(cells, (-1.0, -2.5), 0.05)


def test_a_goal_seen_empty_is_kicked_at_and_a_keeper_nobody_sees_reckoned_with():
    shooter = Shooter(FIELD, LIMITS, 1)
    assert shooter.plan(around(Pose2(0.7, 0.0, 0.0), floor=mouth_seen(FREE)), 0.0).chance_now > 0.99
    for floor in (None, mouth_seen(UNDECIDED)):
        assert shooter.plan(around(Pose2(0.7, 0.0, 0.0), floor=floor), 0.0).chance_now < 0.3
    # a map that does not reach so far says nothing either
    near = MapPicture(np.full((20, 20), FREE, dtype=np.uint8), (0.0, -0.5), 0.05)
    assert shooter.plan(around(Pose2(0.7, 0.0, 0.0), floor=near), 0.0).chance_now < 0.3


def test_a_keeper_that_is_seen_is_shot_past():
    keeper = track(1, 1.25, -0.06)
    past = Shooter(FIELD, LIMITS, 1).plan(around(Pose2(0.8, 0.0, 0.0), [keeper]), 0.0)
    assert past.chance_now < 0.5 < past.chance
    assert past.place_m[1] + (FIELD.length_m / 2 - past.place_m[0]) * math.tan(past.heading_rad) > 0.0


@given(st.floats(-0.4, 1.0), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3), st.floats(-1.0, 1.0))
def test_both_sides_shoot_alike(x_m, y_m, heading_rad, keeper_y_m, turn_rps):
    here = around(Pose2(x_m, y_m, heading_rad), [track(1, 1.25, keeper_y_m, 0.0, 0.2)], (0.2, 0.1), 0.05)
    there = around(
        Pose2(x_m, y_m, heading_rad).half_turn(), [track(1, -1.25, -keeper_y_m, 0.0, -0.2)], (-0.2, -0.1), 0.05
    )
    ours = Shooter(FIELD, LIMITS, 1).plan(here, turn_rps)
    theirs = Shooter(FIELD, LIMITS, -1).plan(there, turn_rps)
    # equal but for rounding, which may part two ways that are worth the same
    assert theirs.chance_now == pytest.approx(ours.chance_now, abs=1e-6)
    if theirs.action == ours.action:
        assert theirs.chance == pytest.approx(ours.chance, abs=0.02)


def test_a_kick_is_judged_where_it_will_go():
    shooter, seen = Shooter(FIELD, LIMITS, 1), mouth_seen(FREE)
    # turning left, the robot will face the goal's middle when the command works
    before, late_s = -0.1, LIMITS.dead_time_s + 1 / 60
    straight, turning = (
        shooter.plan(around(Pose2(0.7, 0.0, heading), floor=seen), rate)
        for heading, rate in ((0.0, 0.0), (before, -before / late_s))
    )
    assert turning.chance_now == pytest.approx(straight.chance_now, abs=1e-3)
    # driven aside, the ball flies askew
    at_post = math.atan2(FIELD.goals[0].width_m / 2, FIELD.length_m / 2 - 0.7)
    aside_mps = 1.5 * LIMITS.kick_speed_mps * math.tan(at_post)
    assert shooter.plan(around(Pose2(0.7, 0.0, 0.0), velocity_mps=(0.0, aside_mps), floor=seen), 0.0).chance_now < 0.1


def test_one_seen_a_while_ago_stands_where_it_has_gone():
    shooter = Shooter(FIELD, LIMITS, 1)
    comes = track(1, 1.0, 0.3, 0.0, -1.0)
    seen = mouth_seen(FREE)
    now, later = (shooter.plan(around(Pose2(0.7, 0.0, 0.0), [comes], age_s=age, floor=seen), 0.0) for age in (0.0, 0.2))
    assert later.chance_now < now.chance_now
