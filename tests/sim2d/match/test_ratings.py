"""Ratings: known strengths are found, the order of players does not matter, errors are as large as they are said."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from field_models.errors import ArgumentError
from sim2d.match.table import RatingSettings, rate_players


def points_of(strengths, matches, rng, draw_ratio=0.0):
    """Let players of known Elo play; a part of the matches ends in a draw, whoever plays."""
    count = len(strengths)
    points = np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            chance = 1 / (1 + 10 ** ((strengths[j] - strengths[i]) / 400))
            drawn = rng.binomial(matches, draw_ratio)
            won = rng.binomial(matches - drawn, chance) + 0.5 * drawn
            points[i, j], points[j, i] = won, matches - won
    return points


@st.composite
def tables(draw):
    count = draw(st.integers(2, 6))
    halves = draw(arrays.arrays(np.int64, (count, count), elements=st.integers(0, 40)))
    np.fill_diagonal(halves, 0)
    return halves / 2.0


@given(tables(), st.randoms(use_true_random=False))
def test_permuted_players_have_permuted_ratings(points, random):
    order = list(range(len(points)))
    random.shuffle(order)
    ratings, permuted = rate_players(points), rate_players(points[np.ix_(order, order)])
    np.testing.assert_allclose(permuted.elo, ratings.elo[order], rtol=0, atol=1e-6)
    np.testing.assert_allclose(permuted.covariance, ratings.covariance[np.ix_(order, order)], rtol=1e-6, atol=1e-6)


@given(tables())
def test_ratings_are_the_maximum_and_their_mean_is_fixed(points):
    ratings = rate_players(points)
    assert ratings.elo.mean() == pytest.approx(1500.0)
    assert np.isfinite(ratings.elo).all()
    # at the maximum what a player has won is what its ratings and the prior say
    logit = (ratings.elo - 1500.0) * math.log(10) / 400
    chance = 1 / (1 + np.exp(logit[None, :] - logit[:, None]))
    expected = ((points + points.T) * chance).sum(axis=1) + (1 / math.log(10)) ** 2 * logit
    np.testing.assert_allclose(points.sum(axis=1), expected, rtol=0, atol=1e-6)


@given(st.integers(2, 6), st.integers(0, 40))
def test_equal_players_have_equal_ratings(count, halves):
    ratings = rate_players(halves / 2 * (1 - np.eye(count)))
    np.testing.assert_allclose(ratings.elo, 1500.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ratings.std_error_elo, ratings.std_error_elo[0])


def test_known_strengths_are_recovered():
    strengths = np.array([1300.0, 1450.0, 1500.0, 1750.0])
    ratings = rate_players(points_of(strengths, 100_000, np.random.default_rng(3)))
    np.testing.assert_allclose(ratings.elo, strengths, rtol=0, atol=5.0)
    assert ratings.std_error_elo.max() < 2.0


@pytest.mark.parametrize("draw_ratio", [0.0, 0.5])
def test_errors_are_as_large_as_they_are_said_to_be(draw_ratio):
    # draws pull together: the truth is what the mean score says
    strengths, rng = np.array([1500.0, 1500.0, 1500.0]), np.random.default_rng(5)
    found = [rate_players(points_of(strengths, 60, rng, draw_ratio)) for _ in range(300)]
    measured = np.std([ratings.elo for ratings in found], axis=0)
    stated = np.mean([ratings.std_error_elo for ratings in found], axis=0)
    # half of the matches drawn: half of the variance
    np.testing.assert_allclose(measured / stated, math.sqrt(1 - draw_ratio), rtol=0.1)
    apart = [ratings.difference(0, 1) for ratings in found]
    assert np.std([mean for mean, _ in apart]) < 1.1 * np.mean([error for _, error in apart])


def test_an_unbeaten_player_is_finite_and_unsure():
    few = rate_players(np.array([[0.0, 4.0], [0.0, 0.0]]))
    many = rate_players(np.array([[0.0, 400.0], [0.0, 0.0]]))
    assert few.elo[0] < many.elo[0] < 3500.0
    ahead, error = few.difference(0, 1)
    assert ahead > 100.0
    assert error > 100.0
    assert few.difference(1, 0) == (-ahead, error)


def test_players_that_never_meet_are_compared_by_the_third():
    points = np.zeros((3, 3))
    points[0, 1], points[1, 0] = 30.0, 10.0
    points[1, 2], points[2, 1] = 30.0, 10.0
    ratings = rate_players(points)
    assert ratings.elo[0] > ratings.elo[1] > ratings.elo[2]
    assert ratings.difference(0, 2)[1] > ratings.difference(0, 1)[1]


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (np.zeros((2, 3)), "points must be square, got shape"),
        (np.zeros((0, 0)), "points must be square, got shape"),
        (np.ones((2, 2)), "0 on the diagonal"),
        (np.array([[0.0, -1.0], [0.0, 0.0]]), "not negative"),
        (np.array([[0.0, np.nan], [0.0, 0.0]]), "points must be finite"),
    ],
)
def test_what_is_no_table_of_points_is_refused(points, problem):
    with pytest.raises(ArgumentError, match=problem):
        rate_players(points)


@pytest.mark.parametrize("values", [{"prior_std_elo": 0.0}, {"prior_std_elo": math.inf}, {"mean_elo": math.nan}])
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(ArgumentError, match=next(iter(values))):
        RatingSettings(**values)
