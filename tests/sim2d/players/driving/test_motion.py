"""Driving: whom a robot pushes that has no safe way, with and without a plan of its way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.driving.motion import CALM_RPS, Motion, MotionSettings
from sim2d.players.driving.travel import Travel
from sim2d.players.plan import Plan
from sim2d.robot_link import RobotLimits

LIMITS = RobotLimits()
HEMMED_IN = FreeSpace(np.linspace(-math.pi, math.pi, 72, endpoint=False), np.full(72, 0.05))
TARGET = (0.5, 0.0)
PLANNED = Travel(TARGET, LIMITS.speed_mps, None, ())


def forward_mps(travel, apart_m, bearing_rad=0.0, *, holding=True):
    """Speed towards the target of a robot that has no safe way, one standing so far from its rim."""
    plan = Plan("dribble" if holding else "fetch", TARGET, 0.0, close=not holding, holding=holding)
    away = 2 * LIMITS.radius_m + apart_m
    place = away * math.cos(bearing_rad), away * math.sin(bearing_rad)
    other = Disc(*place, LIMITS.radius_m, 0.01**2 * np.eye(2), velocity_covariance=0.05**2 * np.eye(2))
    motion = Motion(LIMITS, np.random.default_rng(0))
    return motion.drive(plan, Pose2(0.0, 0.0, 0.0), HEMMED_IN, 0.0, [other], travel).forward_mps


def test_who_plans_pushes_nobody_and_who_does_not_pushes_on():
    assert forward_mps(None, 0.01) == pytest.approx(0.25)
    assert forward_mps(PLANNED, 0.01) <= 0.0
    assert forward_mps(PLANNED, 0.01, holding=False) <= 0.0


def test_who_races_for_the_ball_or_has_it_gives_way_to_nobody():
    pressing = replace(PLANNED, presses=True)
    assert forward_mps(pressing, 0.01) == pytest.approx(0.25)
    assert forward_mps(pressing, 0.01, holding=False) == pytest.approx(0.25)


def test_others_are_kept_farther_off_a_ball_that_is_held():
    assert forward_mps(PLANNED, 0.06) <= 0.0
    assert forward_mps(PLANNED, 0.06, holding=False) == pytest.approx(0.25)
    assert forward_mps(PLANNED, 0.15) == pytest.approx(0.25)


def test_who_plans_takes_the_ball_as_fast_as_it_can_be_held():
    open_floor = FreeSpace(HEMMED_IN.bearing_rad, np.full(72, 3.0))
    plan = Plan("dribble", (3.0, 0.0), 2.5, holding=True)
    carried = replace(PLANNED, waypoint=plan.target, turn_rps=4.0)

    def fastest(travel):
        command = Motion(LIMITS, np.random.default_rng(0)).drive(
            plan, Pose2(0.0, 0.0, 0.0), open_floor, 0.0, (), travel
        )
        return math.hypot(command.forward_mps, command.left_mps), command.turn_rps

    usual = MotionSettings()
    assert fastest(None) == (pytest.approx(usual.holding_mps), usual.holding_rps)
    assert fastest(carried) == (pytest.approx(LIMITS.speed_mps), 4.0)
    assert fastest(replace(carried, turn_rps=math.inf))[1] == LIMITS.turn_rps


def turn_rps(target, **plan):
    """Return the turning rate of a robot that sees ahead only and is to face along x at a target."""
    open_floor = FreeSpace(HEMMED_IN.bearing_rad, np.full(72, 3.0))
    motion = Motion(LIMITS, np.random.default_rng(0), sees_ahead_only=True)
    return motion.drive(Plan("support", target, 0.0, **plan), Pose2(0.0, 0.0, 0.0), open_floor, 0.0).turn_rps


def test_who_sees_ahead_only_turns_slowly_unless_the_ball_is_close():
    motion = Motion(LIMITS, np.random.default_rng(0), sees_ahead_only=True)
    all_around = Motion(LIMITS, np.random.default_rng(0))
    open_floor = FreeSpace(np.linspace(-3.0, 3.0, 60), np.full(60, 3.0))

    def fastest_rps(one, **plan):
        return one.drive(Plan("support", (0.1, 0.0), 2.5, **plan), Pose2(0.0, 0.0, 0.0), open_floor, 0.0).turn_rps

    assert fastest_rps(motion) == CALM_RPS < LIMITS.turn_rps
    assert fastest_rps(motion, close=True) == fastest_rps(all_around) == LIMITS.turn_rps
    assert fastest_rps(motion, close=True, holding=True) == MotionSettings().holding_rps


def test_who_sees_ahead_only_faces_its_way_until_it_is_nearly_there():
    assert turn_rps((0.0, 1.0)) > 1.0
    assert turn_rps((0.0, -1.0)) < -1.0
    assert turn_rps((0.0, 0.3)) == 0.0
    assert turn_rps((0.0, 1.0), holding=True) == turn_rps((0.0, 1.0), looks=True) == 0.0


def test_who_stands_by_its_target_is_not_stuck():
    bearing_rad, here = HEMMED_IN.bearing_rad, Pose2(0.0, 0.0, 0.0)
    open_behind = FreeSpace(bearing_rad, np.where(np.abs(bearing_rad) > 2.0, 2.0, 0.3))
    for away_m, escapes in ((0.05, False), (0.3, True)):
        motion, plan = Motion(LIMITS, np.random.default_rng(0)), Plan("keep", (away_m, 0.0), 0.0)
        driven_mps = []
        for k in range(60):
            motion.update(here, k / 30)
            driven_mps.append(motion.drive(plan, here, open_behind, k / 30).forward_mps)
        assert driven_mps[0] > 0.0
        assert (min(driven_mps) < -0.5) == escapes


def test_who_stands_aside_is_not_pushed_by_driving_on():
    assert forward_mps(PLANNED, 0.01, math.pi / 2) == pytest.approx(0.25)
