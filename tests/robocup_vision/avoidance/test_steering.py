"""Steering: growth, prediction and choice against plain twins and laws, and courses without a collision."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.avoidance import Steering, SteeringCommand
from robocup_vision.avoidance.steering import profile_edges
from robocup_vision.kernels import steering as kernels

RADIUS = 0.09
BINS, GROUPS = 512, 16
seeds = st.integers(0, 2**32 - 1)
speeds = st.floats(-1.5, 1.5)


def ranges(range_m, bearing_rad=None):
    range_m = np.asarray(range_m, dtype=float)
    if bearing_rad is None:
        bearing_rad = np.arange(range_m.shape[0]) * math.tau / range_m.shape[0]
    return SimpleNamespace(bearing_rad=np.asarray(bearing_rad, dtype=float), range_m=range_m)


def steering(**changes):
    return Steering(
        **({"robot_radius_m": RADIUS, "acceleration_mps2": 0.3, "dead_time_s": 0.03, "speed_mps": 0.4} | changes)
    )


def grown(free):
    count = free.range_m.shape[0]
    sectors, sector_bins = np.empty((count, 4)), np.empty((count, 4), dtype=np.int64)
    profile, coarse = np.empty(BINS), np.empty(GROUPS)
    assert kernels.measure_sectors(free.bearing_rad, sectors, sector_bins, BINS)
    smallest = kernels.grow_profile(free.range_m, sectors, sector_bins, profile_edges(BINS), RADIUS, profile, coarse)
    return profile, coarse, smallest


def plain_growth(free, bearing):
    """Smallest centre range along `bearing` at which the disc touches any sector's arc: no bins, no neighbours."""
    half = math.pi / free.range_m.shape[0]
    least = math.inf
    for center, reach in zip(free.bearing_rad, free.range_m, strict=True):
        reach = max(reach, RADIUS)
        off = max(abs(math.remainder(bearing - center, math.tau)) - half, 0.0)
        beside = reach * math.sin(off)
        if off < math.pi / 2 and beside <= RADIUS:
            least = min(least, reach * math.cos(off) - math.sqrt(RADIUS**2 - beside**2))
    return least


def profile_at(profile, bearing):
    return profile[kernels._profile_bin.py_func(math.cos(bearing), math.sin(bearing), BINS)]


@settings(deadline=None, max_examples=30)
@given(seeds, st.sampled_from([3, 8, 32, 37, 64]))
def test_grown_profile_is_never_beyond_and_hardly_before_the_exact_one(seed, count):
    rng = np.random.default_rng(seed)
    free = ranges(rng.uniform(0.02, 1.5, count))
    profile, coarse, smallest = grown(free)
    assert smallest == profile.min()
    width = 4.0 / BINS
    for bearing in rng.uniform(-math.pi, math.pi, 40):
        value = profile_at(profile, bearing)
        assert value <= plain_growth(free, bearing) + 1e-9
        # A bin holds the least within itself, and it is at most `width` wide in bearing (2 width at its widest).
        around = min(plain_growth(free, bearing + s) for s in np.linspace(-2 * width, 2 * width, 33))
        assert value >= around - 1e-9 - 0.002
    group = profile.reshape(GROUPS, -1).min(axis=1)
    np.testing.assert_array_equal(coarse, np.minimum(np.minimum(group, np.roll(group, 1)), np.roll(group, -1)))


def test_disc_touches_a_facing_obstacle_one_radius_before_it_and_a_wall_behind_blocks_nothing():
    free = ranges(np.where(np.arange(64) == 0, 0.5, np.inf))
    profile, _, _ = grown(free)
    assert profile_at(profile, 0.0) == pytest.approx(0.41)
    assert profile_at(profile, math.pi) == math.inf
    touching, _, _ = grown(ranges(np.where(np.arange(64) == 0, 0.05, np.inf)))
    assert profile_at(touching, 0.3) == 0.0
    assert profile_at(touching, math.pi) == math.inf


def test_unmeasured_bearings_block_themselves_only():
    one, _, _ = grown(ranges(np.where(np.arange(32) == 5, np.nan, np.inf)))
    middle = 5 * math.tau / 32
    assert profile_at(one, middle) == 0.0
    assert profile_at(one, middle + 0.2) == math.inf
    pinhole, _, _ = grown(ranges(np.full(9, np.inf), np.linspace(-0.4, 0.4, 9)))
    assert profile_at(pinhole, 0.0) == math.inf
    assert profile_at(pinhole, 0.5) == profile_at(pinhole, math.pi) == 0.0


def integrate(velocity, target, acceleration, dead_time, t, steps=4000):
    """Eq. 10 integrated by the trapezoid rule after a dead time at the present velocity."""
    velocity, target = np.array(velocity), np.array(target)
    dv = target - velocity
    size = np.hypot(*dv)
    times = np.linspace(0.0, max(t - dead_time, 0.0), steps)
    share = np.minimum(acceleration * times / size, 1.0) if size > 0 else np.zeros(steps)
    speeds = velocity + share[:, None] * dv
    moved = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)[:, None]
    return velocity * min(t, dead_time) + moved.sum(axis=0)


@settings(deadline=None, max_examples=60)
@given(speeds, speeds, speeds, speeds, st.floats(0.2, 5.0), st.floats(0.0, 0.2), st.floats(0.0, 6.0))
def test_prediction_is_the_integral_of_the_velocity_law(vx, vy, tx, ty, acceleration, dead_time, t):
    predicted = kernels.predict_position((vx, vy), (tx, ty), acceleration, dead_time, t)
    np.testing.assert_allclose(predicted, integrate((vx, vy), (tx, ty), acceleration, dead_time, t), atol=2e-5)


