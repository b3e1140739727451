"""Swapped red and blue by the colours of points on the goals: under a wrong light, with clutter before the goals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from robocup_vision.localization.swapped_channels import swapped_nats

# log R/G and B/G of yellow, blue, both with red and blue swapped, and white
PALETTE = np.array([[0.09, -1.77], [-0.83, 0.86], [-1.77, 0.09], [0.86, -0.83], [0.0, 0.0]])


@given(
    st.integers(0, 2**32 - 1),
    numbers(-0.25, 0.25),
    numbers(-0.25, 0.25),
    st.booleans(),
    st.sampled_from([(1, 1), (1, 0)]),
)
def test_goals_under_a_light_that_white_tells_badly(seed, red, blue, half_turn, in_view):
    rng = np.random.default_rng(seed)
    is_positive = np.repeat([True, False], 24)[: 24 * sum(in_view)]
    for first in (0, 2):
        row = first + (is_positive == half_turn)
        points = PALETTE[row] + (red, blue) + rng.normal(0.0, 0.1, (len(row), 2))
        # a third is something grey before the goal
        points[::3] = rng.normal(0.0, 0.1, points[::3].shape)
        assert (swapped_nats(points, is_positive, PALETTE) > 0.0) == (first == 2)


@pytest.mark.parametrize("count", [0, 5])
def test_nothing_but_white_shows_no_swap(count):
    assert swapped_nats(np.zeros((count, 2)), np.ones(count, dtype=bool), PALETTE) <= 0.0
