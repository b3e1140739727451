"""The compiled choice of a command against whole arrays, and the memory of a way round."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import RADIUS, around, empty_profile, grown, plain_positions, sectors_of

from robocup_vision.kernels.motion import moving_contact, trajectories
from robocup_vision.kernels.motion import steering as kernels

seeds = st.integers(0, 2**32 - 1)
HERE = (0.0, 0.0)
RULES = kernels.Rules(
    speed=0.4, acceleration=0.3, dead_time=0.03, period=1 / 30, threshold=-1.0, step_m=0.004, levels=3,
    use_velocity=True, away_rad=math.pi / 3, other_side_rad=math.pi / 4, max_detour_rad=1.25 * math.pi,
)  # fmt: skip
# nothing moves
NOTHING = np.empty((0, moving_contact.COLUMNS))


def plain_choice(motion, wanted, target_distance, side, rules, directions, profile, smallest):
    """Take Steps 3 to 5 with whole arrays; the contact times come from the kernel, which has a test of its own."""
    velocity, pending = motion
    speed, acceleration, dead_time, period, threshold, step_m, levels, use_velocity = rules[:8]
    units = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    if math.isfinite(target_distance):
        lag = acceleration * (dead_time + period)
        speed = min(speed, math.sqrt(lag**2 + 2 * acceleration * target_distance) - lag)

    def contact(start, a, b, horizon):
        return trajectories.contact_time(start, a, b, acceleration, horizon, step_m, profile, smallest)

    coasted = contact(HERE, velocity, pending, dead_time)
    start = trajectories.predict_position(HERE, velocity, pending, acceleration, dead_time)
    obeying = trajectories.predict_velocity(velocity, pending, acceleration, dead_time)
    turned = directions - wanted % math.tau
    turned = np.where(turned >= math.pi, turned - math.tau, np.where(turned < -math.pi, turned + math.tau, turned))
    ahead = np.abs(turned) <= math.pi / directions.shape[0] * 1.001
    away = np.abs(turned) + np.where((turned * side < 0) & ~ahead, rules.other_side_rad, 0.0)
    contacts, taken = [], None
    for slower in speed * 0.5 ** np.arange(levels):
        targets = slower * units
        present = np.broadcast_to(obeying, targets.shape) if use_velocity else targets
        settle = np.hypot(*(targets - present).T) / acceleration
        needed = 2 * dead_time + period + settle + slower / (2 * acceleration)
        if threshold >= 0:
            needed = np.full_like(needed, threshold)
        times, passed = [], []
        for a, b, n in zip(present, targets, needed, strict=True):
            if not use_velocity:
                t = contact(HERE, tuple(b), tuple(b), 1.1 * n)
                place = b * min(t, 1e6)
            else:
                late = max(1.1 * n - dead_time, 0.0)
                t = coasted if coasted < math.inf else dead_time + contact(start, tuple(a), tuple(b), late)
                place = plain_positions(start, a, b, acceleration, np.array([min(t, 1e6) - dead_time]))[0]
            times.append(t)
            passed.append(np.hypot(*place) if t >= dead_time else -1.0)
        times = np.array(times)
        contacts.append(times)
        safe = (times >= needed) | (ahead & (np.array(passed) >= target_distance + slower**2 / (2 * acceleration)))
        if safe.any():
            best = safe & (away <= away[safe].min() + 1e-9)
            index = int(np.argmax(np.where(best, times, -1.0)))
            towards = slower * math.cos(min(away[index], math.pi))
            # a lower speed only where it is nearer to the goal, and sooner
            if taken is None or (away[index] < away[taken[0]] - 1e-9 and towards > taken[2]):
                taken = index, slower, towards
    if taken is not None:
        return (0, taken[0], taken[1], turned[taken[0]]), contacts[0]
    braking = coasted
    if braking == math.inf or not use_velocity:
        stop = math.hypot(*obeying) / acceleration if use_velocity else 0.0
        braking = dead_time + contact(start, obeying, HERE, stop)
    braking += 0.1 * step_m / max(speed, math.hypot(*velocity))
    index = int(np.argmax(contacts[0]))
    return ((2, index, speed, 0.0) if contacts[0][index] > braking else (1, -1, 0.0, 0.0)), contacts[0]


def directions_of(count):
    angles = np.arange(count) * math.tau / count
    return kernels.Directions(angles, np.stack([np.cos(angles), np.sin(angles)], axis=1), np.empty(count))


def steer(velocity, target_distance, detour, range_m, count=24):
    """Return what is chosen for a target straight ahead by a robot that moves on as it does."""
    scan = kernels.Scan(around(len(range_m)), range_m, np.full(len(range_m), np.nan), sectors_of(len(range_m)))
    target = kernels.Target(0.0, target_distance, detour)
    for _ in range(2):  # measuring the sectors, and with those already measured
        found = kernels.steer(
            kernels.Motion(velocity, velocity),
            target,
            RULES,
            directions_of(count),
            scan,
            RADIUS,
            empty_profile(),
            NOTHING,
        )
        np.testing.assert_array_equal(scan.known_bearing, scan.bearing)
    return found


@settings(deadline=None, max_examples=150)
@given(
    seeds,
    st.sampled_from([(0.4, 0.3), (1.5, 4.0)]),
    st.sampled_from([-1.0, 0.0, 1.0]),
    st.sampled_from([-1.0, 0.5]),
    st.booleans(),
    st.sampled_from([math.inf, 0.0, 0.2, 1.0]),
)
def test_choice_agrees_with_whole_arrays(seed, motion, side, threshold, use_velocity, target_distance):
    rng = np.random.default_rng(seed)
    speed, acceleration = motion
    rules = RULES._replace(speed=speed, acceleration=acceleration, threshold=threshold, use_velocity=use_velocity)
    directions = directions_of(24)
    moves = kernels.Motion(*(tuple(rng.uniform(-speed, speed, 2)) for _ in range(2)))
    # half the goals lie on a direction or between two, where choices tie
    wanted = rng.uniform(-4, 4) if rng.random() < 0.5 else rng.integers(-24, 24) * math.pi / 24
    profile, smallest = grown(rng.uniform(0.02, rng.uniform(0.1, 2.5), 32))
    expected, times = plain_choice(moves, wanted, target_distance, side, rules, directions.angles, profile, smallest)
    target = kernels.Target(wanted, target_distance, side)
    found = kernels.choose_direction(moves, target, rules, directions, profile, smallest, NOTHING)
    assert found[:2] == expected[:2]
    assert found[2:] == pytest.approx(expected[2:], abs=1e-12)
    np.testing.assert_allclose(directions.time_to_contact, times, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.floats(-7.0, 7.0), st.floats(0.0, 2.0), st.floats(0.05, 0.5))
def test_a_detour_is_unwound_towards_nothing_by_the_way_driven(detour, way_m, radius_m):
    left = kernels.unwind(detour, way_m, radius_m)
    assert abs(left) == pytest.approx(max(abs(detour) - way_m / radius_m, 0.0))
    assert left * detour >= 0.0
    half = kernels.unwind(detour, way_m / 2, radius_m)
    assert kernels.unwind(half, way_m / 2, radius_m) == pytest.approx(left, abs=1e-9)


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


def test_steering_refuses_bearings_that_do_not_ascend():
    scan = kernels.Scan(np.array([0.0, 2.0, 1.0]), np.ones(3), np.full(3, np.nan), sectors_of(3))
    found = kernels.steer(
        kernels.Motion(HERE, HERE), kernels.Target(0.0, math.inf, 1.0), RULES, directions_of(4), scan, RADIUS,
        empty_profile(), NOTHING,
    )  # fmt: skip
    assert found == (-1, -1, 0.0, 1.0)
