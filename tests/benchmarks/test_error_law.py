"""The laws of errors: the planner's own is the normal one, and a fit finds the law that errors were drawn from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.worlds.error_law import MATCHED, ErrorLaw


def test_the_planners_own_errors_are_standard_normal() -> None:
    drawn = MATCHED.pose.draw(np.random.default_rng(3), 5)
    np.testing.assert_array_equal(drawn, np.random.default_rng(3).standard_normal(5))
    assert MATCHED.missed == 1.0


@pytest.mark.parametrize(("degrees", "scale"), [(2.5, 1.0), (4.0, 0.3)])
def test_a_fit_finds_the_law_that_was_drawn_from(degrees: float, scale: float) -> None:
    drawn = ErrorLaw(degrees, scale).draw(np.random.default_rng(1), 4000)
    fitted = ErrorLaw.fitted(drawn)
    assert fitted.degrees == pytest.approx(degrees, rel=0.2)
    assert fitted.scale == pytest.approx(scale, rel=0.06)


def test_normal_errors_are_fitted_by_light_tails() -> None:
    fitted = ErrorLaw.fitted(ErrorLaw(math.inf, 1.5).draw(np.random.default_rng(2), 4000))
    assert fitted.degrees > 20
    assert fitted.scale == pytest.approx(1.5, rel=0.05)
