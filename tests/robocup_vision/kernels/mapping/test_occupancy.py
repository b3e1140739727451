"""The compiled loops of the free-space map against plain NumPy twins."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.mapping.occupancy import (
    CROSSED,
    HIT,
    SILENT,
    ProfileArrays,
    SensorInGrid,
    add_evidence,
    free_ranges,
    gather_evidence,
)
from robocup_vision.mapping.range_profile import cones

seeds = st.integers(0, 2**32 - 1)
CELL, SIZE = 0.1, 14
CORNER = (-0.7, -0.8)


def draw_bearings(rng):
    """All around, over part of a turn, or with a gap in it."""
    count = int(rng.integers(5, 40))
    full = np.sort(rng.uniform(-math.pi, math.pi) + np.arange(count) * (math.tau / count))
    kind = int(rng.integers(3))
    if kind == 0:
        return full
    kept = np.ones(count, dtype=bool)
    first = int(rng.integers(count))
    kept[(first + np.arange(max(count // 3, 1))) % count] = False
    return full[kept] if kind == 1 else full[: max(2, count // 2)]


def overlap(low, high, other_low, other_high):
    """Length that two intervals of directions share."""
    best = 0.0
    for turn in (-2, -1, 0, 1, 2):
        shared = min(high, other_high + turn * math.tau) - max(low, other_low + turn * math.tau)
        best += max(shared, 0.0)
    return best


def cell_geometry(i, j, x, y):
    middle = np.array([CORNER[0] + (i + 0.5) * CELL - x, CORNER[1] + (j + 0.5) * CELL - y])
    corners = middle + CELL / 2 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    direction = math.atan2(middle[1], middle[0])
    turn = np.remainder(np.arctan2(corners[:, 1], corners[:, 0]) - direction + math.pi, math.tau) - math.pi
    near = np.hypot(*np.maximum(np.abs(middle) - CELL / 2, 0))
    far = np.hypot(corners[:, 0], corners[:, 1]).max()
    return middle, direction, direction + turn.min(), direction + turn.max(), near, far


def meets(middle, direction, start, end):
    """Whether the stretch start to end of a ray meets the cell about `middle` (slabs)."""
    unit = np.array([math.cos(direction), math.sin(direction)])
    bounds = np.stack([middle - CELL / 2, middle + CELL / 2]) / unit
    enter, leave = bounds.min(axis=0).max(), bounds.max(axis=0).min()
    return max(enter, start) <= min(leave, end)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_evidence_agrees_with_its_twin(seed):
    rng = np.random.default_rng(seed)
    bearing = draw_bearings(rng)
    count = len(bearing)
    lower, upper = cones(bearing)
    range_m = rng.uniform(0.1, 1.2, count)
    range_m[rng.random(count) < 0.1] = np.nan
    depth_m = rng.choice([0.0, 0.15], count)
    hit = rng.random(count) < 0.7
    x, y = rng.uniform(-0.2, 0.2, 2)
    theta = rng.uniform(-4, 4)
    nearest, reach = rng.uniform(0.0, 0.3), rng.uniform(0.6, 1.5)
    discs = rng.uniform((-0.7, -0.7, 0.0), (0.7, 0.7, 0.2), (int(rng.integers(3)), 3))
    out = np.empty((SIZE, SIZE), dtype=np.int8)
    profile = ProfileArrays(bearing, lower, upper, range_m, depth_m, hit)
    gather_evidence(SensorInGrid(*CORNER, CELL, x, y, theta), profile, nearest, reach, discs, out)
    expected = np.zeros_like(out)
    for i in range(SIZE):
        for j in range(SIZE):
            middle, direction, low, high, near, far = cell_geometry(i, j, x, y)
            away = np.hypot(*middle)
            gap = np.maximum(np.abs(discs[:, :2] - middle - (x, y)) - CELL / 2, 0)
            if away < CELL or near < nearest or far > reach or (np.hypot(*gap.T) <= discs[:, 2]).any():
                continue
            covered, is_free, is_hit = 0.0, True, False
            for k in range(count):
                shared = overlap(low, high, theta + lower[k], theta + upper[k])
                if shared <= 0:
                    continue
                covered += shared
                if range_m[k] >= far:
                    continue
                is_free = False
                if not hit[k] or not range_m[k] >= nearest:
                    continue
                end = range_m[k] + depth_m[k]
                in_cone = overlap(direction - 1e-9, direction + 1e-9, theta + lower[k], theta + upper[k]) > 0
                is_hit |= in_cone and range_m[k] - CELL / 2 <= away <= end + CELL / 2
                is_hit |= meets(middle, theta + bearing[k], range_m[k], end)
            if is_hit:
                expected[i, j] = HIT
            elif is_free and covered > high - low - 1e-7:
                expected[i, j] = CROSSED
    np.testing.assert_array_equal(out, expected)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_free_ranges_agree_with_their_twin(seed):
    rng = np.random.default_rng(seed)
    bearing = draw_bearings(rng)
    lower, upper = cones(bearing)
    x, y = rng.uniform(-0.3, 0.3, 2)
    theta, nearest = rng.uniform(-4, 4), rng.uniform(0.0, 0.3)
    is_free = rng.random((SIZE, SIZE)) < rng.choice([0.8, 0.97, 1.0])
    out = np.empty(len(bearing))
    free_ranges(SensorInGrid(*CORNER, CELL, x, y, theta), lower, upper, nearest, is_free, out)
    window = np.array(CORNER) + SIZE * CELL / 2 - (x, y)
    expected = []
    for low, high in zip(theta + lower, theta + upper, strict=True):
        least = math.inf
        for angle in (low, (low + high) / 2, high):
            unit = np.array([math.cos(angle), math.sin(angle)])
            bounds = np.stack([window - SIZE * CELL / 2, window + SIZE * CELL / 2]) / unit
            least = min(least, bounds.max(axis=0).min())
        for i, j in np.argwhere(~is_free):
            middle, _, cell_low, cell_high, near, _ = cell_geometry(i, j, x, y)
            if np.hypot(*middle) < CELL or near < nearest:
                continue
            if overlap(cell_low, cell_high, low, high) > 0:
                least = min(least, near)
        expected.append(least)
    np.testing.assert_allclose(out, expected, atol=1e-9)


def test_a_robot_in_a_cell_that_is_not_free_has_no_free_range():
    is_free = np.ones((SIZE, SIZE), dtype=bool)
    is_free[7, 8] = False
    lower, upper = cones(np.arange(8) * (math.tau / 8))
    out = np.empty(8)
    free_ranges(SensorInGrid(*CORNER, CELL, 0.05, 0.05, 0.0), lower, upper, 0.0, is_free, out)
    assert (out == 0).all()
    free_ranges(SensorInGrid(*CORNER, CELL, 0.05, 0.05, 0.0), lower, upper, 0.1, is_free, out)
    assert (out > 0.5).all()


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_evidence_is_added_as_numpy_adds_it(seed):
    rng = np.random.default_rng(seed)
    evidence = rng.integers(0, 3, (9, 9), dtype=np.int8)
    log_odds = rng.uniform(-3, 3, (9, 9)).astype(np.float32)
    counts = rng.integers(0, 5, (9, 9), dtype=np.int32)
    steps = np.array([0.0, 1.5, -0.7])[evidence]
    expected = np.where(evidence == SILENT, log_odds, np.clip(log_odds + steps, -3, 3))
    expected_counts = counts + (evidence != SILENT)
    add_evidence(evidence, 1.5, -0.7, 3.0, log_odds, counts)
    np.testing.assert_allclose(log_odds, expected, atol=1e-6)
    np.testing.assert_array_equal(counts, expected_counts)
