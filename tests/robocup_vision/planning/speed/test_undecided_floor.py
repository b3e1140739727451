"""Speeds over undecided floor: every region is looked at often enough, and can be stopped before."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.planning import MotionLimits, UndecidedFloor, UndecidedSpeed, looks_to_decide, safe_speed_mps

LIMITS = MotionLimits(1.5, 2.0, 0.03)
CELL, RADIUS, PERIOD = 0.05, 0.09, 0.2
PATH = np.array([[0.2, 0.5], [3.8, 0.5]])
PLANNER = UndecidedSpeed(LIMITS, RADIUS, PERIOD)


def floor(*cells):
    """Return 4 m x 1 m of free floor but for cells (x, y, looks)."""
    looks = np.full((20, 80), -1, dtype=np.int16)
    for x, y, count in cells:
        looks[int(y / CELL), int(x / CELL)] = count
    return UndecidedFloor(looks, (0.0, 0.0), CELL)


@settings(max_examples=100)
@given(st.floats(0.0, 5.0), st.integers(0, 20))
def test_the_speed_is_the_largest_that_fits(room, looks):
    speed = safe_speed_mps(room, looks, PERIOD, LIMITS)

    def needs(v):
        return v * (max(looks, 1) * PERIOD + LIMITS.dead_time_s) + v**2 / (2 * LIMITS.acceleration_mps2)

    assert needs(speed) <= room + 1e-9
    assert speed == LIMITS.speed_mps or needs(speed + 1e-6) > room


def test_decided_floor_is_driven_at_full_speed():
    plan = PLANNER.plan(PATH, floor())
    assert plan.speed_mps == LIMITS.speed_mps
    assert plan.reason == "full speed: the way is free"
    beside = PLANNER.plan(PATH, floor((2.0, 0.8, 9), (2.0, 0.2, 0)))
    assert beside.speed_mps == LIMITS.speed_mps


def test_the_nearer_and_the_less_known_the_slower():
    speeds = [PLANNER.plan(PATH, floor((x, 0.5, 4))).speed_mps for x in (0.6, 0.9, 1.4, 2.5)]
    assert speeds == sorted(speeds)
    assert 0.0 < speeds[0] < speeds[-1]
    speeds = [PLANNER.plan(PATH, floor((1.2, 0.5, looks))).speed_mps for looks in (9, 4, 1)]
    assert speeds == sorted(speeds)
    assert speeds[0] < speeds[-1]


def test_the_reason_names_way_and_looks():
    plan = PLANNER.plan(PATH, floor((1.2, 0.5, 4)))
    assert plan.safe
    assert plan.reason == f"slow, {plan.speed_mps:.2f} m/s: undecided floor in {plan.clearance_m:.2f} m, 4 looks"
    # to the cell's near side, less the robot's radius, from below and by no more than two steps
    assert 1.2 - 0.2 - RADIUS - 2 * CELL < plan.clearance_m <= 1.2 - 0.2 - RADIUS
    assert "blocked in" in PLANNER.plan(PATH, floor((1.2, 0.5, 0))).reason
    stop = PLANNER.plan(PATH, floor((0.33, 0.5, 4)))
    assert not stop.safe
    assert stop.reason == "stop: undecided floor in 0.00 m, 4 looks"


def test_what_lies_under_the_robot_is_free():
    assert PLANNER.plan(PATH, floor((0.2, 0.5, 4))).speed_mps == LIMITS.speed_mps


def test_beyond_the_map_nothing_is_decided():
    far = np.array([[3.6, 0.5], [6.0, 0.5]])
    assert PLANNER.plan(far, floor()).speed_mps < LIMITS.speed_mps


@pytest.mark.parametrize("looks", [1, 3, 6])
def test_a_robot_that_obeys_has_looked_often_enough_before_it_is_there(looks):
    x, v, seen = 0.2, 0.0, 0
    hidden = 2.0
    while x < hidden - RADIUS and seen <= looks + 40:
        near = hidden - x < 1.2
        left = max(looks - seen, 0) if near else looks
        path = np.array([[x, 0.5], [3.8, 0.5]])
        cell = (hidden, 0.5, left if left else -1)
        v = min(v + LIMITS.acceleration_mps2 * PERIOD, PLANNER.plan(path, floor(cell)).speed_mps)
        x += v * PERIOD
        seen += near
    assert seen >= looks


def test_looks_to_decide_counts_by_the_sensors_gain():
    looks = looks_to_decide(np.array([[0.0, -1.5, -3.0, 3.0, 2.9]]), np.array([[1.0, 1.0, 1.0, 1.0, 0.0]]), 3.0)
    assert looks.tolist() == [[3, 2, -1, 0, np.iinfo(np.int16).max]]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: UndecidedFloor(np.zeros(3), (0, 0), CELL), r"looks must be \(R, C\)"),
        (lambda: UndecidedFloor(np.zeros((2, 2)), (0, 0), 0.0), "cell_m must be positive"),
        (lambda: UndecidedSpeed(LIMITS, 0.0, PERIOD), "robot_radius_m must be positive"),
        (lambda: UndecidedSpeed(LIMITS, 0.1, math.nan), "look_period_s must be positive"),
        (lambda: PLANNER.plan(PATH[:1], floor()), r"a path must be \(P, 2\)"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
