"""What a fit's evidence weighs: odds of one pose, and which of several are believed."""

from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from wrong_files import problem_of

from robocup_vision.kernels.model_edges.verdict import log_odds
from robocup_vision.localization.model_edges.evidence import CandidateSettings, Evidence, accepted, posterior, weigh
from robocup_vision.localization.model_edges.weights import load_edge_weights

WEIGHTS = load_edge_weights()


def changed(evidence, **change):
    """Return evidence with its odds, some of it changed."""
    one = evidence._replace(**change)
    odds, if_fixed = (log_odds(np.array(each), WEIGHTS.near_prior) for each in (one, one._replace(position_std_m=0.0)))
    return one._replace(log_odds=odds, log_odds_if_fixed=if_fixed)


BLANK = Evidence(*np.zeros(len(Evidence._fields)))
GOOD = changed(
    BLANK,
    samples=100, looked_for=100, found=80, missing=2, inliers=80, rms_px=0.2, prior_distance2=2.0, points=40,
    explained=39, edges=8, position_std_m=0.02, found_upright=20, hidden_upright=2,
)  # fmt: skip
# four samples of one line
FAINT = changed(
    GOOD, found=4, missing=0, inliers=4, rms_px=0.3, points=0, explained=0, edges=1, position_std_m=0.5, found_upright=0
)


@pytest.mark.parametrize(
    "change",
    [
        {"missing": 20.0},
        {"explained": 25.0},
        {"rms_px": 0.6},
        {"edges": 5.0},
        {"position_std_m": 0.3},
        {"hidden_upright": 40.0},
        {"inliers": 10.0},
    ],
)
def test_what_speaks_against_a_pose_lowers_its_odds(change):
    less = changed(GOOD, **change)
    assert less.log_odds < GOOD.log_odds - 0.4
    assert less.log_odds_anywhere(WEIGHTS) < GOOD.log_odds_anywhere(WEIGHTS) - 0.4


def test_the_distance_counts_from_a_prior_alone():
    far = changed(GOOD, prior_distance2=12.0)
    assert far.log_odds < GOOD.log_odds - 1.0
    assert far.log_odds_anywhere(WEIGHTS) == pytest.approx(GOOD.log_odds_anywhere(WEIGHTS))


def test_every_reason_to_refuse():
    assert weigh(GOOD).reason is None
    assert "only 2 of 100 places" in str(weigh(changed(GOOD, inliers=2)).reason)
    less = changed(GOOD, found=20, inliers=20, edges=3)
    assert weigh(less).reason is None
    for against in ({"missing": 40}, {"explained": 0}, {"prior_distance2": 30.0}, {"rms_px": 2.0}):
        assert "odds" in str(weigh(changed(less, **against)).reason)


def test_the_frames_before_vouch_for_a_prior_that_a_frame_hardly_shows():
    assert weigh(FAINT).reason is not None
    assert weigh(FAINT, 3.0).reason is None
    few = changed(FAINT, found=2, inliers=2)
    assert "places on edges agree" in str(weigh(few, 3.0).reason)
    # what contradicts the pose outweighs that
    far = changed(FAINT, prior_distance2=27.0, rms_px=2.0)
    assert "odds" in str(weigh(far, 3.0).reason)
    assert "odds" in str(weigh(changed(FAINT, missing=30), 3.0).reason)


def test_a_frame_that_fixes_nothing_is_neutral():
    open_ = changed(FAINT, found=30, inliers=30, edges=2, position_std_m=9.0)
    assert open_.log_odds < 0.0
    for neutral in (open_, FAINT):
        assert weigh(neutral).log_likelihood_ratio == 0.0
    for against in ({"prior_distance2": 25.0}, {"missing": 40.0}):
        assert weigh(changed(open_, **against)).log_likelihood_ratio < -1.0
    assert weigh(changed(open_, position_std_m=0.02)).log_likelihood_ratio > 1.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "format = 2", "'format': is not a value that this version reads: must be 1, got 2"),
        ("edges = ", "ages = ", "ages"),
        ("near_prior = ", "near_prior = 'x' #", "near_prior"),
        ("missing = ", "missing = nan #", "missing"),
    ],
)
def test_a_wrong_file_is_refused_by_name(old, new, message, tmp_path):
    text = (files("robocup_vision.localization.model_edges") / "evidence.toml").read_text(encoding="utf-8")
    assert message in problem_of(load_edge_weights, tmp_path / "weights.toml", text, old, new)


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
    settings = CandidateSettings(min_probability=0.9, max_candidates=3)
    assert accepted(np.array([0.03, 0.93]), settings) == [1]
    assert accepted(np.array([0.5, 0.02, 0.46]), settings) == [0, 2]
    # 0.88 together is not enough of two, and a fourth is not asked
    assert accepted(np.array([0.5, 0.38]), settings) == []
    assert accepted(np.array([0.25, 0.25, 0.25, 0.25]), settings) == []
    assert accepted(np.array([]), settings) == []
