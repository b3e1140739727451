"""Players by name: the same team in every process, and files that say who played."""

from __future__ import annotations

import functools
import json
import pickle
import sys

import pytest
from sim2d_players import Reckoner, Sleeper

from field_models.errors import ArgumentError
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import play_plan
from sim2d.players.built_in import BuiltInPlayer
from sim2d.players.catalog import PLAYERS, BuiltInTeam, player_factory, player_name

KNOWN = "plain, memory, planning, asking, looking, silent, or one's own as MODULE:NAME"


@pytest.mark.parametrize("name", PLAYERS)
def test_a_name_survives_the_way_to_another_process(name):
    sent = pickle.loads(pickle.dumps(player_factory(name)))
    assert player_name(sent) == name


def test_teams_have_the_options_of_their_names():
    assert player_factory("plain") is BuiltInPlayer
    assert player_factory("memory") == BuiltInTeam(("memory",))
    assert player_factory("silent") == BuiltInTeam(("memory", "plans"))
    for name, more in (("planning", ()), ("asking", ("goal_looks",)), ("looking", ("floor_looks",))):
        assert player_factory(name) == BuiltInTeam(("memory", "plans", "messages", *more))


def test_players_are_named_by_what_they_use_in_any_order():
    team = player_factory("messages+memory")
    assert team == BuiltInTeam(("memory", "messages")) == BuiltInTeam(("messages", "memory", "messages"))
    assert player_name(team) == "memory+messages"
    assert player_name(player_factory("plans+memory")) == "silent"
    with pytest.raises(ArgumentError, match="a built-in player cannot use 'wings', only memory, plans, messages"):
        BuiltInTeam(("memory", "wings"))


def test_players_of_ones_own_are_called_by_their_class():
    assert player_name(Reckoner) == "Reckoner"
    assert player_name(functools.partial(Sleeper)) == "Sleeper"


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(
        ArgumentError, match="there is no player 'clever', only plain, memory, planning, asking, looking, silent"
    ):
        player_factory("clever")


def test_a_match_names_its_players():
    values = play_plan(MatchPlan(players=1, seconds=0.1, ours=Reckoner, theirs=Sleeper))
    assert (values["ours"], values["theirs"]) == ("Reckoner", "Sleeper")
    json.dumps(values)


def test_players_of_ones_own_are_found_by_their_import_path(tmp_path, monkeypatch):
    assert player_factory("sim2d_players:Reckoner") is Reckoner
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "my_own_team.py").write_text("def make(setup):\n    return setup\n")
    assert player_factory("my_own_team:make")("setup") == "setup"


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("nowhere_at_all:Player", "the player 'nowhere_at_all:Player' cannot be imported: ModuleNotFoundError"),
        ("sim2d_players:Nobody", "the module 'sim2d_players' has no player 'Nobody'"),
        ("sim2d_players:", "the module 'sim2d_players' has no player ''"),
        (":Nobody", "the player ':Nobody' cannot be imported: ValueError"),
        ("math:pi", "'math:pi' makes no players: it cannot be called"),
    ],
)
def test_an_import_path_without_a_player_is_refused(path, problem):
    with pytest.raises(ArgumentError) as caught:
        player_factory(path)
    assert str(caught.value).startswith(problem)
