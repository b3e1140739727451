"""Trajectories against the integral of their law, and the time to contact against fine sampling."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import BINS, RADIUS, grown, plain_bin, plain_positions, with_minima

from robocup_vision.kernels.motion import trajectories as kernels

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


@given(speeds, speeds, speeds, speeds, st.floats(0.2, 5.0))
def test_position_and_velocity_are_continuous_and_acceleration_is_limited(vx, vy, tx, ty, acceleration):
    settle = math.hypot(tx - vx, ty - vy) / acceleration
    h = 1e-4
    times = np.append(np.linspace(0.01, settle + 0.5, 50), settle)
    for t in times[times > h]:
        before, now, after = (
            np.array(kernels.predict_position(HERE, (vx, vy), (tx, ty), acceleration, t + s)) for s in (-h, 0, h)
        )
        # The second difference bounds a jump in position and in velocity as well as the acceleration.
        assert np.hypot(*(after - 2 * now + before)) <= acceleration * h * h * 1.001 + 1e-12


def plain_blocked(start, velocity, target, acceleration, profile, times):
    x, y = plain_positions(start, velocity, target, acceleration, times).T
    r = np.hypot(x, y)
    return (r > 1e-12) & (r >= profile.ranges[plain_bin(x, y)])


@settings(max_examples=150)
@given(seeds, st.sampled_from([0.3, 1.2, 4.0]), st.sampled_from([0.001, 0.004, 0.02]))
def test_time_to_contact_agrees_with_fine_sampling(seed, acceleration, step_m):
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:
        profile, smallest = grown(rng.uniform(0.1, rng.uniform(0.2, 1.5), 32))
    else:  # thinner things than any disc leaves, so that no step may be too long
        profile, smallest = with_minima(np.where(rng.random(BINS) < 0.03, rng.uniform(0.05, 1.0, BINS), 2.0))
    start = HERE if rng.random() < 0.5 else tuple(rng.uniform(-0.02, 0.02, 2))
    velocity, target = tuple(rng.uniform(-0.8, 0.8, 2)), tuple(rng.uniform(-0.8, 0.8, 2))
    fastest = max(math.hypot(*velocity), math.hypot(*target))
    found = kernels.contact_time(start, velocity, target, acceleration, 2.0, step_m, profile, smallest)
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
    assert kernels.contact_time(HERE, (0.0, 0.0), (0.0, 0.0), 0.3, 9.0, 0.004, profile, smallest) == math.inf
    for start in (0.0, 0.1):
        found = kernels.contact_time((start, 0.0), (0.4, 0.0), (0.4, 0.0), 0.3, 9.0, 0.004, profile, smallest)
        assert (0.5 - start - RADIUS - 0.0005) / 0.4 <= found <= (0.5 - start - RADIUS) / 0.4
    assert kernels.contact_time(HERE, (0.4, 0.0), (0.4, 0.0), 0.3, 1.0, 0.004, profile, smallest) == math.inf
