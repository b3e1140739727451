"""Expected passage times: what doubt about a width costs, and which gap it makes the better one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.planning import Gap, MotionLimits, PassageTimes, PathFollower, PoseNoise, SpeedPlanner, choose_gap

LIMITS = MotionLimits(1.5, 3.0)
NOISE = PoseNoise(0.06, 0.12, np.diag([0.025, 0.025, 0.02]) ** 2)


@pytest.fixture(scope="module")
def times():
    return PassageTimes(SpeedPlanner(PathFollower(LIMITS), 0.09, NOISE, 0.8), 0.09, 0.012)


def gap(width, sigma, y=0.0):
    return Gap((2.0, y), 0.0, width, sigma)


def test_wider_gaps_cost_less_and_the_narrowest_are_blocked(times):
    assert 2 * 0.09 < times.narrowest_m <= 2.5 * 2 * 0.09
    assert times.extra_s(times.narrowest_m - 0.01) == math.inf
    extra = [times.extra_s(width) for width in np.linspace(times.narrowest_m, 1.2, 40)]
    assert extra == sorted(extra, reverse=True)
    assert extra[0] > 0.3
    assert extra[-1] == pytest.approx(0.0, abs=0.05)


def test_the_expectation_is_that_of_drawn_widths(times):
    opening = gap(0.42, 0.06)
    widths = np.random.default_rng(5).normal(0.42, 0.06, 20000)
    drawn = [times.extra_s(width) for width in widths]
    blocked = 12.0
    mean = np.mean([blocked if math.isinf(t) else LIMITS.travel_s(4.0) + t for t in drawn])
    assert times.expected_s(opening, 4.0, blocked) == pytest.approx(mean, rel=0.01)


def test_doubt_costs_where_the_mean_is_just_wide_enough(times):
    width = times.narrowest_m + 0.03
    sure, doubtful = (times.expected_s(gap(width, sigma), 4.0, 12.0) for sigma in (0.005, 0.08))
    assert doubtful > sure + 0.5


def test_of_two_gaps_the_surer_one_is_taken_where_the_mean_would_take_the_other(times):
    near, far = gap(times.narrowest_m + 0.04, 0.08), gap(times.narrowest_m + 0.2, 0.01, 0.5)
    choice = choose_gap(times, (0.0, 0.0), (4.0, 0.0), [near, far])
    assert choice.index == 1
    assert choice.expected_s[1] < choice.expected_s[0]
    assert choice.reason.startswith(f"gap {far.width_m:.2f} m, sigma 0.01 m, 100 % passable: expected")
    sure = choose_gap(times, (0.0, 0.0), (4.0, 0.0), [gap(1.0, 0.08), far])
    assert sure.index == 0
    assert choose_gap(times, (0.0, 0.0), (4.0, 0.0), [near]).index == 0


def test_bad_input_is_named(times):
    with pytest.raises(ArgumentError, match="at least one gap"):
        choose_gap(times, (0.0, 0.0), (4.0, 0.0), [])
    with pytest.raises(ArgumentError, match="opponent_radius_m must be positive"):
        PassageTimes(times.planner, 0.0, 0.01)
