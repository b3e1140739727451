"""Discs: what is refused, and the direction in which a covariance is largest."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import numbers

from field_models.errors import ArgumentError
from robocup_vision.disc import Disc


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"x_m": math.nan}, "x_m must be finite, got nan"),
        ({"vy_mps": math.inf}, "vy_mps must be finite, got inf"),
        ({"radius_m": -0.1}, "radius_m must not be negative, got -0.1"),
        ({"radius_m": math.inf}, "radius_m must not be negative, got inf"),
        ({"height_m": -0.1}, "height_m must not be negative, got -0.1"),
        ({"covariance": np.eye(3)}, r"covariance must be \(2, 2\) and finite"),
        ({"covariance": np.full((2, 2), math.nan)}, r"covariance must be \(2, 2\) and finite"),
        ({"velocity_covariance": np.eye(3)}, r"velocity_covariance must be \(2, 2\) and finite"),
    ],
)
def test_values_out_of_range_are_refused_by_name(values, message):
    with pytest.raises(ArgumentError, match=f"a disc's {message}"):
        Disc(**({"x_m": 1.0, "y_m": 0.0, "radius_m": 0.09} | values))


def test_a_disc_is_exact_at_rest_and_of_unknown_height_unless_given():
    disc = Disc(1.0, 2.0, 0.09)
    assert (disc.std_m, disc.velocity_std_mps, disc.vx_mps, disc.vy_mps) == (0.0, 0.0, 0.0, 0.0)
    assert disc.height_m == math.inf
    assert not disc.covariance.flags.writeable


@given(numbers(0.001, 1.0), numbers(0.001, 1.0), numbers(-math.pi, math.pi))
def test_the_standard_deviation_is_that_of_the_longer_axis(first, second, angle):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    covariance = turn @ np.diag([first**2, second**2]) @ turn.T
    disc = Disc(0.0, 0.0, 0.1, covariance, velocity_covariance=4.0 * covariance)
    assert disc.std_m == pytest.approx(max(first, second), rel=1e-9)
    assert disc.velocity_std_mps == pytest.approx(2.0 * max(first, second), rel=1e-9)
