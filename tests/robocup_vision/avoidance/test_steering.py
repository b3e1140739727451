"""Steering: what is commanded in plain situations, bad input, and courses without a collision."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.avoidance import Steering, SteeringCommand, SteeringSettings
from robocup_vision.motion_limits import MotionLimits

RADIUS = 0.09


def ranges(range_m, bearing_rad=None):
    range_m = np.asarray(range_m, dtype=float)
    if bearing_rad is None:
        bearing_rad = np.arange(range_m.shape[0]) * math.tau / range_m.shape[0]
    return SimpleNamespace(bearing_rad=np.asarray(bearing_rad, dtype=float), range_m=range_m)


LIMITS = {"speed_mps": 0.4, "acceleration_mps2": 0.3, "dead_time_s": 0.03}


def steering(robot_radius_m=RADIUS, **changes):
    limits = {name: changes.pop(name, value) for name, value in LIMITS.items()}
    return Steering(robot_radius_m, MotionLimits(**limits), SteeringSettings(**changes))


def test_open_floor_leads_to_the_goal():
    command = steering().steer(ranges(np.full(32, 5.0)), (0.0, 0.0), 0.5)
    assert isinstance(command, SteeringCommand)
    assert command.safe
    assert command.reason == "towards target"
    assert abs(command.bearing_rad - 0.5) <= math.pi / 48
    assert np.hypot(*command.velocity_mps) == pytest.approx(0.4)
    assert command.time_to_contact_s.shape == command.directions_rad.shape == (48,)
    assert np.isinf(command.time_to_contact_s).all()
    for array in (command.velocity_mps, command.time_to_contact_s, command.directions_rad):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def facing(reach, half_width=0.5, count=64):
    off = np.abs(np.angle(np.exp(1j * np.arange(count) * math.tau / count)))
    return ranges(np.where(off < half_width, reach, 5.0))


def test_an_obstacle_ahead_is_passed_beside():
    command = steering().steer(facing(0.5), (0.0, 0.0), 0.0)
    assert command.safe
    assert command.reason == "around obstacle"
    assert 0.4 < abs(math.remainder(command.bearing_rad, math.tau)) < 1.6


def test_all_bearings_blocked_brakes_explicitly():
    for blocked in (np.zeros(32), np.full(32, np.nan), np.full(32, RADIUS)):
        command = steering().steer(ranges(blocked), (0.0, 0.0), 0.0)
        assert not command.safe
        assert command.bearing_rad is None
        assert command.reason == "no safe direction: braking"
        np.testing.assert_array_equal(command.velocity_mps, 0.0)


def test_too_fast_to_stop_before_a_wall_brakes_and_before_a_post_takes_the_latest_contact():
    wall = steering().steer(facing(0.25, half_width=1.2), (0.4, 0.0), 0.0)
    assert not wall.safe
    assert wall.reason == "no safe direction: braking"
    seen = np.full(64, 5.0)
    seen[1:3] = 0.25  # nearly passed already: turning away gains more than braking
    post = steering().steer(ranges(seen), (0.4, 0.0), 0.0)
    assert not post.safe
    assert post.reason == "no safe direction, braking would touch: latest contact"
    assert (
        post.time_to_contact_s[np.argmin(abs(post.directions_rad - post.bearing_rad))] == post.time_to_contact_s.max()
    )


def test_velocity_is_what_distinguishes_a_late_turn_from_an_early_one():
    scene = facing(0.45, half_width=0.3)
    standing = steering().steer(scene, (0.0, 0.0), 0.0)
    moving = steering().steer(scene, (0.4, 0.0), 0.0)
    blind = steering(use_velocity=False).steer(scene, (0.4, 0.0), 0.0)
    assert standing.safe
    assert blind.safe
    sideways = 12  # a quarter turn of 48 directions
    assert moving.time_to_contact_s[sideways] < 2.0 < blind.time_to_contact_s[sideways]


def test_contact_during_the_dead_time_counts():
    command = steering(dead_time_s=1.0).steer(facing(RADIUS + 0.1), (0.4, 0.0), 0.0)
    assert command.time_to_contact_s.max() <= 0.25 + 1e-9
    assert command.time_to_contact_s.min() >= 0.25 - 0.02
    assert not command.safe


def test_a_goal_before_a_wall_is_approached_at_speed_with_the_papers_threshold():
    scene = facing(0.6, half_width=1.0)
    papers = {"time_threshold_s": 2.75}
    unknown = steering(**papers).steer(scene, (0.0, 0.0), 0.0)
    known = steering(**papers).steer(scene, (0.0, 0.0), 0.0, target_distance_m=0.2)
    assert known.safe
    assert known.reason == "towards target"
    assert unknown.velocity_mps[0] <= 0.2 + 1e-12
    assert known.velocity_mps[0] > 0.3


def test_a_gap_too_tight_for_full_speed_is_entered_slowly():
    # the way back is free at any speed, the way to the goal ends in a wall
    fast = steering(speed_mps=1.5)
    command = fast.steer(facing(0.6, half_width=1.4), (0.0, 0.0), 0.0)
    assert command.safe
    assert command.reason == "towards target"
    assert 0.1 < np.hypot(*command.velocity_mps) < 0.5
    # and where something is nearer still, slower still
    nearer = fast.steer(facing(0.2, half_width=1.4), (0.0, 0.0), 0.0)
    assert nearer.reason == "towards target"
    assert 0.0 < np.hypot(*nearer.velocity_mps) < np.hypot(*command.velocity_mps)


def test_after_a_safe_command_braking_is_preferred_to_the_latest_contact():
    post = np.full(64, 5.0)
    post[1:3] = 0.25
    robot = steering()
    assert robot.steer(ranges(np.full(64, 5.0)), (0.4, 0.0), 0.0).safe
    for _ in range(2):
        assert robot.steer(ranges(post), (0.4, 0.0), 0.0).reason == "no safe direction: braking"
    robot.forget()
    assert robot.steer(ranges(post), (0.4, 0.0), 0.0).reason.endswith("latest contact")


@given(st.floats(0.0, 3.0))
def test_speed_near_the_goal_allows_a_stop_there(distance):
    speed = np.hypot(*steering().steer(ranges(np.full(32, 9.0)), (0.0, 0.0), 0.0, distance).velocity_mps)
    assert speed <= min(0.4, math.sqrt(2 * 0.3 * distance)) + 1e-12
    assert speed * (0.03 + 1 / 30) + speed**2 / 0.6 <= distance + 1e-12


def test_for_once_it_goes_no_faster_than_asked():
    steer = steering().steer
    free = ranges(np.full(64, 5.0))
    assert np.hypot(*steer(free, (0, 0), 0.3, speed_mps=0.25).velocity_mps) == pytest.approx(0.25)
    full = steer(free, (0, 0), 0.3).velocity_mps
    assert np.hypot(*full) == pytest.approx(0.4)
    assert np.array_equal(steer(free, (0, 0), 0.3, speed_mps=99.0).velocity_mps, full)
    with pytest.raises(ArgumentError, match="speed_mps must be positive, got 0"):
        steer(free, (0, 0), 0.3, speed_mps=0.0)


def test_side_is_kept_until_forgotten():
    left = facing(0.5)
    left.range_m[-8:] = 0.5
    right = facing(0.5)
    right.range_m[:9] = 0.5
    robot = steering()
    first = robot.steer(left, (0.0, 0.0), 0.0).velocity_mps[1]
    kept = robot.steer(right, (0.0, 0.0), 0.0).velocity_mps[1]
    robot.forget()
    fresh = robot.steer(right, (0.0, 0.0), 0.0).velocity_mps[1]
    assert first > 0
    assert kept > 0
    assert fresh < 0


@pytest.mark.parametrize(
    ("free", "velocity", "goal", "distance", "message"),
    [
        (ranges([1.0, 1.0], [0.0, 1.0]), (0, 0), 0.0, None, "J at least 3"),
        (ranges([1.0, 1.0, 1.0], [0.0, 1.0]), (0, 0), 0.0, None, "J at least 3"),
        (ranges([1.0] * 3, [0.0, 2.0, 1.0]), (0, 0), 0.0, None, "ascend within one turn"),
        (ranges([1.0] * 3, [0.0, 1.0, math.nan]), (0, 0), 0.0, None, "ascend within one turn"),
        (ranges([1.0] * 3), (0, 0, 0), 0.0, None, "velocity_mps must be two numbers"),
        (ranges([1.0] * 3), (0, math.nan), 0.0, None, "velocity_mps must be finite"),
        (ranges([1.0] * 3), (0, 0), math.inf, None, "target_bearing_rad must be finite"),
        (ranges([1.0] * 3), (0, 0), 0.0, -1.0, "target_distance_m must not be negative"),
    ],
)
def test_bad_input_is_named(free, velocity, goal, distance, message):
    with pytest.raises(ArgumentError, match=message):
        steering().steer(free, velocity, goal, distance)


@pytest.mark.parametrize(("speed", "acceleration"), [(0.4, 0.3), (0.8, 1.2), (1.5, 4.0)])
def test_a_robot_among_posts_never_touches_and_arrives(speed, acceleration):
    rng = np.random.default_rng(11)
    bearings = np.arange(64) * math.tau / 64
    for _ in range(3):
        posts = np.stack([np.linspace(-1.0, 1.0, 6), rng.uniform(-0.3, 0.3, 6)], axis=1)
        robot = steering(speed_mps=speed, acceleration_mps2=acceleration)
        position, velocity, command = np.array([-1.6, 0.0]), np.zeros(2), np.zeros(2)
        goal, dt, arrived = np.array([1.6, 0.0]), 1 / 300, False
        for _ in range(900):
            off = posts - position
            bearing, distance = np.arctan2(off[:, 1], off[:, 0]), np.hypot(off[:, 0], off[:, 1])
            apart = np.abs((bearings[:, None] - bearing + math.pi) % math.tau - math.pi) - math.pi / 64
            seen = np.where(apart <= np.arcsin(0.07 / distance), distance - 0.07, 3.0)
            to_goal = goal - position
            chosen = robot.steer(
                ranges(seen.min(axis=1)), velocity, math.atan2(to_goal[1], to_goal[0]), float(np.hypot(*to_goal))
            )
            for tick in range(10):
                if tick == 9:  # the dead time of 0.03 s
                    command = chosen.velocity_mps
                change = command - velocity
                size = np.hypot(*change)
                new = velocity + change * min(1.0, acceleration * dt / size) if size > 0 else velocity
                position = position + 0.5 * dt * (velocity + new)
                velocity = new
                assert np.hypot(*(posts - position).T).min() > RADIUS + 0.07
            arrived = arrived or np.hypot(*(goal - position)) < 0.05
            if arrived:
                break
        assert arrived


def test_a_target_in_degrees_is_refused():
    with pytest.raises(
        ArgumentError,
        match=r"target_bearing_rad must be in radians, within one turn, got 90.0; 90 degrees are 1.5708 rad",
    ):
        steering().steer(facing(0.5), (0.0, 0.0), 90.0)
    # what two directions may differ by is an angle
    near, far = (steering().steer(facing(0.5), (0.0, 0.0), one) for one in (0.3, 0.3 - math.tau))
    np.testing.assert_allclose(far.velocity_mps, near.velocity_mps)
