"""The normal distribution's integral against Python's own."""

from statistics import NormalDist

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.normal import normal_below


@given(st.lists(st.floats(-40.0, 40.0), min_size=1, max_size=20))
def test_it_is_the_integral(values: list[float]) -> None:
    expected = [NormalDist().cdf(value) for value in values]
    np.testing.assert_allclose(normal_below(values), expected, rtol=0.0, atol=3e-8)


def test_it_rises_from_nothing_to_all() -> None:
    z = np.linspace(-12.0, 12.0, 10001)
    assert (np.diff(normal_below(z)) >= 0.0).all()
    assert normal_below([-np.inf, 0.0, np.inf]).tolist() == [normal_below(-9.0), 0.5, 1.0]
    assert np.isnan(normal_below(np.nan))
    assert normal_below(np.zeros((2, 3))).shape == (2, 3)
