"""The compiled loops of steering against plain NumPy twins and laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.avoidance.steering import profile_edges
from robocup_vision.kernels import steering as kernels

RADIUS = 0.09
BINS = kernels.BINS
EDGES = profile_edges(BINS)
seeds = st.integers(0, 2**32 - 1)
speeds = st.floats(-1.5, 1.5)


def around(count):
    return np.arange(count) * math.tau / count


def grown(range_m, bearing_rad=None):
    """Return the profile, its minima over fine and coarse groups, and the smallest."""
    range_m = np.asarray(range_m, dtype=float)
    bearing_rad = around(range_m.shape[0]) if bearing_rad is None else bearing_rad
    sectors, sector_bins = np.empty((range_m.shape[0], 4)), np.empty((range_m.shape[0], 4), dtype=np.int64)
    profile, fine, coarse = np.empty(BINS), np.empty(kernels.FINE), np.empty(kernels.COARSE)
    assert kernels.measure_sectors(bearing_rad, sectors, sector_bins)
    smallest = kernels.grow_profile(range_m, sectors, sector_bins, EDGES, RADIUS, profile, fine, coarse)
    return profile, fine, coarse, smallest


def plain_growth(range_m, bearing):
    """Smallest centre range at which the disc touches any sector's arc, along `bearing` (N,): no bins."""
    bearing_rad = around(range_m.shape[0])
    reach = np.maximum(range_m, RADIUS)
    off = np.abs((np.subtract.outer(bearing, bearing_rad) + math.pi) % math.tau - math.pi)
    off = np.maximum(off - math.pi / range_m.shape[0], 0.0)
    beside = reach * np.sin(off)
    touch = reach * np.cos(off) - np.sqrt(np.maximum(RADIUS**2 - beside**2, 0.0))
    return np.where((off < math.pi / 2) & (beside <= RADIUS), touch, np.inf).min(axis=1)


def plain_bin(x, y):
    """Bin of the directions (x, y): the diamond angle from the bearing by trigonometry."""
    quadrant, angle = np.divmod(np.arctan2(y, x) % math.tau, math.pi / 2)
    along = np.sin(angle) / (np.sin(angle) + np.cos(angle))
    return np.floor((quadrant + along) * BINS / 4).astype(int) % BINS


def profile_at(profile, bearing):
    return profile[plain_bin(np.cos(bearing), np.sin(bearing))]


@settings(deadline=None, max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(1e-6, 10.0))
def test_bins_agree_with_trigonometry(bearing, reach):
    x, y = reach * math.cos(bearing), reach * math.sin(bearing)
    index = kernels._profile_bin(x, y)
    assert 0 <= index < BINS
    # either side of an edge is right for a direction on the edge
    assert index in {int(plain_bin(math.cos(b), math.sin(b))) for b in (bearing - 1e-9, bearing, bearing + 1e-9)}


