"""Weighing of poses found without a prior."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.localization.model_edges.evidence import (
    CandidateSettings,
    Evidence,
    accepted,
    log_weight,
    posterior,
)

GOOD = Evidence(100, 100, 80, 0, 20, 80, 0.2, 3.0, 40, 40, 5, 0.02, 8, 4.0)


@pytest.mark.parametrize(
    "change",
    [
        {"missing": 8.0},
        {"found": 50.0},
        {"explained": 30.0},
        {"rms_px": 0.6},
        {"edges": 5.0},
        {"position_std_m": 0.3},
    ],
)
def test_what_speaks_against_a_pose_lowers_its_weight(change):
    settings = CandidateSettings()
    assert log_weight(GOOD._replace(**change), settings) < log_weight(GOOD, settings) - 0.5


@given(st.lists(st.floats(-800.0, 800.0), max_size=8), st.floats(-5.0, 5.0))
def test_probabilities_are_those_of_the_poses_and_of_none(weights, more):
    found = posterior(weights)
    assert found.shape == (len(weights),)
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert found.sum() <= 1.0 + 1e-12
    for low, high in zip(np.argsort(weights)[:-1], np.argsort(weights)[1:], strict=True):
        assert found[low] <= found[high]
    # one more pose takes from all the others alike
    joined = posterior([*weights, more])
    assert (joined[:-1] <= found + 1e-12).all()


def test_a_pose_as_likely_as_none_has_half():
    np.testing.assert_allclose(posterior([0.0]), [0.5])
    np.testing.assert_allclose(posterior([]), [])


def test_one_is_the_answer_or_a_few_together():
    settings = CandidateSettings(min_probability=0.9, min_together=0.95, max_candidates=3)
    assert accepted(np.array([0.03, 0.93]), settings) == [1]
    assert accepted(np.array([0.5, 0.02, 0.46]), settings) == [0, 2]
    # 0.91 together is not enough of two, and a fourth is not asked
    assert accepted(np.array([0.5, 0.41]), settings) == []
    assert accepted(np.array([0.25, 0.25, 0.25, 0.25]), settings) == []
    assert accepted(np.array([]), settings) == []
