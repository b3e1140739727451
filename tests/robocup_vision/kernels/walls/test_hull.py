"""The compiled convex hull of a floor outline against plain NumPy twins."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robocup_vision.kernels.walls.hull import hull_radius, star_moments

COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
seeds = st.integers(0, 2**32 - 1)


def hull_twin(angles, radius):
    """Farthest crossing of each ray with a segment between any two points: the hull, if the origin lies inside it."""
    known = radius > 0
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)[known] * radius[known, None]
    first, second = (points[i] for i in np.triu_indices(len(points), 1))
    out = np.zeros(len(angles))
    for k, (c, s) in enumerate(zip(np.cos(angles), np.sin(angles), strict=True)):
        a, b = (c * p[:, 1] - s * p[:, 0] for p in (first, second))
        crosses = (np.minimum(a, b) <= 1e-9) & (np.maximum(a, b) >= -1e-9) & (np.abs(a - b) > 1e-9)
        along = (first @ (c, s))[crosses], (second @ (c, s))[crosses]
        t = a[crosses] / (a - b)[crosses]
        out[k] = (along[0] + t * (along[1] - along[0])).max()
    return out


@given(seeds)
def test_hull_agrees_with_its_twin(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(8, 60))
    angles = np.arange(count) * math.tau / count
    radius = rng.uniform(20.0, 110.0, count)
    radius[rng.random(count) < 0.4] = np.nan
    known = np.flatnonzero(radius > 0)
    assume(len(known) >= 3)
    assume(np.diff(np.append(known, known[0] + count)).max() < count / 2)  # otherwise the origin lies outside
    out = np.empty(count)
    assert hull_radius(np.cos(angles), np.sin(angles), radius, out) == len(known)
    np.testing.assert_allclose(out, hull_twin(angles, radius), rtol=1e-9)
    assert (out[known] >= radius[known] - 1e-9).all()


@given(seeds)
def test_hull_of_a_one_sided_outline_is_finite(seed):
    rng = np.random.default_rng(seed)
    radius = np.full(COUNT, np.nan)
    first, length = rng.integers(0, COUNT), rng.integers(3, COUNT)
    radius[(first + np.arange(length)) % COUNT] = rng.uniform(20.0, 110.0, length)
    out = np.full(COUNT, np.nan)
    assert hull_radius(COS, SIN, radius, out) == length
    assert np.isfinite(out).all()


def test_too_few_points_have_no_hull():
    radius = np.full(COUNT, np.nan)
    radius[:2] = 50.0
    assert hull_radius(COS, SIN, radius, np.empty(COUNT)) == 2


def moments_twin(corners):
    """Sum over the triangles to the origin, by the three mid-point rule, which is exact for quadratic functions."""
    following = np.roll(corners, -1, axis=0)
    area = (corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]) / 2
    middles = np.stack([corners / 2, following / 2, (corners + following) / 2])
    total = area.sum()
    mean = (area[None, :, None] * middles / 3).sum(axis=(0, 1)) / total
    second = np.einsum("k,tki,tkj->ij", area / 3, middles, middles) / total - np.outer(mean, mean)
    return mean, second


@given(seeds)
def test_star_moments_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.2, 2.0, COUNT)
    mean, second = moments_twin(np.stack([COS, SIN], axis=1) * range_m[:, None])
    x, y, axis = star_moments(COS, SIN, range_m)
    np.testing.assert_allclose((x, y), mean, atol=1e-12)
    direction = np.array([math.cos(axis), math.sin(axis)])
    assert direction @ second @ direction == pytest.approx(np.linalg.eigvalsh(second)[1])
