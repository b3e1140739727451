"""What tells stray samples from others: fits made anew without each sample."""

import numpy as np
import pytest

from robocup_vision.kernels.model_edges.strays import (
    Noise,
    nearest,
    off_alone,
    off_the_rest,
    shared_variance,
)
from robocup_vision.kernels.model_edges.tables import UNKNOWNS, empty_room

NOISE = Noise(0.15, 0.2, 1.44, 0.3)
COUNT = 24


def fitted(seed):
    """Return samples of six lines, their weights, the covariance of what is found, and the fit to it with the prior."""
    rng, room = np.random.default_rng(seed), empty_room(COUNT, 1)
    room.rows[:] = rng.normal(0.0, 2.0, room.rows.shape)
    room.samples.feature[:] = np.sort(rng.integers(0, 6, COUNT)) * 2
    weight = rng.uniform(0.3, 1.0, COUNT)
    weight[rng.random(COUNT) < 0.2] = 0.0
    agree = np.bincount(room.samples.feature >> 1, weight, 6)
    shared = np.array([shared_variance(NOISE, each, 0.0) for each in agree])
    used, feature = weight > 0.0, room.samples.feature
    covariance = np.diag(NOISE.sample_px**2 / np.where(used, weight, 1.0))
    covariance += shared[feature >> 1][:, None] * (feature[:, None] == feature)
    found = room.rows @ rng.normal(0.0, 0.5, UNKNOWNS) + rng.normal(0.0, 0.5, COUNT)
    return room, weight, used, agree, covariance, found


def solved(rows, covariance, found):
    """Return the fit to what is found, and its information with the prior's."""
    system = np.eye(UNKNOWNS) + rows.T @ np.linalg.solve(covariance, rows)
    return np.linalg.solve(system, rows.T @ np.linalg.solve(covariance, found)), system


@pytest.mark.parametrize("seed", range(4))
def test_a_sample_is_compared_with_the_fit_without_it(seed):
    room, weight, used, agree, covariance, found = fitted(seed)
    every = np.flatnonzero(used)
    z, system = solved(room.rows[every], covariance[np.ix_(every, every)], found[every])
    own2 = np.full(COUNT, np.nan)
    residual = found - room.rows @ z
    off_alone(room, COUNT, weight, residual, NOISE, np.linalg.cholesky(system), agree, np.zeros(6), own2)
    assert not own2[~used].any()
    assert own2.max() > 0.0
    for n in every:
        rest = every[every != n]
        alone, told = solved(room.rows[rest], covariance[np.ix_(rest, rest)], found[rest])
        # what the others of its edge tell of the offset that they share
        by_others = np.linalg.solve(covariance[np.ix_(rest, rest)], covariance[rest, n])
        row = room.rows[n] - by_others @ room.rows[rest]
        off = found[n] - room.rows[n] @ alone - by_others @ (found[rest] - room.rows[rest] @ alone)
        open2 = row @ np.linalg.solve(told, row)
        spread2 = open2 + covariance[n, n] - by_others @ covariance[rest, n]
        rightly = 0.7 * np.exp(-0.5 * off**2 / spread2) / np.sqrt(2.0 * np.pi * spread2)
        odds = 0.3 / (np.sqrt(12.0) * NOISE.stray_px) / max(rightly, 1e-9)
        doubted2 = shared_variance(NOISE, agree[room.samples.feature[n] >> 1], 0.0) - NOISE.shared_px**2
        expected = max(odds * (off**2 + min(open2, NOISE.stray_px**2)) - doubted2, 0.0)
        # a fit that follows a sample nearly alone is not undone any farther
        if spread2 - open2 > 0.02 * spread2:
            assert own2[n] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_few_samples_are_compared_with_the_fit_without_their_thing():
    room, weight, agree = empty_room(5, 1), np.array([1.0, 0.8, 0.9, 1.0, 1.0]), np.array([1.8, 0.0, 2.9])
    room.samples.feature[:] = [0, 1, 4, 4, 4]
    room.rows[:] = np.abs(np.random.default_rng(2).normal(0.0, 1.0, room.rows.shape))
    residual, system = np.array([0.1, 0.2, -0.1, 0.1, 0.0]), np.diag(np.arange(20.0, 20.0 + UNKNOWNS))
    off2 = np.zeros(3)
    off_the_rest(room, 5, weight, residual, NOISE, np.linalg.cholesky(system), agree, off2)
    for thing, samples in ((0, [0, 1]), (2, [2, 3, 4])):
        part = weight[samples] / agree[thing]
        row = part @ room.rows[samples]
        variance = NOISE.sample_px**2 / agree[thing] + shared_variance(NOISE, agree[thing], 0.0)
        left = max(1.0 - row @ np.linalg.solve(system, row) / variance, 0.01)
        assert off2[thing] == pytest.approx((part @ residual[samples] / left) ** 2)
    assert off2[1] == 0.0


def test_the_more_agree_the_less_they_may_be_off_together():
    for agree, off2 in ((1.0, 0.0), (2.5, 0.0), (1.0, 4.0)):
        expected = 0.2**2 + (1.44**2 + off2) * 0.3**agree
        assert shared_variance(NOISE, agree, off2) == pytest.approx(expected)


def test_the_nearest_candidate_counts():
    room = empty_room(2, 1)
    room.found.candidates[:] = [2, 0]
    room.found.offset_px[0, :2] = (3.0, -0.5)
    assert nearest(room.found, 0, 0.4) == pytest.approx(-0.9)
    assert nearest(room.found, 1, 0.0) == 1e9
