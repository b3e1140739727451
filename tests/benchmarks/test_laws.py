"""Error laws, covariances that are honest, and references that err."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from benchmarks.scores.photograph_balls import continued
from benchmarks.scores.photograph_consistency import mean_errors, nees
from benchmarks.scores.photograph_floor import walls_near_m
from benchmarks.worlds.uncertain_robot import MATCHED, ErrorLaw
from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Scene

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


def test_errors_of_a_covariance_have_as_many_units_as_unknowns():
    rng = np.random.default_rng(3)
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.02, 0.003], [0.0, 0.003, 0.01]])
    errors = rng.multivariate_normal(np.zeros(3), covariance, 4000)
    assert abs(np.mean([nees(error, covariance) for error in errors]) - 3.0) < 0.2


def test_an_uncertain_reference_lowers_it():
    error, covariance = np.array([0.03, -0.02]), np.diag([1e-4, 4e-4])
    np.testing.assert_allclose(nees(error, covariance), 10.0)
    assert nees(error, covariance + np.diag([1e-4, 1e-4])) < 10.0


def test_expected_errors_are_those_that_the_covariances_draw():
    covariances = np.array([np.diag([0.04, 0.04, 0.01]), np.diag([0.01, 0.01, 0.04])])
    away_m, turn_rad = mean_errors(covariances)
    assert abs(away_m - np.sqrt(np.pi / 2) * 0.15) < 0.01
    assert abs(turn_rad - np.sqrt(2 / np.pi) * 0.15) < 0.01


@pytest.mark.parametrize(
    ("box", "whole"),
    [
        ([1.0, 100.0, 11.0, 130.0], [-19.0, 100.0, 11.0, 130.0]),
        ([210.0, 10.0, 223.0, 40.0], [210.0, 10.0, 240.0, 40.0]),
        ([100.0, 10.0, 111.0, 40.0], [100.0, 10.0, 111.0, 40.0]),
        ([0.0, 10.0, 40.0, 40.0], [0.0, 10.0, 40.0, 40.0]),
    ],
)
def test_a_box_that_the_rim_cuts_goes_on_to_the_width_of_its_height(box, whole):
    assert continued(box, 224) == whole


ROOM = Scene(load_field("ssl_2001"))


def test_a_reference_that_errs_puts_walls_between_two_distances():
    bearing = np.linspace(-1.0, 1.0, 21)
    nearest, farthest = walls_near_m(ROOM, Pose2(0.3, 0.1, 0.2), bearing)
    away = ROOM.free_range_m(Pose2(0.3, 0.1, 0.2), bearing)
    assert np.all(nearest < away)
    assert np.all(away < farthest)
    # a thirtieth of a metre, and of a radian, at up to 2 m
    assert np.all(farthest - nearest < 0.5)
    ahead_m = ROOM.field.width_m / 2
    near = walls_near_m(ROOM, Pose2(0.0, 0.0, math.pi / 2), np.zeros(1))
    np.testing.assert_allclose(near, [[ahead_m - 1 / 30], [ahead_m + 1 / 30]], atol=2e-3)
