"""A tournament's table: who meets whom, and ratings by the results."""

import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from sim2d_players import SMALL_CAMERA, FailsAt, Reckoner, Sleeper

from field_models.errors import ArgumentError
from robocup_vision import cli, workers
from robocup_vision.workers import find_workers
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import RoundRobin, play_matches, rate_players

PLAN = MatchPlan(players=1, seconds=0.2, seed=5, camera=SMALL_CAMERA)
PLAYERS = (("circles", Reckoner), ("sleeps", Sleeper), ("fails", FailsAt))


def result_of(plan, score, stopped=()):
    """Return what the table takes of a match.json."""
    robots = [{"side": side, "stopped_s": 0.1 if side in stopped else None} for side in (1, -1)]
    return {"field": plan.field, "seconds": plan.seconds, "seed": plan.seed, "score": score, "robots": robots}


def test_each_pair_meets_on_each_seed_from_both_sides():
    tournament = RoundRobin(PLAN, PLAYERS, 4)
    met = Counter((plan.seed, plan.ours, plan.theirs) for plan in tournament.plans)
    assert set(met.values()) == {1}
    assert len(met) == 2 * 3 * 2
    for seed in (5, 6):
        for _, one in PLAYERS:
            for _, other in PLAYERS:
                assert ((seed, one, other) in met) == (one is not other)


def test_more_matches_begin_with_the_same():
    few, many = RoundRobin(PLAN, PLAYERS, 2), RoundRobin(PLAN, PLAYERS, 6)
    assert many.plans[: len(few.plans)] == few.plans
    assert many.run_json() == few.run_json()
    assert many.run_json()["table"] == ["circles", "sleeps", "fails"]


def test_the_table_counts_from_each_players_side():
    tournament = RoundRobin(PLAN, PLAYERS[:2], 4)
    scores = [[2, 0], [1, 1], [0, 1], [0, 3]]
    stopped = [(), (1,), (), (-1, 1)]
    results = [result_of(*values) for values in zip(tournament.plans, scores, stopped, strict=True)]
    values = tournament.table_json(results)
    first, second = values["table"]
    # the second and the fourth match were played with sides changed
    assert (first["player"], first["won"], first["drawn"], first["lost"]) == ("circles", 2, 1, 1)
    assert (second["won"], second["drawn"], second["lost"]) == (1, 1, 2)
    assert (first["goals"], second["goals"]) == ([6, 2], [2, 6])
    assert (first["stopped_players"], second["stopped_players"]) == (1, 2)
    assert first["elo"] + second["elo"] == pytest.approx(3000.0)
    assert first["ahead_of_next_elo"] == pytest.approx(first["elo"] - second["elo"], abs=0.2)
    assert first["ahead_std_error_elo"] > first["std_error_elo"] > 0
    assert second["ahead_of_next_elo"] is None
    assert [(match["ours"], match["theirs"]) for match in values["matches"]] == 2 * [
        ("circles", "sleeps"),
        ("sleeps", "circles"),
    ]
    json.dumps(values)


def test_the_order_of_the_names_does_not_change_the_table():
    tournament = RoundRobin(PLAN, PLAYERS, 2)
    better = {Reckoner: 3, Sleeper: 2, FailsAt: 1}

    def table(one):
        return one.table_json([result_of(p, [better[p.ours], better[p.theirs]]) for p in one.plans])["table"]

    assert table(tournament) == table(replace(tournament, players=PLAYERS[::-1]))
    assert [row["player"] for row in table(tournament)] == ["circles", "sleeps", "fails"]


@pytest.mark.parametrize(
    ("players", "matches", "problem"),
    [
        (PLAYERS[:1], 2, "a table needs at least two players, got 1"),
        ((*PLAYERS, PLAYERS[0]), 2, "'circles' is named 2 times"),
        (PLAYERS, 3, "even number of matches"),
        (PLAYERS, 0, "even number of matches"),
    ],
)
def test_what_makes_no_table_is_refused(players, matches, problem):
    with pytest.raises(ArgumentError, match=problem):
        RoundRobin(PLAN, players, matches)


def test_the_command_writes_and_prints_the_table(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "local_workers", lambda jobs: find_workers(1))
    names = "sim2d_players:Reckoner,sim2d_players:Sleeper"
    command = ["tournament", "--table", names, "--matches", "2", "--players", "1", "--seconds", "0.1", "--out", "one"]
    assert cli.main(command) == 0
    values = json.loads(Path("one", "table.json").read_text())
    assert [row["elo"] for row in values["table"]] == [1500.0, 1500.0]
    assert [path.name for path in Path("one").iterdir()] == ["table.json"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "ssl_2001, 1 against 1, 2 matches of 0.1 s a pair"
    assert lines[1].split()[:3] == ["player", "Elo", "SE"]
    assert lines[2].split()[:2] == ["sim2d_players:Reckoner", "1500"]


def test_an_interrupted_table_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "local_workers", lambda jobs: find_workers(1))
    names = "sim2d_players:Reckoner,sim2d_players:Sleeper"
    command = ["tournament", "--table", names, "--players", "1", "--seconds", "0.1", "--matches"]
    played = []

    def interrupted(plans, players):
        for one in play_matches(plans, players):
            if played:
                raise KeyboardInterrupt
            played.append(one)
            yield one

    with monkeypatch.context() as patched:
        patched.setattr("sim2d.match.tournament.play_matches", interrupted)
        assert cli.main([*command, "2", "--out", "two"]) == 130
    assert "1 of 2 matches are played and kept in" in capsys.readouterr().err
    assert cli.main([*command, "4", "--out", "two", "--resume"]) == 0
    assert cli.main([*command, "4", "--out", "whole"]) == 0
    assert Path("two", "table.json").read_bytes() == Path("whole", "table.json").read_bytes()


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
