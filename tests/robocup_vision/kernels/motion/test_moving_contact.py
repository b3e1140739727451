"""The kernel of moving discs against finely sampled trajectories."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import plain_positions

from robocup_vision.kernels.motion.moving_contact import COLUMNS, moving_contact_then_stop, moving_contact_time

HERE = (0.0, 0.0)
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


@settings(max_examples=200)
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


def test_two_on_a_straight_line_meet_when_they_should():
    ahead = np.array([[1.0, 0.0, -0.5, 0.0, 0.2, 0.0, 0.0, 0.0]])
    found = moving_contact_time(HERE, (0.5, 0.0), (0.5, 0.0), 1.0, 0.0, 2.0, STEP_M, ahead)
    assert found == pytest.approx(0.8, abs=STEP_M)
    # begun later it has come nearer
    found = moving_contact_time(HERE, (0.5, 0.0), (0.5, 0.0), 1.0, 0.2, 2.0, STEP_M, ahead)
    assert found == pytest.approx(0.7, abs=STEP_M)
    assert math.isinf(moving_contact_time(HERE, (0.5, 0.0), (0.5, 0.0), 1.0, 0.0, 0.7, STEP_M, ahead))


def test_doubt_grows_up_to_its_limit():
    still = np.array([[1.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.5, 0.05]])
    found = moving_contact_time(HERE, (0.5, 0.0), (0.5, 0.0), 1.0, 0.0, 3.0, STEP_M, still)
    assert found == pytest.approx((1.0 - 0.25) / 0.5, abs=2 * STEP_M)


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


def test_nothing_that_moves_is_no_contact():
    nothing = np.empty((0, COLUMNS))
    assert math.isinf(moving_contact_time(HERE, (1.0, 0.0), (1.0, 0.0), 1.0, 0.0, 9.0, STEP_M, nothing))
