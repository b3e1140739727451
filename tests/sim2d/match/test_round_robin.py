"""Tables of players that all meet each other: who meets whom on which seed, and what the table says of it."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from sim2d_players import SMALL_CAMERA, FailsAt, Reckoner, Sleeper

from field_models.errors import ArgumentError
from robocup_vision import cli, workers
from robocup_vision.workers import find_workers
from sim2d.match.run import MatchPlan
from sim2d.match.table import RoundRobin
from sim2d.match.tournament import play_matches

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
            if len(played) == 3:
                raise KeyboardInterrupt
            played.append(one)
            yield one

    with monkeypatch.context() as patched:
        patched.setattr("sim2d.match.tournament.play_matches", interrupted)
        assert cli.main([*command, "4", "--out", "two"]) == 130
    assert "3 of 4 matches are played and kept in" in capsys.readouterr().err
    assert cli.main([*command, "6", "--out", "two", "--resume"]) == 0
    assert cli.main([*command, "6", "--out", "whole"]) == 0
    assert Path("two", "table.json").read_bytes() == Path("whole", "table.json").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--table", "plain"], "a table needs at least two players, got 1"),
        (["--table", "plain,nobody"], "there is no player 'nobody'"),
        (["--table", "--ours", "memory"], "--table names all players: leave out --ours and --theirs"),
        (["--table", "--matches", "3"], "a table needs an even number of matches of each pair"),
    ],
)
def test_mistakes_are_one_line(tmp_path, capsys, monkeypatch, arguments, problem):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["tournament", *arguments]) == 2
    error = capsys.readouterr().err
    assert problem in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