@settings(deadline=None, max_examples=20)
@given(seeds, st.integers(3, 80))
def test_sectors_reach_halfway_to_the_neighbours(seed, count):
    rng = np.random.default_rng(seed)
    # uneven spacings of at most 1.5 times the smallest: no gaps
    gaps = rng.uniform(1.0, 1.45, count)
    bearing = rng.uniform(-1, 1) + np.cumsum(gaps) * math.tau / gaps.sum()
    sectors, sector_bins = np.empty((count, 4)), np.empty((count, 4), dtype=np.int64)
    assert kernels.measure_sectors(bearing, sectors, sector_bins)
    upper = 0.5 * (bearing + np.append(bearing[1:], bearing[0] + math.tau))
    lower = np.append(upper[-1], upper[:-1])
    expected = np.stack([np.cos(lower), np.sin(lower), np.cos(upper), np.sin(upper)], axis=1)
    np.testing.assert_allclose(sectors, expected, atol=1e-12)
    assert (sector_bins[:, 2:] == 1).all()
    edge_bins = np.stack([plain_bin(np.cos(lower), np.sin(lower)), plain_bin(np.cos(upper), np.sin(upper))], axis=1)
    assert (np.abs((sector_bins[:, :2] - edge_bins + BINS // 2) % BINS - BINS // 2) <= 1).all()


@pytest.mark.parametrize("bearing", [[0.0, 2.0, 1.0], [0.0, 0.0, 1.0], [0.0, 3.0, 6.5], [0.0, 1.0, math.nan]])
def test_bearings_that_do_not_ascend_within_a_turn_are_refused(bearing):
    assert not kernels.measure_sectors(np.array(bearing), np.empty((3, 4)), np.empty((3, 4), dtype=np.int64))


@settings(deadline=None, max_examples=40)
@given(seeds, st.sampled_from([3, 8, 32, 37, 64]))
def test_grown_profile_is_never_beyond_and_hardly_before_the_exact_one(seed, count):
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.02, 1.5, count)
    profile, _, _, smallest = grown(range_m)
    assert smallest == profile.min()
    bearing = rng.uniform(-math.pi, math.pi, 40)
    value = profile_at(profile, bearing)
    assert (value <= plain_growth(range_m, bearing) + 1e-9).all()
    # A bin holds the least within itself, and it is at most 2 * 4 / BINS wide in bearing.
    beside = np.linspace(-8 / BINS, 8 / BINS, 33)
    least = plain_growth(range_m, np.add.outer(bearing, beside).ravel()).reshape(40, 33).min(axis=1)
    assert (value >= least - 1e-9 - 0.002).all()


def with_minima(profile):
    lows = [profile.reshape(groups, -1).min(axis=1) for groups in (kernels.FINE, kernels.COARSE)]
    return profile, *(np.minimum(np.minimum(low, np.roll(low, 1)), np.roll(low, -1)) for low in lows), profile.min()


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_groups_hold_the_least_of_themselves_and_their_neighbours(seed):
    profile, *minima = grown(np.random.default_rng(seed).uniform(0.02, 1.5, 24))
    for found, expected in zip(minima, with_minima(profile)[1:], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_disc_touches_a_facing_obstacle_one_radius_before_it_and_a_wall_behind_blocks_nothing():
    profile, *_ = grown(np.where(np.arange(64) == 0, 0.5, np.inf))
    assert profile_at(profile, 0.0) == pytest.approx(0.41)
    assert profile_at(profile, math.pi) == math.inf
    touching, *_ = grown(np.where(np.arange(64) == 0, 0.05, np.inf))
    assert profile_at(touching, 0.3) == 0.0
    assert profile_at(touching, math.pi) == math.inf


def test_unmeasured_bearings_block_themselves_only():
    one, *_ = grown(np.where(np.arange(32) == 5, np.nan, np.inf))
    middle = 5 * math.tau / 32
    assert profile_at(one, middle) == 0.0
    assert profile_at(one, middle + 0.2) == math.inf
    pinhole, *_ = grown(np.full(9, np.inf), np.linspace(-0.4, 0.4, 9))
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


def plain_positions(velocity, target, acceleration, dead_time, times):
    """Positions (N, 2) at the times (N,): eq. 12 by the mean velocity over each of its three stretches."""
    velocity, target = np.array(velocity), np.array(target)
    settle = np.hypot(*(target - velocity)) / acceleration
    changing = np.clip(times - dead_time, 0.0, settle)
    reached = velocity + (target - velocity) * (changing / settle if settle > 0 else np.ones_like(times))[:, None]
    out = np.minimum(times, dead_time)[:, None] * velocity
    out = out + changing[:, None] * 0.5 * (velocity + reached)
    return out + np.maximum(times - dead_time - settle, 0.0)[:, None] * target


def plain_blocked(velocity, target, acceleration, dead_time, profile, times):
    x, y = plain_positions(velocity, target, acceleration, dead_time, times).T
    r = np.hypot(x, y)
    return (r > 1e-12) & (r >= profile[plain_bin(x, y)])


@settings(deadline=None, max_examples=150)
@given(seeds, st.sampled_from([0.3, 1.2, 4.0]), st.sampled_from([0.001, 0.004, 0.02]))
def test_time_to_contact_agrees_with_fine_sampling(seed, acceleration, step_m):
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:
        profile, *minima = grown(rng.uniform(0.1, rng.uniform(0.2, 1.5), 32))
    else:  # thinner things than any disc leaves, so that no step may be too long
        profile, *minima = with_minima(np.where(rng.random(BINS) < 0.03, rng.uniform(0.05, 1.0, BINS), 2.0))
    velocity, target = tuple(rng.uniform(-0.8, 0.8, 2)), tuple(rng.uniform(-0.8, 0.8, 2))
    fastest = max(math.hypot(*velocity), math.hypot(*target))
    found = kernels.contact_time(velocity, target, acceleration, 0.03, 2.0, step_m, profile, *minima)
    spacing_m = 0.05 * step_m
    times = np.arange(0.0, 2.0, spacing_m / fastest)
    blocked = plain_blocked(velocity, target, acceleration, 0.03, profile, times)
    # Samples may jump over a corner of the profile, but over less than a step.
    edges = np.flatnonzero(np.diff(np.concatenate([[0], blocked[times < found], [0]])))
    assert (np.diff(edges)[::2] * spacing_m <= step_m + spacing_m).all()
    # And what it reports as a contact is one, at most a tenth of a step later.
    if math.isfinite(found):
        after = found + np.linspace(0.0, 0.11 * step_m / fastest, 400)
        assert plain_blocked(velocity, target, acceleration, 0.03, profile, after).any()


def test_nothing_that_stands_is_ever_touched_and_a_wall_ahead_at_its_time():
    profile, *minima = grown(np.full(64, 0.5))
    assert kernels.contact_time((0.0, 0.0), (0.0, 0.0), 0.3, 0.03, 9.0, 0.004, profile, *minima) == math.inf
    found = kernels.contact_time((0.4, 0.0), (0.4, 0.0), 0.3, 0.03, 9.0, 0.004, profile, *minima)
    assert (0.5 - RADIUS - 0.0005) / 0.4 <= found <= (0.5 - RADIUS) / 0.4
    assert kernels.contact_time((0.4, 0.0), (0.4, 0.0), 0.3, 0.03, 1.0, 0.004, profile, *minima) == math.inf


def plain_choice(velocity, goal_bearing, goal_distance, side, limits, use_velocity, directions, profile, minima):
    """Take Steps 3 to 5 with whole arrays; the contact times come from the kernel, which has a test of its own."""
    speed, acceleration, dead_time, period, threshold, step_m, levels = limits
    units = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    if math.isfinite(goal_distance):
        lag = acceleration * (dead_time + period)
        speed = min(speed, math.sqrt(lag**2 + 2 * acceleration * goal_distance) - lag)
    turned = directions - goal_bearing % math.tau
    turned = np.where(turned >= math.pi, turned - math.tau, np.where(turned < -math.pi, turned + math.tau, turned))
    ahead = np.abs(turned) <= math.pi / directions.shape[0] * 1.001
    away = np.where((turned * side < 0) & ~ahead, math.tau - np.abs(turned), np.abs(turned))
    contacts, taken = [], None
    for slower in speed * 0.5 ** np.arange(levels):
        targets = slower * units
        present = np.broadcast_to(velocity, targets.shape) if use_velocity else targets
        settle = np.hypot(*(targets - present).T) / acceleration
        needed = 2 * dead_time + period + settle + slower / (2 * acceleration)
        if threshold >= 0:
            needed = np.full_like(needed, threshold)
        times = np.array(
            [
                kernels.contact_time(tuple(a), tuple(b), acceleration, dead_time, 1.1 * n, step_m, profile, *minima)
                for a, b, n in zip(present, targets, needed, strict=True)
            ]
        )
        contacts.append(times)
        passed = [
            np.hypot(*plain_positions(a, b, acceleration, dead_time, np.array([min(t, 1e6)]))[0])
            for a, b, t in zip(present, targets, times, strict=True)
        ]
        safe = (times >= needed) | (ahead & (np.array(passed) >= goal_distance + slower**2 / (2 * acceleration)))
        if safe.any():
            best = safe & (away <= away[safe].min() + 1e-9)
            index = int(np.argmax(np.where(best, times, -1.0)))
            towards = slower * math.cos(min(away[index], math.pi))
            # a lower speed only where it is nearer to the goal, and sooner
            if taken is None or (away[index] < away[taken[0]] - 1e-9 and towards > taken[2]):
                taken = index, slower, towards
    if taken is not None:
        index, slower, _ = taken
        if ahead[index]:
            side = 0.0
        elif side == 0.0:
            side = math.copysign(1.0, turned[index])
        return (0, index, slower, side), contacts[0]
    present = velocity if use_velocity else (0.0, 0.0)
    stop = dead_time + math.hypot(*present) / acceleration
    braking = kernels.contact_time(present, (0.0, 0.0), acceleration, dead_time, stop, step_m, profile, *minima)
    braking += 0.1 * step_m / max(speed, math.hypot(*present))
    index = int(np.argmax(contacts[0]))
    return ((2, index, speed, side) if contacts[0][index] > braking else (1, -1, 0.0, side)), contacts[0]


@settings(deadline=None, max_examples=150)
@given(
    seeds,
    st.sampled_from([(0.4, 0.3), (1.5, 4.0)]),
    st.sampled_from([-1.0, 0.0, 1.0]),
    st.sampled_from([-1.0, 0.5]),
    st.booleans(),
    st.sampled_from([math.inf, 0.0, 0.2, 1.0]),
)
def test_steering_agrees_with_whole_arrays(seed, motion, side, threshold, use_velocity, goal_distance):
    rng = np.random.default_rng(seed)
    speed, acceleration = motion
    limits = (speed, acceleration, 0.03, 1 / 30, threshold, 0.004, 3.0)
    directions = np.arange(24) * math.tau / 24
    units = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    bearing, range_m = around(32), rng.uniform(0.02, rng.uniform(0.1, 2.5), 32)
    velocity = tuple(rng.uniform(-speed, speed, 2))
    # half the goals lie on a direction or between two, where choices tie
    goal = rng.uniform(-4, 4) if rng.random() < 0.5 else rng.integers(-24, 24) * math.pi / 24
    profile, *minima = grown(range_m)
    expected, times = plain_choice(
        velocity, goal, goal_distance, side, limits, use_velocity, directions, profile, minima
    )
    known = np.full(32, np.nan)
    sectors, sector_bins, scratch = np.empty((32, 4)), np.empty((32, 4), dtype=np.int64), np.empty(BINS)
    found_times = np.empty(24)
    for _ in range(2):  # measuring the sectors, and with those already measured
        found = kernels.steer(
            velocity, goal, goal_distance, side, limits, use_velocity, directions, units, bearing, range_m,
            known, sectors, sector_bins, EDGES, RADIUS, scratch, np.empty(kernels.FINE), np.empty(kernels.COARSE),
            found_times,
        )  # fmt: skip
        assert found[:2] == expected[:2]
        assert found[2:] == pytest.approx(expected[2:], abs=1e-12)
        np.testing.assert_allclose(found_times, times, atol=1e-9)
        np.testing.assert_array_equal(known, bearing)


def test_steering_refuses_bearings_that_do_not_ascend():
    found = kernels.steer(
        (0.0, 0.0), 0.0, math.inf, 1.0, (0.4, 0.3, 0.03, 0.03, -1.0, 0.004, 3.0), True, np.zeros(4), np.zeros((4, 2)),
        np.array([0.0, 2.0, 1.0]), np.ones(3), np.full(3, np.nan), np.empty((3, 4)), np.empty((3, 4), dtype=np.int64),
        EDGES, RADIUS, np.empty(BINS), np.empty(kernels.FINE), np.empty(kernels.COARSE), np.empty(4),
    )  # fmt: skip
    assert found == (-1, -1, 0.0, 1.0)
