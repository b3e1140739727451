"""Bearings joined to things, against a plain union of neighbours."""

import math

import numpy as np
import pytest

from robocup_vision.kernels.floor.stretches import join_bearings

GAP_M, COUNT = 0.05, 60


def plainly_joined(places, seen, step_rad):
    """Things by following neighbours from each bearing that begins one."""
    away = np.hypot(*places.T)
    apart = np.hypot(*(places - np.roll(places, 1, axis=0)).T)
    goes_on = seen & np.roll(seen, 1) & (apart < GAP_M + away * step_rad)
    starts = np.flatnonzero(seen & ~goes_on)
    if not len(starts) and seen.all():
        starts = np.array([0])
    things = []
    for start in starts:
        members = [start]
        while len(members) < COUNT and goes_on[(members[-1] + 1) % COUNT]:
            members.append((members[-1] + 1) % COUNT)
        width = math.dist(places[members[0]], places[members[-1]]) + step_rad * away[members].mean()
        things.append([*places[members].mean(axis=0), width])
    return np.array(things).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(6))
def test_bearings_are_joined_as_plainly(seed):
    rng = np.random.default_rng(seed)
    step_rad = math.tau / COUNT
    angle = step_rad * np.arange(COUNT)
    # steps in range between things, gaps, and, of one seed, something all around
    away = np.repeat(rng.uniform(0.3, 1.5, COUNT // 5), 5) if seed else np.full(COUNT, 0.8)
    places = away[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    seen = rng.random(COUNT) < 0.9 if seed else np.ones(COUNT, dtype=bool)
    out = np.empty((COUNT, 5))
    number = join_bearings(places, seen, GAP_M, step_rad, out)
    expected = plainly_joined(places, seen, step_rad)
    assert number == len(expected)
    np.testing.assert_allclose(out[:number, :3], expected, atol=1e-12)
    np.testing.assert_allclose(out[:number, 3], np.arctan2(expected[:, 1], expected[:, 0]))
    np.testing.assert_allclose(out[:number, 4], np.hypot(*expected[:, :2].T))


def test_open_floor_shows_nothing():
    assert join_bearings(np.zeros((COUNT, 2)), np.zeros(COUNT, dtype=bool), GAP_M, 0.1, np.empty((COUNT, 5))) == 0
