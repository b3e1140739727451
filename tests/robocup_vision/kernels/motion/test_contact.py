"""Trajectories against the integral of their law, and times to contact against fine sampling."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import BINS, RADIUS, grown, plain_bin, plain_positions, with_minima

from robocup_vision.kernels.motion import trajectories as kernels
from robocup_vision.kernels.motion.contact_times import LANES, contact_time, contact_times
from robocup_vision.kernels.motion.moving_contact import moving_contact_then_stop, moving_contact_time

seeds = st.integers(0, 2**32 - 1)
speeds = st.floats(-1.5, 1.5)
places = st.floats(-0.5, 0.5)
HERE = (0.0, 0.0)


def integrate(start, velocity, target, acceleration, t, steps=4000):
    """Place and velocity after t seconds: eq. 10 integrated by the trapezoid rule."""
    velocity, target = np.array(velocity), np.array(target)
    dv = target - velocity
    size = np.hypot(*dv)
    times = np.linspace(0.0, t, steps)
    share = np.minimum(acceleration * times / size, 1.0) if size > 0 else np.zeros(steps)
    speeds = velocity + share[:, None] * dv
    moved = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)[:, None]
    return np.array(start) + moved.sum(axis=0), speeds[-1]


@given(places, places, speeds, speeds, speeds, speeds, st.floats(0.2, 5.0), st.floats(0.0, 6.0))
def test_prediction_is_the_integral_of_the_velocity_law(x, y, vx, vy, tx, ty, acceleration, t):
    place, velocity = integrate((x, y), (vx, vy), (tx, ty), acceleration, t)
    predicted = kernels.predict_position((x, y), (vx, vy), (tx, ty), acceleration, t)
    np.testing.assert_allclose(predicted, place, atol=2e-5)
    predicted = kernels.predict_velocity((vx, vy), (tx, ty), acceleration, t)
    np.testing.assert_allclose(predicted, velocity, atol=1e-9)


def any_profile(rng):
    if rng.random() < 0.5:
        return grown(rng.uniform(0.1, rng.uniform(0.2, 1.5), 32))
    # thinner things than any disc leaves, so that no step may be too long
    return with_minima(np.where(rng.random(BINS) < 0.03, rng.uniform(0.05, 1.0, BINS), 2.0))


def plain_blocked(start, velocity, target, acceleration, profile, times):
    x, y = plain_positions(start, velocity, target, acceleration, times).T
    r = np.hypot(x, y)
    return (r > 1e-12) & (r >= profile.ranges[plain_bin(x, y)])


@settings(max_examples=60)
@given(seeds, st.sampled_from([0.3, 1.2, 4.0]), st.sampled_from([0.001, 0.004, 0.02]))
def test_time_to_contact_agrees_with_fine_sampling(seed, acceleration, step_m):
    rng = np.random.default_rng(seed)
    profile, smallest = any_profile(rng)
    start = HERE if rng.random() < 0.5 else tuple(rng.uniform(-0.02, 0.02, 2))
    velocity, target = tuple(rng.uniform(-0.8, 0.8, 2)), tuple(rng.uniform(-0.8, 0.8, 2))
    fastest = max(math.hypot(*velocity), math.hypot(*target))
    found = contact_time(start, velocity, target, acceleration, 2.0, step_m, profile, smallest)
    spacing_m = 0.05 * step_m
    times = np.arange(0.0, 2.0, spacing_m / fastest)
    blocked = plain_blocked(start, velocity, target, acceleration, profile, times)
    # Samples may jump over a corner of the profile, but over less than a step.
    edges = np.flatnonzero(np.diff(np.concatenate([[0], blocked[times < found], [0]])))
    assert (np.diff(edges)[::2] * spacing_m <= step_m + spacing_m).all()
    # And what it reports as a contact is one, at most a tenth of a step later.
    if math.isfinite(found):
        after = found + np.linspace(0.0, 0.11 * step_m / fastest, 400)
        assert plain_blocked(start, velocity, target, acceleration, profile, after).any()


def test_nothing_that_stands_is_ever_touched_and_a_wall_ahead_at_its_time():
    profile, smallest = grown(np.full(64, 0.5))
    assert contact_time(HERE, (0.0, 0.0), (0.0, 0.0), 0.3, 9.0, 0.004, profile, smallest) == math.inf
    for start in (0.0, 0.1):
        found = contact_time((start, 0.0), (0.4, 0.0), (0.4, 0.0), 0.3, 9.0, 0.004, profile, smallest)
        assert (0.5 - start - RADIUS - 0.0005) / 0.4 <= found <= (0.5 - start - RADIUS) / 0.4
    assert contact_time(HERE, (0.4, 0.0), (0.4, 0.0), 0.3, 1.0, 0.004, profile, smallest) == math.inf


@settings(max_examples=60)
@given(seeds, st.sampled_from([0, 1, LANES, 2 * LANES + 3, 80]), st.sampled_from([0.001, 0.02]))
def test_each_time_is_that_of_the_command_alone(seed, count, step_m):
    rng = np.random.default_rng(seed)
    profile, smallest = any_profile(rng)
    start = HERE if rng.random() < 0.5 else tuple(rng.uniform(-0.3, 0.3, 2))
    velocities, targets = rng.uniform(-0.8, 0.8, (2, 2, count))
    still, same = rng.random((2, count)) < 0.1
    targets[:, still], velocities[:, still] = 0.0, 0.0
    velocities[:, same] = targets[:, same]
    horizons, found = rng.uniform(0.0, 3.0, count), np.empty(count)
    acceleration = rng.uniform(0.2, 4.0)
    contact_times(start, velocities, targets, acceleration, horizons, step_m, profile, smallest, found)
    alone = [
        contact_time(start, tuple(velocity), tuple(target), acceleration, horizon, step_m, profile, smallest)
        for velocity, target, horizon in zip(velocities.T, targets.T, horizons, strict=True)
    ]
    np.testing.assert_array_equal(found, alone)


STEP_M = 0.004


def plain_time(start, velocity, target, acceleration, begin, horizon, moving):
    """First of many samples at which the robot is nearer than it may be, and by how much it ever is nearer at most."""
    times = np.linspace(0.0, horizon, 4001)
    own = plain_positions(start, velocity, target, acceleration, times)
    first, deepest = math.inf, -math.inf
    for x, y, vx, vy, keep, std, velocity_std, most in moving:
        at = np.array([x, y]) + (times + begin)[:, None] * [vx, vy]
        away = np.hypot(*(own - at).T)
        wanted = keep + np.minimum(np.hypot(std, velocity_std * (times + begin)), most)
        if away[0] < wanted[0]:
            wanted = np.minimum(wanted, away[0] - STEP_M)
        deepest = max(deepest, float((wanted - away).max()))
        inside = np.flatnonzero(away < wanted)
        if len(inside):
            first = min(first, float(times[inside[0]]))
    return first, deepest


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_the_time_of_contact_is_that_of_fine_samples_and_never_late(seed):
    rng = np.random.default_rng(seed)
    start, velocity, target = (tuple(rng.uniform(-0.6, 0.6, 2)) for _ in range(3))
    begin, horizon, acceleration = rng.uniform(0, 0.1), rng.uniform(0.2, 1.5), rng.uniform(0.3, 3.0)
    moving = np.column_stack(
        [
            rng.uniform(-1, 1, (3, 2)),
            rng.uniform(-1, 1, (3, 2)),
            np.full(3, 0.2),
            rng.uniform(0, 0.1, (3, 2)),
            np.full(3, 0.05),
        ]
    )
    found = moving_contact_time(start, velocity, target, acceleration, begin, horizon, STEP_M, moving)
    expected, deepest = plain_time(start, velocity, target, acceleration, begin, horizon, moving)
    if math.isinf(expected):
        # a touch of less than a sample's depth may be told either way
        assert math.isinf(found) or deepest > -STEP_M
    elif math.isinf(found):
        assert deepest < STEP_M
    else:
        assert found <= expected + horizon / 4000
        # early by no more than a step at the slowest approach; checked where the approach is quick
        assert found >= 0.0


def test_who_is_too_near_may_leave_but_not_come_nearer():
    near = np.array([[0.15, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0]])
    assert math.isinf(moving_contact_time(HERE, (-0.3, 0.0), (-0.3, 0.0), 1.0, 0.0, 1.0, STEP_M, near))
    assert moving_contact_time(HERE, (0.3, 0.0), (0.3, 0.0), 1.0, 0.0, 1.0, STEP_M, near) < 0.1
    # nothing that stands is in anybody's way
    assert math.isinf(moving_contact_time(HERE, HERE, HERE, 1.0, 0.0, 1.0, STEP_M, near))


def test_a_trajectory_is_judged_until_the_robot_stands_and_no_longer():
    # stops at 0.5 * 0.2 + 0.5^2 / 2 = 0.225 m, after 0.2 + 0.5 s
    def told(x, vx=0.0, y=0.0, vy=0.0):
        table = np.array([[x, y, vx, vy, 0.2, 0.0, 0.0, 0.0]])
        return moving_contact_then_stop(HERE, (0.5, 0.0), (0.5, 0.0), 1.0, 0.0, 0.2, STEP_M, table)

    assert math.isinf(told(0.44))
    assert 0.2 < told(0.41) < 0.7
    # it drives over the place where the robot stands, but later
    assert math.isinf(told(0.225, y=-1.0, vy=1.0))
    assert told(0.225, y=-0.8, vy=1.0) < 0.7
