"""The velocity at the end of a period, from the mean over it and the commands under way."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from sim2d.players.driving.wheels import WheelVelocity
from sim2d.robot_link import RobotLimits

PERIOD = 1 / 30


@given(st.floats(0.1, 1.0), st.floats(-3.0, 3.0), st.floats(0.3, 4.0))
def test_a_robot_that_speeds_up_is_known_to_be_faster_than_its_mean(speed, bearing, acceleration):
    wheels = WheelVelocity(RobotLimits(acceleration_mps2=acceleration), PERIOD)
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
    wheels = WheelVelocity(RobotLimits(), PERIOD)
    for _ in range(2):
        wheels.command((0.6, 0.0))
    wheels.sense(Pose2(0.6 * PERIOD, 0.0, 0.2))
    assert math.hypot(*wheels.now_mps) == pytest.approx(0.6)
    assert math.atan2(wheels.now_mps[1], wheels.now_mps[0]) == pytest.approx(-0.2)


def test_with_a_short_dead_time_the_newest_command_counts():
    wheels = WheelVelocity(RobotLimits(dead_time_s=0.0, acceleration_mps2=1.2), PERIOD)
    wheels.command((1.0, 0.0))
    wheels.sense(Pose2(0.0, 0.0, 0.0))
    assert wheels.now_mps == (pytest.approx(1.2 * PERIOD / 2), 0.0)
