"""Weights of a goal's edges."""

import numpy as np
import pytest

from robocup_vision.localization.goal.edges import EdgeSamples
from robocup_vision.localization.goal.fit import doubting_edges

SIGMA = 0.3


def samples_of(edges: list[int], marks: int) -> EdgeSamples:
    count, no_index = len(edges), np.empty(0, np.int64)
    return EdgeSamples(
        np.array(edges),
        np.zeros((count, 2)),
        no_index,
        no_index,
        np.empty((0, 2)),
        np.empty((0, 2)),
        np.full(count + marks, SIGMA),
        np.zeros(6, np.int64),
        np.zeros((marks, 3)),
        np.zeros((marks, 2)),
        np.zeros((marks, 2)),
    )


def test_an_edge_that_is_off_as_a_whole_counts_less_and_marks_as_before():
    samples = samples_of([0] * 9 + [4] * 16, marks=3)
    residual = np.concatenate([np.tile([0.2, -0.2, 0.0], 3), np.full(16, 1.5), np.full(3, 5.0)])
    sigma = doubting_edges(samples, residual, 0.0).sigma
    np.testing.assert_allclose(sigma[:9], SIGMA)
    # 16 samples that share an error of 1.5 pixels tell as much as one of that noise
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1.5**-2, rel=0.01)
    np.testing.assert_allclose(sigma[25:], SIGMA)


def test_where_edges_are_off_the_others_are_less_certain_too():
    samples = samples_of([0] * 9 + [4] * 16 + [5] * 4, marks=3)
    residual = np.concatenate([np.zeros(9), np.full(16, 0.3), np.full(4, 9.0), np.zeros(3)])
    sigma = doubting_edges(samples, residual, 0.5).sigma
    typical_px2 = (0.0 + 0.3**2 + 0.5**2) / 3
    assert np.sum(sigma[:9] ** -2) == pytest.approx(1 / (SIGMA**2 / 9 + typical_px2))
    assert np.sum(sigma[9:25] ** -2) == pytest.approx(1 / (SIGMA**2 / 16 + 0.3**2 + typical_px2))
    np.testing.assert_allclose(sigma[29:], SIGMA)
    exact = doubting_edges(samples, np.zeros(32), 0.5).sigma
    np.testing.assert_allclose(exact, SIGMA)
