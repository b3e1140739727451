"""The estimate of a camera's parameters over time: honest, forgetful, and not shaken by one wrong frame."""

import numpy as np
import pytest

from robocup_vision.calibration.online.evidence import Evidence
from robocup_vision.calibration.online.parameter_filter import (
    ParameterFilter,
    ParameterFilterSettings,
    log_evidence,
)
from robocup_vision.geometry import Pose2

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


def somewhere(rng):
    """Return the camera's pose, seldom near another."""
    return Pose2(*rng.uniform(-50.0, 50.0, 2).tolist(), 0.0)


def test_estimates_are_as_sure_as_they_say():
    rng = np.random.default_rng(1)
    nees = []
    for _ in range(60):
        belief, truth = a_filter(), STD * rng.standard_normal(3)
        for _ in range(10):
            belief.take(frame(rng, truth), somewhere(rng), DT_S)
        error = belief.mean - truth
        nees.append(error @ np.linalg.solve(belief.covariance, error))
    # chi-square with 3 degrees of freedom, mean of 60: standard deviation 0.32
    assert np.mean(nees) == pytest.approx(3.0, abs=1.0)
    assert (belief.std < 0.3 * STD).all()


def test_what_no_frame_tells_stays_at_the_file():
    rng = np.random.default_rng(7)
    belief = a_filter()
    only_first = Evidence(np.zeros(3), np.diag([100.0, 0.0, 0.0]), np.array([50.0, 0.0, 0.0]))
    for _ in range(5):
        belief.take(only_first, somewhere(rng), DT_S)
    np.testing.assert_allclose(belief.mean[1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(belief.std[1:], STD[1:], rtol=1e-6)
    assert belief.mean[0] == pytest.approx(0.5, abs=0.01)


def test_it_returns_to_the_file_where_nothing_tells():
    belief = a_filter()
    rng = np.random.default_rng(8)
    for _ in range(3):
        belief.take(
            Evidence(np.zeros(3), np.diag([30.0, 30.0, 1e5]), np.array([30.0, 15.0, 500.0])), somewhere(rng), 0.1
        )
    assert (belief.std < STD).all()
    belief.take(Evidence(np.zeros(3), np.zeros((3, 3)), np.zeros(3)), somewhere(rng), 10 * SETTINGS.memory_s)
    np.testing.assert_allclose(belief.mean, 0.0, atol=1e-3)
    np.testing.assert_allclose(belief.std, STD, rtol=1e-6)


def test_one_place_counts_once():
    rng = np.random.default_rng(9)
    belief, here = a_filter(), Pose2(1.0, 2.0, 0.5)
    belief.take(frame(rng, np.zeros(3)), here, DT_S)
    once = belief.std
    for _ in range(5):
        belief.take(frame(rng, np.zeros(3)), here.compose(Pose2(0.02, 0.0, 0.1)), DT_S)
    assert (belief.std >= once).all()
    belief.take(frame(rng, np.zeros(3)), here.compose(Pose2(0.0, 0.0, 0.5)), DT_S)
    assert belief.std.sum() < once.sum()


def test_log_evidence_is_that_of_a_gaussian_integral():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((2, 2))
    mean, covariance = rng.standard_normal(2), root @ root.T + 0.1 * np.eye(2)
    one = Evidence(rng.standard_normal(2), np.diag([3.0, 0.5]), rng.standard_normal(2))
    drawn = rng.multivariate_normal(mean, covariance, 400_000) - one.linearised_at
    like = np.exp(drawn @ one.gradient - 0.5 * np.einsum("ni,ij,nj->n", drawn, one.information, drawn))
    assert log_evidence(one, mean, covariance) == pytest.approx(np.log(like.mean()), abs=0.02)


def settled(rng, truth):
    belief = a_filter()
    for _ in range(60):
        belief.take(frame(rng, truth), somewhere(rng), DT_S)
        assert belief.knocks == 0
    return belief


def test_a_knock_is_noticed_within_a_second_and_followed():
    rng = np.random.default_rng(3)
    belief = settled(rng, np.zeros(3))
    truth = np.array([2.0, -1.5, 0.01])
    noticed = []
    for _ in range(20):
        belief.take(frame(rng, truth), somewhere(rng), DT_S)
        noticed.append(belief.knocks)
    assert noticed[6] == noticed[-1] == 1
    assert (np.abs(belief.mean - truth) < 4 * belief.std).all()


def test_a_knock_that_single_frames_hardly_show_is_noticed_too():
    rng = np.random.default_rng(10)
    belief = a_filter()
    for _ in range(200):
        belief.take(frame(rng, np.zeros(3), std=1.5), somewhere(rng), DT_S)
    assert belief.knocks == 0
    for _ in range(60):
        belief.take(frame(rng, np.array([2.5, 0.0, 0.0]), std=1.5), somewhere(rng), DT_S)
    assert belief.knocks == 1
    assert belief.mean[0] == pytest.approx(2.5, abs=4 * belief.std[0])


def test_a_robot_that_stands_notices_a_knock():
    rng = np.random.default_rng(11)
    belief, here = settled(rng, np.zeros(3)), Pose2(0.0, 0.0, 0.0)
    moved = Evidence(np.array([2.0, 0.0, 0.0]), np.diag([50.0, 50.0, 1e6]), np.zeros(3))
    for _ in range(40):
        belief.take(moved, here, DT_S)
    assert belief.knocks == 1
    assert belief.mean[0] == pytest.approx(2.0, abs=0.2)


def test_one_wrong_frame_is_no_knock():
    rng = np.random.default_rng(4)
    belief = settled(rng, np.zeros(3))
    before = belief.mean.copy()
    wrong = Evidence(np.array([5.0, 5.0, 0.0]), np.diag([100.0, 100.0, 1e4]), np.zeros(3))
    belief.take(wrong, somewhere(rng), DT_S)
    np.testing.assert_allclose(belief.mean, before, atol=1e-3)
    for _ in range(20):
        belief.take(frame(rng, np.zeros(3)), somewhere(rng), DT_S)
    assert belief.knocks == 0
