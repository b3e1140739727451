"""Smoothed range profiles, the things in them, and how far blocks of them agree."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.mapping import ego_motion as kernels

seeds = st.integers(0, 2**32 - 1)


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


def test_excess_is_one_for_honest_blocks_and_grows_with_their_disagreement():
    normal, information = np.diag([4.0, 9.0, 1.0]) * 1e4, np.eye(3)
    assert kernels.excess(normal, 0.5 * normal, information, 30) == 1.0
    assert kernels.excess(normal, 5.0 * normal, information, 30) == pytest.approx(5.0 * 30 / 27)
    assert kernels.excess(np.zeros((3, 3)), np.zeros((3, 3)), information, 30) == 1.0
    assert kernels.excess(-np.eye(3), normal, np.zeros((3, 3)), 30) == 1.0
