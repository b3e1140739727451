"""NEES of errors drawn from a covariance is the number of unknowns on average; a reference's error lowers it."""

import numpy as np

from benchmarks.scores.photograph_consistency import mean_errors, nees


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
