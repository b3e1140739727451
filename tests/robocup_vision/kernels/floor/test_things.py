"""Feet of what stands on the floor, against plain NumPy twins."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.floor.things import HIDDEN_RATIO, FieldFeet, blocked_feet, drop_narrow, is_of_field

seeds = st.integers(0, 2**32 - 1)
RANGE_M = np.geomspace(0.3, 6.0, 24)


@settings(deadline=None, max_examples=60)
@given(seeds, st.floats(0.1, 1.0), st.integers(0, 3), st.integers(4, 24))
def test_feet_hide_the_floor_behind_them(seed, height_m, first, in_use):
    rng = np.random.default_rng(seed)
    blocked = rng.random((15, 24)) < rng.uniform(0.2, 0.9)
    # long stretches, as things make them
    blocked |= (np.arange(24) >= rng.integers(0, 30, 15)[:, None]) & (rng.random((15, 24)) < 0.97)
    shown = rng.random((15, 24)) < 0.9
    out, eye_m = np.empty(15, dtype=np.int64), 0.5
    blocked_feet(
        np.where(blocked, 0, 1).astype(np.uint8), shown.astype(np.uint8), RANGE_M, first, in_use, eye_m, height_m, out
    )
    hides_to = math.inf if height_m >= eye_m else eye_m / (eye_m - height_m)
    for k in range(15):
        expected = 24 + max(np.flatnonzero(shown[k, :in_use]), default=0)
        for m in range(first, in_use - 1):
            behind = [j for j in range(m, in_use) if j < m + 2 or RANGE_M[j] <= RANGE_M[m] * hides_to]
            seen = [j for j in behind if shown[k, j]]
            count = np.count_nonzero(blocked[k, seen])
            if blocked[k, m] and shown[k, m] and count >= 2 and count >= HIDDEN_RATIO * len(seen):
                expected = m
                break
        assert out[k] == expected


def opened(columns, width_m, step_rad, is_ring):
    """Open the feet level by level: at each column, only runs that are wide enough there stay."""
    count = len(columns)
    kept = np.full(count, len(RANGE_M))
    for m, range_m in reversed(list(enumerate(RANGE_M))):
        needed = max(2, math.ceil(width_m / (range_m * step_rad)))
        nearer = columns <= m
        for k in range(count):
            steps = np.arange(-count, count + 1) if is_ring else np.arange(-k, count - k)
            run = nearer[(k + steps) % count]
            middle = count if is_ring else k
            left = np.flatnonzero(~run[:middle])
            right = np.flatnonzero(~run[middle:])
            begin = left[-1] + 1 if len(left) else 0
            end = middle + right[0] if len(right) else len(run)
            if nearer[k] and end - begin >= needed:
                kept[k] = m
    return kept


@settings(deadline=None, max_examples=40)
@given(seeds, st.floats(0.01, 0.6), st.booleans())
def test_narrow_feet_are_dropped_as_by_an_opening(seed, width_m, is_ring):
    rng = np.random.default_rng(seed)
    columns = np.repeat(rng.integers(0, 30, 12), rng.integers(1, 6, 12)).astype(np.int64)
    if rng.random() < 0.1:
        columns[:] = 7
    expected = opened(columns, width_m, 0.1, is_ring)
    drop_narrow(columns, RANGE_M, len(RANGE_M), width_m, 0.1, is_ring)
    np.testing.assert_array_equal(np.minimum(columns, len(RANGE_M)), expected)


def test_the_floors_end_and_what_the_field_has_on_it_is_its_own():
    field = load_field("ssl_division_b")
    feet = FieldFeet(
        np.array(field.floor_polygon),
        np.vstack([goal.panels for goal in field.goals]),
        np.array([[1.0, 1.0, 0.1]]),
        np.empty((0, 4)),
    )
    rng = np.random.default_rng(0)
    robot = (0.5, -0.3, 0.7)
    c, s = math.cos(robot[2]), math.sin(robot[2])
    for x, y in rng.uniform(-5.5, 5.5, (400, 2)):
        away = np.array([x - robot[0], y - robot[1]])
        local = c * away[0] + s * away[1], c * away[1] - s * away[0]
        error_m = float(rng.uniform(0.0, 0.3))
        behind = np.array([x, y]) + error_m * away / np.hypot(*away)
        expected = not field.contains(behind) or math.hypot(x - 1.0, y - 1.0) < 0.1 + error_m
        for x0, y0, x1, y1 in feet.panels:
            along = np.linspace(0, 1, 2001)[:, None] * [x1 - x0, y1 - y0] + [x0, y0]
            expected |= bool(np.hypot(*(along - [x, y]).T).min() < error_m)
        assert is_of_field(*local, error_m, (0.0, 0.0), robot, feet) == expected


def test_the_inside_of_a_goal_with_a_net_is_the_fields_own():
    floor = np.array([[-5.0, -3.0], [5.0, -3.0], [5.0, 3.0], [-5.0, 3.0]])
    feet = FieldFeet(floor, np.empty((0, 4)), np.empty((0, 3)), np.array([[1.0, 4.0, 4.5, 0.8], [-1.0, 4.0, 4.5, 0.8]]))
    here = (0.0, 0.0), (0.0, 0.0, 0.0)
    assert is_of_field(4.3, 0.5, 0.05, *here, feet)
    assert is_of_field(-4.3, 0.5, 0.05, *here, feet)
    assert not is_of_field(3.9, 0.5, 0.05, *here, feet)
    assert not is_of_field(4.3, 1.0, 0.05, *here, feet)
