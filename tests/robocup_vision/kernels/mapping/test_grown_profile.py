"""The grown profile against its exact form, bearing by bearing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steering_twins import BINS, RADIUS, around, grown, plain_bin

seeds = st.integers(0, 2**32 - 1)


def plain_growth(range_m, bearing):
    """Smallest centre range at which the disc touches any sector's arc, along `bearing` (N,): no bins."""
    bearing_rad = around(range_m.shape[0])
    reach = np.maximum(range_m, RADIUS)
    off = np.abs((np.subtract.outer(bearing, bearing_rad) + math.pi) % math.tau - math.pi)
    off = np.maximum(off - math.pi / range_m.shape[0], 0.0)
    beside = reach * np.sin(off)
    touch = reach * np.cos(off) - np.sqrt(np.maximum(RADIUS**2 - beside**2, 0.0))
    return np.where((off < math.pi / 2) & (beside <= RADIUS), touch, np.inf).min(axis=1)


def profile_at(profile, bearing):
    return profile.ranges[plain_bin(np.cos(bearing), np.sin(bearing))]


@given(seeds, st.sampled_from([3, 8, 32, 37, 64]))
def test_grown_profile_is_never_beyond_and_hardly_before_the_exact_one(seed, count):
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.02, 1.5, count)
    profile, smallest = grown(range_m)
    assert smallest == profile.ranges.min()
    bearing = rng.uniform(-math.pi, math.pi, 40)
    value = profile_at(profile, bearing)
    assert (value <= plain_growth(range_m, bearing) + 1e-9).all()
    # A bin holds the least within itself, and it is at most 2 * 4 / BINS wide in bearing.
    beside = np.linspace(-8 / BINS, 8 / BINS, 33)
    least = plain_growth(range_m, np.add.outer(bearing, beside).ravel()).reshape(40, 33).min(axis=1)
    assert (value >= least - 1e-9 - 0.002).all()


def test_disc_touches_a_facing_obstacle_one_radius_before_it_and_a_wall_behind_blocks_nothing():
    profile, _ = grown(np.where(np.arange(64) == 0, 0.5, np.inf))
    assert profile_at(profile, 0.0) == pytest.approx(0.41)
    assert profile_at(profile, math.pi) == math.inf
    touching, _ = grown(np.where(np.arange(64) == 0, 0.05, np.inf))
    assert profile_at(touching, 0.3) == 0.0
    assert profile_at(touching, math.pi) == math.inf


def test_unmeasured_bearings_block_themselves_only():
    one, _ = grown(np.where(np.arange(32) == 5, np.nan, np.inf))
    middle = 5 * math.tau / 32
    assert profile_at(one, middle) == 0.0
    assert profile_at(one, middle + 0.2) == math.inf
    pinhole, _ = grown(np.full(9, np.inf), np.linspace(-0.4, 0.4, 9))
    assert profile_at(pinhole, 0.0) == math.inf
    assert profile_at(pinhole, 0.5) == profile_at(pinhole, math.pi) == 0.0
