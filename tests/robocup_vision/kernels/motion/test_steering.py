"""The memory of a way round, what it does to the choice of a command, and profiles grown by the robot's radius."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steering_twins import BINS, RADIUS, around, empty_profile, grown, plain_bin, sectors_of

from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.motion import moving_contact
from robocup_vision.kernels.motion import steering as kernels

seeds = st.integers(0, 2**32 - 1)
HERE = (0.0, 0.0)
RULES = kernels.Rules(
    speed=0.4, acceleration=0.3, dead_time=0.03, period=1 / 30, threshold=-1.0, step_m=0.004, levels=3,
    use_velocity=True, away_rad=math.pi / 3, other_side_rad=math.pi / 4, max_detour_rad=1.25 * math.pi,
)  # fmt: skip
# nothing moves
NOTHING = np.empty((0, moving_contact.COLUMNS))


def directions_of(count):
    angles = np.arange(count) * math.tau / count
    return kernels.Directions(angles, np.stack([np.cos(angles), np.sin(angles)], axis=1), np.empty(count))


def steer(velocity, target_distance, detour, range_m, count=24):
    """Return what is chosen for a target straight ahead by a robot that moves on as it does."""
    scan = kernels.Scan(around(len(range_m)), range_m, np.full(len(range_m), np.nan), sectors_of(len(range_m)))
    target = kernels.Target(0.0, target_distance, detour)
    for _ in range(2):  # measuring the sectors, and with those already measured
        given = (kernels.Motion(velocity, velocity), target, RULES, directions_of(count), scan)
        found = kernels.steer(*map(plain, given), RADIUS, plain(empty_profile()), NOTHING)
        np.testing.assert_array_equal(scan.known_bearing, scan.bearing)
    return found


@pytest.mark.parametrize(("side", "left_rad", "goes_left"), [(0.0, 0.6, False), (1.0, 0.6, True), (1.0, 2.0, False)])
def test_a_side_is_kept_unless_the_other_is_nearer_by_far(side, left_rad, goes_left):
    bearing = np.angle(np.exp(1j * around(64)))
    profile, smallest = grown(np.where((bearing > -0.3) & (bearing < left_rad), 0.3, 5.0))
    target = kernels.Target(0.0, math.inf, side)
    found = kernels.choose_direction(
        kernels.Motion(HERE, HERE), target, RULES, directions_of(72), profile, smallest, NOTHING
    )
    assert found[0] == 0
    assert (found[3] > 0) == goes_left


def test_an_obstacle_winds_the_detour_up_on_its_side_and_open_floor_unwinds_it():
    ahead = np.where(np.abs(np.angle(np.exp(1j * around(64)))) < 0.6, 0.3, 5.0)
    outcome, index, _, detour = steer(HERE, math.inf, 0.0, ahead)
    assert outcome == 0
    assert abs(detour) == pytest.approx(abs(math.remainder(index * math.tau / 24, math.tau)))
    # already on its way round to the left by more than the obstacle is wide
    found = steer(HERE, math.inf, 2.0, ahead)
    assert found[3] == pytest.approx(2.0)
    # moving it is unwound, slowly in the wide arc that it can drive at, faster in the arc of its own radius
    for speed, arc in ((0.3, 0.3), (0.1, RADIUS)):
        found = steer((speed, 0.0), math.inf, 2.0, np.full(64, 9.0))
        assert found[3] == pytest.approx(2.0 - speed / 30 / arc)


def test_away_from_the_goal_the_robot_is_slow_enough_to_turn_in_its_own_length():
    open_floor = np.full(64, 9.0)
    _, _, speed, _ = steer(HERE, math.inf, 2.0, open_floor)
    assert speed**2 / RULES.acceleration == pytest.approx(2 * RADIUS)
    _, _, speed, _ = steer(HERE, math.inf, 0.5, open_floor)
    assert speed == RULES.speed


def test_a_long_detour_to_one_side_is_one_to_the_other():
    # only the way back is free, and it lies beyond 225 degrees of the detour's own side
    back = np.where(np.abs(np.angle(np.exp(1j * (around(64) + 0.8)))) < 1.2, 5.0, 0.095)
    found = steer(HERE, math.inf, 3.9, back)
    assert found[0] == 0
    assert -math.pi < found[3] < 0.0


def test_a_goal_in_sight_ends_the_detour():
    found = steer(HERE, 1.0, 2.0, np.full(64, 5.0))
    assert found[1] == 0
    assert found[3] == 0.0
    found = steer(HERE, 5.5, 2.0, np.full(64, 5.0))
    assert found[3] == 2.0


def plain_growth(range_m, bearing):
    """Smallest centre range at which the disc touches any sector's arc, along `bearing` (N,): no bins."""
    bearing_rad = around(range_m.shape[0])
    reach = np.maximum(range_m, RADIUS)
    off = np.abs((np.subtract.outer(bearing, bearing_rad) + math.pi) % math.tau - math.pi)
    off = np.maximum(off - math.pi / range_m.shape[0], 0.0)
    beside = reach * np.sin(off)
    touch = reach * np.cos(off) - np.sqrt(np.maximum(RADIUS**2 - beside**2, 0.0))
    return np.where((off < math.pi / 2) & (beside <= RADIUS), touch, np.inf).min(axis=1)


def profile_at(profile, bearing):
    return profile.ranges[plain_bin(np.cos(bearing), np.sin(bearing))]


@given(seeds, st.sampled_from([3, 8, 32, 37, 64]))
def test_grown_profile_is_never_beyond_and_hardly_before_the_exact_one(seed, count):
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.02, 1.5, count)
    profile, smallest = grown(range_m)
    assert smallest == profile.ranges.min()
    bearing = rng.uniform(-math.pi, math.pi, 40)
    value = profile_at(profile, bearing)
    assert (value <= plain_growth(range_m, bearing) + 1e-9).all()
    # A bin holds the least within itself, and it is at most 2 * 4 / BINS wide in bearing.
    beside = np.linspace(-8 / BINS, 8 / BINS, 33)
    least = plain_growth(range_m, np.add.outer(bearing, beside).ravel()).reshape(40, 33).min(axis=1)
    assert (value >= least - 1e-9 - 0.002).all()


def test_unmeasured_bearings_block_themselves_only():
    one, _ = grown(np.where(np.arange(32) == 5, np.nan, np.inf))
    middle = 5 * math.tau / 32
    assert profile_at(one, middle) == 0.0
    assert profile_at(one, middle + 0.2) == math.inf
    pinhole, _ = grown(np.full(9, np.inf), np.linspace(-0.4, 0.4, 9))
    assert profile_at(pinhole, 0.0) == math.inf
    assert profile_at(pinhole, 0.5) == profile_at(pinhole, math.pi) == 0.0
