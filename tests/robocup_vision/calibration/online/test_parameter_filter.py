"""The estimate of a camera's parameters over time: honest, forgetful, and not shaken by one wrong frame."""

import numpy as np
import pytest

from robocup_vision.calibration.online.evidence import Evidence
from robocup_vision.calibration.online.parameter_filter import (
    ParameterFilter,
    ParameterFilterSettings,
    log_evidence,
)

STD = np.array([1.5, 1.5, 0.01])
SETTINGS = ParameterFilterSettings()
DT_S = 0.15


def a_filter(settings=SETTINGS):
    return ParameterFilter(np.zeros(3), STD, STD, settings)


def frame(rng, truth, std=0.3):
    """Evidence of a frame that measures two random combinations of the parameters."""
    rows = rng.standard_normal((2, 3)) / STD / std
    measured = rows @ truth + rng.standard_normal(2)
    about = 0.3 * STD * rng.standard_normal(3)
    return Evidence(about, rows.T @ rows, rows.T @ (measured - rows @ about))


def test_estimates_are_as_sure_as_they_say():
    rng = np.random.default_rng(1)
    nees = []
    for _ in range(60):
        belief, truth = a_filter(), STD * rng.standard_normal(3)
        for _ in range(10):
            belief.update(frame(rng, truth))
        error = belief.mean - truth
        nees.append(error @ np.linalg.solve(belief.covariance, error))
    # chi-square with 3 degrees of freedom, mean of 60: standard deviation 0.32
    assert np.mean(nees) == pytest.approx(3.0, abs=1.0)
    assert (belief.std < 0.3 * STD).all()


def test_what_no_frame_tells_stays_at_the_file():
    belief = a_filter()
    only_first = Evidence(np.zeros(3), np.diag([100.0, 0.0, 0.0]), np.array([50.0, 0.0, 0.0]))
    for _ in range(5):
        belief.update(only_first)
    np.testing.assert_allclose(belief.mean[1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(belief.std[1:], STD[1:], rtol=1e-6)
    assert belief.mean[0] == pytest.approx(0.5, abs=0.01)


def test_it_returns_to_the_file_where_nothing_tells():
    belief = a_filter()
    belief.update(Evidence(np.zeros(3), 1e4 * np.eye(3), 1e4 * np.array([1.0, 0.5, 0.01])))
    belief.pass_time(10 * SETTINGS.memory_s)
    np.testing.assert_allclose(belief.mean, 0.0, atol=1e-4)
    np.testing.assert_allclose(belief.std, STD, rtol=1e-6)


def test_log_evidence_is_that_of_a_gaussian_integral():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((2, 2))
    mean, covariance = rng.standard_normal(2), root @ root.T + 0.1 * np.eye(2)
    one = Evidence(rng.standard_normal(2), np.diag([3.0, 0.5]), rng.standard_normal(2))
    drawn = rng.multivariate_normal(mean, covariance, 400_000) - one.about
    like = np.exp(drawn @ one.gradient - 0.5 * np.einsum("ni,ij,nj->n", drawn, one.information, drawn))
    assert log_evidence(one, mean, covariance) == pytest.approx(np.log(like.mean()), abs=0.02)


def settled(rng, truth):
    belief = a_filter()
    for _ in range(60):
        one = frame(rng, truth)
        assert not belief.is_knocked(one, DT_S)
        belief.update(one)
    return belief


def test_a_knock_is_noticed_within_a_second_and_followed():
    rng = np.random.default_rng(3)
    belief = settled(rng, np.zeros(3))
    truth = np.array([2.0, -1.5, 0.01])
    noticed = []
    for index in range(20):
        one = frame(rng, truth)
        if belief.is_knocked(one, DT_S):
            noticed.append(index)
        elif belief.is_in_doubt:
            continue
        belief.update(one)
    assert len(noticed) == 1
    assert noticed[0] <= 6
    assert belief.knocks == 1
    assert (np.abs(belief.mean - truth) < 4 * belief.std).all()


def test_one_wrong_frame_is_no_knock():
    rng = np.random.default_rng(4)
    belief = settled(rng, np.zeros(3))
    wrong = Evidence(np.array([5.0, 5.0, 0.0]), np.diag([100.0, 100.0, 1e4]), np.zeros(3))
    assert not belief.is_knocked(wrong, DT_S)
    assert belief.is_in_doubt
    for _ in range(20):
        assert not belief.is_knocked(frame(rng, np.zeros(3)), DT_S)
    assert not belief.is_in_doubt