@settings(deadline=None, max_examples=60)
@given(speeds, speeds, speeds, speeds, st.floats(0.2, 5.0), st.floats(0.0, 0.2))
def test_position_and_velocity_are_continuous_and_acceleration_is_limited(vx, vy, tx, ty, acceleration, dead_time):
    settle = math.hypot(tx - vx, ty - vy) / acceleration
    h = 1e-4
    times = np.concatenate([np.linspace(0.01, dead_time + settle + 0.5, 50), [dead_time + 0.01, dead_time + settle]])
    for t in times[times > h]:
        before, now, after = (
            np.array(kernels.predict_position((vx, vy), (tx, ty), acceleration, dead_time, t + s)) for s in (-h, 0, h)
        )
        # The second difference bounds a jump in position and in velocity as well as the acceleration.
        assert np.hypot(*(after - 2 * now + before)) <= acceleration * h * h * 1.001 + 1e-12


def plain_contacts(velocity, target, horizon, profile, spacing_m):
    """Return times and whether each is blocked, sampled finely with the uncompiled functions."""
    times = np.arange(0.0, horizon, spacing_m / max(math.hypot(*velocity), math.hypot(*target), 1e-9))
    points = [kernels.predict_position.py_func(velocity, target, 1.2, 0.03, t) for t in times]
    return times, np.array(
        [(x or y) and math.hypot(x, y) >= profile[kernels._profile_bin.py_func(x, y, BINS)] for x, y in points],
        dtype=bool,
    )


@settings(deadline=None, max_examples=12)
@given(seeds)
def test_time_to_contact_agrees_with_fine_sampling(seed):
    rng = np.random.default_rng(seed)
    profile, coarse, smallest = grown(ranges(rng.uniform(0.15, 1.2, 32)))
    velocity, target = tuple(rng.uniform(-0.6, 0.6, 2)), tuple(rng.uniform(-0.6, 0.6, 2))
    fastest = max(math.hypot(*velocity), math.hypot(*target))
    found = kernels.contact_time(velocity, target, 1.2, 0.03, 2.0, 0.004, profile, coarse, smallest)
    times, blocked = plain_contacts(velocity, target, 2.0, profile, 2e-4)
    # Samples may jump over a corner of the profile, but over less than a step.
    jumped = longest = 0
    for stop in blocked[times < found]:
        jumped = jumped + 1 if stop else 0
        longest = max(longest, jumped)
    assert longest * 2e-4 <= 0.004 + 2e-4
    # And what it reports as a contact is one, at most a step later.
    if math.isfinite(found):
        assert blocked[(times >= found - 1e-9) & (times <= found + 0.004 / fastest)].any()


def test_open_floor_leads_to_the_goal():
    command = steering().steer(ranges(np.full(32, 5.0)), (0.0, 0.0), 0.5)
    assert isinstance(command, SteeringCommand)
    assert command.safe
    assert command.reason == "towards goal"
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


def test_velocity_is_what_tells_a_late_turn_from_an_early_one():
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


def test_a_goal_before_a_wall_is_reached_with_the_papers_threshold():
    scene = facing(0.6, half_width=1.0)
    papers = {"time_threshold_s": 2.75}
    assert steering(**papers).steer(scene, (0.0, 0.0), 0.0).reason == "around obstacle"
    command = steering(**papers).steer(scene, (0.0, 0.0), 0.0, goal_distance_m=0.2)
    assert command.safe
    assert command.reason == "towards goal"


@given(st.floats(0.0, 3.0))
@settings(deadline=None)
def test_speed_near_the_goal_allows_a_stop_there(distance):
    speed = np.hypot(*steering().steer(ranges(np.full(32, 9.0)), (0.0, 0.0), 0.0, distance).velocity_mps)
    assert speed <= min(0.4, math.sqrt(2 * 0.3 * distance)) + 1e-12
    assert speed * (0.03 + 1 / 30) + speed**2 / 0.6 <= distance + 1e-12


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
    ("change", "message"),
    [
        ({"robot_radius_m": 0.0}, "robot_radius_m must be at least"),
        ({"acceleration_mps2": -1.0}, "acceleration_mps2 must be at least"),
        ({"dead_time_s": math.nan}, "dead_time_s must be at least"),
        ({"speed_mps": math.inf}, "speed_mps must be at least"),
        ({"time_threshold_s": -1.0}, "time_threshold_s must be at least"),
        ({"directions": 3}, "directions must be at least 4, got 3"),
    ],
)
def test_bad_parameters_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        steering(**change)


@pytest.mark.parametrize(
    ("free", "velocity", "goal", "distance", "message"),
    [
        (ranges([1.0, 1.0], [0.0, 1.0]), (0, 0), 0.0, None, "J at least 3"),
        (ranges([1.0, 1.0, 1.0], [0.0, 1.0]), (0, 0), 0.0, None, "J at least 3"),
        (ranges([1.0] * 3, [0.0, 2.0, 1.0]), (0, 0), 0.0, None, "ascend within one turn"),
        (ranges([1.0] * 3, [0.0, 1.0, math.nan]), (0, 0), 0.0, None, "ascend within one turn"),
        (ranges([1.0] * 3), (0, 0, 0), 0.0, None, "velocity_mps must be two numbers"),
        (ranges([1.0] * 3), (0, math.nan), 0.0, None, "velocity_mps must be finite"),
        (ranges([1.0] * 3), (0, 0), math.inf, None, "goal_bearing_rad must be finite"),
        (ranges([1.0] * 3), (0, 0), 0.0, -1.0, "goal_distance_m must not be negative"),
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
