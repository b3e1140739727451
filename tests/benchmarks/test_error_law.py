"""The laws of errors behind benchmarks.planning.other_errors: a fit finds the law that errors follow, as do draws."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from benchmarks.worlds.error_law import MATCHED, ErrorLaw

EVEN = (np.arange(4000) + 0.5) / 4000
# quantiles of the unit laws in closed form (Student's t by W. T. Shaw, 2006)
TWO = (2 * EVEN - 1) / np.sqrt(2 * EVEN * (1 - EVEN))
_ROOT = np.sqrt(4 * EVEN * (1 - EVEN))
FOUR = np.sign(EVEN - 0.5) * 2 * np.sqrt(np.cos(np.arccos(_ROOT) / 3) / _ROOT - 1)
NORMAL = np.array([NormalDist().inv_cdf(p) for p in EVEN.tolist()])
LAWS = [(2.0, TWO), (4.0, FOUR), (math.inf, NORMAL)]


@pytest.mark.parametrize("scale", [0.3, 1.5])
@pytest.mark.parametrize(("degrees", "quantiles"), LAWS)
def test_a_fit_finds_the_law_that_errors_follow(degrees: float, quantiles: np.ndarray, scale: float) -> None:
    fitted = ErrorLaw.fitted(scale * quantiles)
    assert fitted.scale == pytest.approx(scale, rel=0.01)
    # the normal law is the limit of many degrees
    assert fitted.degrees > 100 if math.isinf(degrees) else fitted.degrees == pytest.approx(degrees, rel=0.02)


@pytest.mark.parametrize(("degrees", "quantiles"), LAWS)
def test_draws_follow_their_law(degrees: float, quantiles: np.ndarray) -> None:
    drawn = ErrorLaw(degrees, 1.5).draw(np.random.default_rng(3), 4000)
    for order in (100, 1000, 2000, 3000, 3900):
        assert np.mean(drawn < 1.5 * quantiles[order]) == pytest.approx(order / 4000, abs=0.03)


def test_the_planner_reckons_with_normal_errors_of_its_own_scale() -> None:
    drawn = MATCHED.obstacle.draw(np.random.default_rng(3), 4000)
    assert np.std(drawn) == pytest.approx(1.0, abs=0.03)
    assert np.quantile(np.abs(drawn), 0.99) == pytest.approx(2.58, abs=0.15)
    assert MATCHED.missed == 1.0


def test_an_offset_that_all_errors_have_is_part_of_the_law() -> None:
    assert ErrorLaw.fitted(NORMAL + 1.0).scale == pytest.approx(math.sqrt(2.0), rel=0.01)
