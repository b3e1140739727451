"""Times to contact of many commands at once against those of each alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import BINS, grown, with_minima

from robocup_vision.kernels.motion.contact_times import LANES, contact_times
from robocup_vision.kernels.motion.trajectories import contact_time


def plain_contact_times(start, velocities, targets, acceleration, horizons, step_m, profile, smallest):
    """Take one command after the other."""
    return np.array(
        [
            contact_time(start, tuple(velocity), tuple(target), acceleration, horizon, step_m, profile, smallest)
            for velocity, target, horizon in zip(velocities.T, targets.T, horizons, strict=True)
        ]
    )


@settings(max_examples=150)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, LANES, 2 * LANES + 3, 80]), st.sampled_from([0.001, 0.02]))
def test_each_time_is_that_of_the_command_alone(seed, count, step_m):
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:
        profile, smallest = grown(rng.uniform(0.1, rng.uniform(0.2, 1.5), 32))
    else:
        profile, smallest = with_minima(np.where(rng.random(BINS) < 0.03, rng.uniform(0.05, 1.0, BINS), 2.0))
    start = (0.0, 0.0) if rng.random() < 0.5 else tuple(rng.uniform(-0.3, 0.3, 2))
    velocities, targets = rng.uniform(-0.8, 0.8, (2, 2, count))
    still, same = rng.random((2, count)) < 0.1
    targets[:, still], velocities[:, still] = 0.0, 0.0
    velocities[:, same] = targets[:, same]
    horizons, found = rng.uniform(0.0, 3.0, count), np.empty(count)
    acceleration = rng.uniform(0.2, 4.0)
    contact_times(start, velocities, targets, acceleration, horizons, step_m, profile, smallest, found)
    expected = plain_contact_times(start, velocities, targets, acceleration, horizons, step_m, profile, smallest)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("range_m", [0.5, math.inf])
def test_walls_all_around_are_met_at_one_time_and_open_floor_never(range_m):
    profile, smallest = grown(np.full(64, range_m))
    bearings = np.arange(80) * (math.tau / 80)
    targets, found = 0.4 * np.stack([np.cos(bearings), np.sin(bearings)]), np.empty(80)
    contact_times((0.0, 0.0), targets, targets, 0.3, np.full(80, 9.0), 0.004, profile, smallest, found)
    assert np.isinf(found).all() if math.isinf(range_m) else np.ptp(found) < 0.01
