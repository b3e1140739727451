"""The compiled comparison of range profiles against NumPy, term by term."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.mapping import ego_motion as kernels

seeds = st.integers(0, 2**32 - 1)
GATE, WORTH, BLOCK = 4.0, 0.3, 5
RULES = kernels.Rules(0.3, WORTH, BLOCK)


def plain_step(one, other, variance):
    return not abs(one - other) < 3 * math.sqrt(2 * variance) + 0.1 * other


def scene(seed, count=48):
    """(J,) inverse ranges of a few things at different distances, with gaps; and their variance."""
    rng = np.random.default_rng(seed)
    edges = np.sort(rng.choice(count, 6, replace=False))
    inverse = rng.uniform(0.4, 3.0, 7)[np.searchsorted(edges, np.arange(count), side="right")]
    inverse = inverse * (1 + 0.02 * np.sin(np.arange(count))) + rng.normal(0, 0.01, count)
    inverse[rng.random(count) < 0.1] = np.nan
    return inverse, rng.uniform(0.005, 0.02, count) ** 2


def smoothed(seed):
    inverse, variance = scene(seed)
    present, thing = np.empty((3, len(inverse))), np.empty(len(inverse), dtype=np.int64)
    kernels.smooth(inverse, variance, 2, *present)
    kernels.part(present[kernels.VALUE], present[kernels.VARIANCE], thing)
    return present, thing


def points_of(present, moved_variance, thing):
    angle = np.arange(present.shape[1]) * (math.tau / present.shape[1])
    range_m = 1 / present[0]
    xy = np.stack([np.cos(angle), np.sin(angle)], axis=1) * range_m[:, None]
    return np.column_stack([xy, present[1] * range_m**4, np.where(thing % 2 == 0, moved_variance, 0.0)])


def plain_terms(present, past, pose, gate):
    """Terms of eq. 2 (point, difference, its variance, its derivative by the pose), and how many there could be."""
    count = present.shape[1]
    offset = past[:, :2] - pose[:2]
    distance = np.hypot(*offset.T)
    turn = (np.arctan2(offset[:, 1], offset[:, 0]) - pose[2]) * count / math.tau
    place = np.floor(turn + 0.5)
    terms, comparable = [], 0
    for m in np.flatnonzero(distance > 0):
        j = int(place[m]) % count
        spread = present[1, j] + past[m, 2] / distance[m] ** 4
        same = np.flatnonzero((distance > 0) & (place % count == j))
        if not present[0, j] > 0 or 1 / distance[same].min() - 1 / distance[m] > gate * math.sqrt(spread):
            continue
        comparable += 1
        off = present[0, j] + (turn[m] - place[m]) * present[2, j] - 1 / distance[m]
        if abs(off) <= gate * math.sqrt(spread):
            x, y = offset[m]
            slope = present[2, j] * count / math.tau
            by_bearing = np.array([y, -x, 0]) / distance[m] ** 2 - (0, 0, 1)
            terms.append((m, off, spread, slope * by_bearing - np.array([x, y, 0]) / distance[m] ** 3))
    return terms, comparable


def compared(present, past, thing, pose):
    normal, slope, scatter = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    nearest = np.empty(present.shape[1])
    sums = kernels.Sums(normal, slope, scatter)
    counts = kernels.compare(present, past, thing, pose, GATE, RULES, nearest, sums)
    return counts, normal, slope, scatter


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_smoothing_fits_a_straight_wall_to_the_neighbours_on_the_same_thing(seed):
    inverse, variance = scene(seed)
    value, spread, slope = np.empty((3, len(inverse)))
    kernels.smooth(inverse, variance, 2, value, spread, slope)
    assert np.isnan(value[np.isnan(inverse)]).all()
    step_rad = math.tau / len(inverse)
    for j in np.flatnonzero(np.isfinite(inverse)):
        steps = [0]
        for side in (-1, 1):
            last = inverse[j]
            for step in (side, 2 * side):
                near = inverse[(j + step) % len(inverse)]
                if plain_step(near, last, variance[j]):
                    break
                steps.append(step)
                last = near
        if len(steps) == 1:
            assert np.isnan([value[j], spread[j], slope[j]]).all()
            continue
        angle = np.array(steps) * step_rad
        design = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        fit = np.linalg.lstsq(design, inverse[(j + np.array(steps)) % len(inverse)], rcond=None)[0]
        assert value[j] == pytest.approx(fit[0])
        assert slope[j] == pytest.approx(fit[1] * step_rad)
        assert spread[j] == pytest.approx(variance[j] * np.linalg.inv(design.T @ design)[0, 0])


@settings(deadline=None, max_examples=20)
@given(st.floats(0, math.tau), st.floats(0.3, 3.0))
def test_smoothing_leaves_a_straight_wall_as_it_is(direction, distance):
    angle = np.arange(64) * (math.tau / 64)
    inverse = np.cos(angle - direction) / distance
    # seen more obliquely, neighbours are steps apart
    inverse[inverse < 0.6 / distance] = np.nan
    value, spread, slope = np.empty((3, 64))
    kernels.smooth(inverse, np.full(64, 1e-3), 2, value, spread, slope)
    np.testing.assert_allclose(value, inverse, atol=1e-12)
    tangent = np.where(np.isnan(inverse), np.nan, -np.sin(angle - direction) / distance * math.tau / 64)
    np.testing.assert_allclose(slope, tangent, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_things_end_at_steps_and_gaps_and_go_on_through_direction_zero(seed):
    inverse, variance = scene(seed)
    thing = np.empty(len(inverse), dtype=np.int64)
    count = kernels.part(inverse, variance, thing)
    assert sorted(set(thing[thing >= 0].tolist())) == list(range(count))
    np.testing.assert_array_equal(thing < 0, np.isnan(inverse))
    for j in np.flatnonzero(thing >= 0):
        joined = thing[j] == thing[j - 1]
        assert joined == (not plain_step(inverse[j - 1], inverse[j], variance[j]))


def test_a_ring_without_steps_is_one_thing_and_nothing_is_none():
    thing = np.empty(16, dtype=np.int64)
    assert kernels.part(np.ones(16), np.full(16, 1e-4), thing) == 1
    assert (thing == 0).all()
    assert kernels.part(np.full(16, np.nan), np.full(16, 1e-4), thing) == 0
    assert (thing == -1).all()


def test_widths_are_the_diagonals_of_boxes():
    points = np.array([[0.0, 0.0], [3.0, 1.0], [1.0, 4.0], [7.0, 7.0], [np.nan, np.nan]])
    width = np.empty(2)
    kernels.widths(points, np.array([0, 0, 0, 1, -1]), width)
    np.testing.assert_allclose(width, [5.0, 0.0])


@settings(deadline=None, max_examples=40)
@given(seeds, st.sampled_from([0.0, 1e-4, 1e-2]), st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_comparison_agrees_with_numpy(seed, moved_variance, offset):
    present, _ = smoothed(seed)
    earlier, thing = smoothed(seed)
    past, pose = points_of(earlier, moved_variance, thing), np.array(offset)
    (total, counted, comparable, blocks), normal, slope, scatter = compared(present, past, thing, pose)
    terms, could = plain_terms(present, past, pose, GATE)
    assert (counted, comparable) == (len(terms), could)
    assert total == pytest.approx(sum(off**2 / spread for _, off, spread, _ in terms))
    # blocks: at most five that count, of one thing, in the order of their directions
    groups = []
    begin = next((m for m in range(len(thing)) if thing[m] != thing[-1]), len(thing) - 1)
    for term in sorted(terms, key=lambda term: (term[0] - begin) % len(thing)):
        if not groups or thing[groups[-1][0][0]] != thing[term[0]] or len(groups[-1]) == BLOCK:
            groups.append([])
        groups[-1].append(term)
    assert blocks == len(groups)
    expected, pull, square = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for group in groups:
        off = np.array([term[1] for term in group])
        rows = np.array([term[3] for term in group])
        # the twin adds the displacement to the noise, instead of integrating it out
        noise = np.diag([term[2] / WORTH for term in group])
        noise += past[group[0][0], kernels.MOVED_VARIANCE] * rows[:, :2] @ rows[:, :2].T
        weighed = np.linalg.solve(noise, rows)
        expected += rows.T @ weighed
        pull += weighed.T @ off
        square += np.outer(weighed.T @ off, weighed.T @ off)
    np.testing.assert_allclose(normal, expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(slope, pull, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(pull).max(initial=0)))
    np.testing.assert_allclose(scatter, square, rtol=1e-5, atol=1e-6 * max(1.0, square.max(initial=0)))


def test_excess_is_one_for_honest_blocks_and_grows_with_their_disagreement():
    normal, information = np.diag([4.0, 9.0, 1.0]) * 1e4, np.eye(3)
    assert kernels.excess(normal, 0.5 * normal, information, 30) == 1.0
    assert kernels.excess(normal, 5.0 * normal, information, 30) == pytest.approx(5.0 * 30 / 27)
    assert kernels.excess(np.zeros((3, 3)), np.zeros((3, 3)), information, 30) == 1.0
    assert kernels.excess(-np.eye(3), normal, np.zeros((3, 3)), 30) == 1.0


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_difference_is_the_sum_of_means_and_skips_profiles_that_disagree(seed):
    present, _ = smoothed(seed)
    twins = [smoothed(seed), smoothed(seed), smoothed(seed)]
    past = np.stack([points_of(p, 0.0, thing) for p, thing in twins])
    past[1, :, :2] *= 3.0  # seen nowhere near
    past[2, :, :2] *= 1.002
    thing = np.stack([thing for _, thing in twins])
    pose, information = np.zeros(3), np.eye(3)
    normal, slope = np.empty((3, 3)), np.empty(3)
    total, used, ratio = kernels.difference(
        present, kernels.Earlier(past, thing), pose, information, GATE, RULES, normal, slope
    )
    parts = [compared(present, past[i], thing[i], pose) for i in range(3)]
    chosen = [i for i in range(3) if parts[i][0][3] >= 4 and parts[i][0][1] >= 0.3 * parts[i][0][2]]
    assert used == len(chosen)
    assert total == pytest.approx(sum(parts[i][0][0] / parts[i][0][1] for i in chosen), abs=1e-9)
    agreeing, could = (sum(part[0][n] for part in parts) for n in (1, 2))
    assert ratio == pytest.approx(agreeing / max(could, 1))
    if chosen:
        most = max(parts[i][0][1] for i in chosen)
        weights = [
            1 / parts[i][0][1] / kernels.excess(parts[i][1], parts[i][3], information, parts[i][0][3]) for i in chosen
        ]
        expected = sum(weight * parts[i][1] for weight, i in zip(weights, chosen, strict=True)) * most / used
        np.testing.assert_allclose(normal, expected, rtol=1e-9)


def test_refinement_stays_where_nothing_can_be_compared():
    present = np.full((3, 16), np.nan)
    past, thing = np.full((1, 16, 4), np.nan), np.full((1, 16), -1)
    pose = np.array([0.1, 0.2, 0.3])
    earlier, prediction = kernels.Earlier(past, thing), kernels.Prediction(pose.copy(), np.eye(3))
    rules, gates = kernels.Rules(0.3, 1.0, BLOCK), np.array([8.0, 4.0])
    assert kernels.refine(present, earlier, pose, prediction, gates, rules, np.empty((3, 3))) == (0, 0.0)
    np.testing.assert_array_equal(pose, [0.1, 0.2, 0.3])


@settings(deadline=None, max_examples=10)
@given(seeds)
def test_search_finds_the_pose_at_which_most_agrees(seed):
    present, thing = smoothed(seed)
    points = points_of(present, 0.0, thing)
    poses = np.array([[0.3, 0.1, 0.2], [0.0, 0.0, 0.0], [-0.2, 0.3, 0.0], [0.0, 0.0, 0.0]])
    assert kernels.search(present, points[np.isfinite(points[:, 0])], poses, GATE) == 1
    # as many agree as the terms of the comparison, where nothing is hidden
    lone = points[np.isfinite(points[:, 0])][:1]
    agree = [bool(plain_terms(present, lone, pose, GATE)[0]) for pose in poses]
    assert kernels.search(present, lone, poses, GATE) == (agree.index(True) if any(agree) else 0)
