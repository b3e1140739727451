"""What wheels tell: a robot's velocity, and whom it has bumped into."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from sim2d.players.driving.motion import Motion
from sim2d.players.driving.wheels import Bumps, WheelVelocity
from sim2d.players.plan import Plan
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits

PERIOD = 1 / 30


@given(st.floats(0.1, 1.0), st.floats(-3.0, 3.0), st.floats(0.3, 4.0))
def test_a_robot_that_speeds_up_is_known_to_be_faster_than_its_mean(speed, bearing, acceleration):
    wheels = WheelVelocity(RobotLimits(acceleration_mps2=acceleration))
    unit = (math.cos(bearing), math.sin(bearing))
    wheels.command((speed * unit[0], speed * unit[1]))
    wheels.sense(Pose2(0.0, 0.0, 0.0))
    assert wheels.now_mps == (0.0, 0.0)
    now = 0.0
    for _ in range(5):
        wheels.command((speed * unit[0], speed * unit[1]))
        then = min(now + acceleration * PERIOD, speed)
        mean = (now + then) / 2
        wheels.sense(Pose2(mean * PERIOD * unit[0], mean * PERIOD * unit[1], 0.0))
        now = then
        error = math.dist(wheels.now_mps, (now * unit[0], now * unit[1]))
        # exact while it speeds up, and where the speed is reached within the period nearly so
        assert error < acceleration * PERIOD / 2
    assert wheels.pending_mps == (speed * unit[0], speed * unit[1])


def test_a_turning_robot_sees_its_velocity_turn_the_other_way():
    wheels = WheelVelocity(RobotLimits())
    for _ in range(2):
        wheels.command((0.6, 0.0))
    wheels.sense(Pose2(0.6 * PERIOD, 0.0, 0.2))
    assert math.hypot(*wheels.now_mps) == pytest.approx(0.6)
    assert math.atan2(wheels.now_mps[1], wheels.now_mps[0]) == pytest.approx(-0.2)


def test_with_a_short_dead_time_the_newest_command_counts():
    wheels = WheelVelocity(RobotLimits(dead_time_s=0.0, acceleration_mps2=1.2))
    wheels.command((1.0, 0.0))
    wheels.sense(Pose2(0.0, 0.0, 0.0))
    assert wheels.now_mps == (pytest.approx(1.2 * PERIOD / 2), 0.0)


LIMITS = RobotLimits()
STILL = Pose2(0.0, 0.0, 0.0)
OPEN = FreeSpace(np.linspace(-math.pi, math.pi, 72, endpoint=False), np.full(72, 3.0))


def step(speed_mps, bearing_rad):
    """Return a period's odometry of a robot that drives so fast in a direction."""
    way_m = speed_mps * CONTROL_PERIOD_S
    return Pose2(way_m * math.cos(bearing_rad), way_m * math.sin(bearing_rad), 0.0)


@given(st.floats(-3.1, 3.1), st.floats(0.1, 1.0), st.floats(0.0, 1.0))
def test_only_what_the_motors_cannot_do_is_a_jolt(bearing_rad, speed_mps, left_over):
    wheels = WheelVelocity(LIMITS)
    unit = math.cos(bearing_rad), math.sin(bearing_rad)
    gained_mps = LIMITS.acceleration_mps2 * CONTROL_PERIOD_S
    now_mps = 0.0
    # a dead time
    wheels.command((speed_mps * unit[0], speed_mps * unit[1]))
    wheels.sense(STILL)
    while now_mps < speed_mps:
        wheels.command((speed_mps * unit[0], speed_mps * unit[1]))
        then_mps = min(now_mps + gained_mps, speed_mps)
        wheels.sense(step((now_mps + then_mps) / 2, bearing_rad))
        now_mps = then_mps
        assert wheels.jolt_mps == (0.0, 0.0)
    for _ in range(2):
        wheels.command((speed_mps * unit[0], speed_mps * unit[1]))
        wheels.sense(step(speed_mps, bearing_rad))
    wheels.sense(step(left_over * speed_mps, bearing_rad))
    jolt_mps = max((1 - left_over) * speed_mps - gained_mps, 0.0)
    assert wheels.jolt_mps == pytest.approx((-jolt_mps * unit[0], -jolt_mps * unit[1]), abs=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(0.05, 0.5))
def test_a_robot_that_was_touched_stands_where_the_jolt_came_from(bearing_rad, size_mps):
    bumps = Bumps(LIMITS.radius_m)
    bumps.move(STILL, (-size_mps * math.cos(bearing_rad), -size_mps * math.sin(bearing_rad)), 0.0)
    (disc,) = bumps.discs
    away_m = 2 * LIMITS.radius_m
    assert (disc.x_m, disc.y_m) == pytest.approx((away_m * math.cos(bearing_rad), away_m * math.sin(bearing_rad)))
    blocked = bumps.block(OPEN)
    off_rad = np.abs(np.remainder(OPEN.bearing_rad - bearing_rad + math.pi, math.tau) - math.pi)
    # from a diameter away a robot is a third of a right angle wide to either side
    np.testing.assert_array_equal(blocked.range_m < 3.0, off_rad < math.pi / 6)
    assert blocked.range_m.min() == pytest.approx(LIMITS.radius_m, rel=0.02)


def test_it_stays_behind_as_the_robot_drives_on_and_is_forgotten():
    bumps = Bumps(LIMITS.radius_m)
    bumps.move(STILL, (-0.1, 0.0), 0.0)
    bumps.move(Pose2(-0.05, 0.0, math.pi / 2), (0.0, 0.0), 0.5)
    (disc,) = bumps.discs
    assert (disc.x_m, disc.y_m) == pytest.approx((0.0, -2 * LIMITS.radius_m - 0.05))
    bumps.move(STILL, (-0.01, 0.0), 0.9)
    assert len(bumps.discs) == 1
    bumps.move(STILL, (0.0, 0.0), 1.1)
    assert bumps.discs == ()
    assert bumps.block(OPEN) is OPEN


def forward_mps(*, sees_ahead_only, **plan):
    """Speed ahead of a robot that was stopped dead by something before it, on a floor that looks free."""
    motion = Motion(LIMITS, np.random.default_rng(0), sees_ahead_only=sees_ahead_only)
    wanted, t_s = Plan("fetch", (2.0, 0.0), 0.0, close=True, **plan), 0.0
    for speed_mps in (0.02, 0.06, 0.10, 0.14, 0.18, 0.22, 0.0):
        motion.update(step(speed_mps, 0.0), t_s)
        command = motion.drive(wanted, STILL, OPEN, t_s)
        t_s += CONTROL_PERIOD_S
    return command.forward_mps


def test_who_sees_ahead_only_drives_no_more_at_whom_it_touched_but_with_the_ball():
    assert forward_mps(sees_ahead_only=False) > 0.25
    assert forward_mps(sees_ahead_only=True) < 0.05
    assert forward_mps(sees_ahead_only=True, holding=True) > 0.25
