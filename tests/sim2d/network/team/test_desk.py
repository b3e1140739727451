"""What a team tells the game controller: another keeper where its own is not there, and no more than it must."""

import dataclasses
from typing import ClassVar

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models.errors import ArgumentError
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.values.referee import RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.team import client as desk


class Client:
    """A game controller's port that takes everything."""

    made: ClassVar[list] = []

    def __init__(self, name, team, host):
        if name == "refused":
            raise ArgumentError("the port refuses: nobody knows you")
        self.told, self.problems = [name, team, host], Problems()
        Client.made.append(self)

    def choose_advantage(self, *, goes_on):
        """Note it."""
        self.told.append(goes_on)

    def change_keeper(self, number):
        """Note it."""
        self.told.append(number)

    def listen(self):
        """Do nothing."""

    def close(self):
        """Do nothing."""


@pytest.fixture(autouse=True)
def clients(monkeypatch):
    """Let a desk have such clients."""
    monkeypatch.setattr(Client, "made", [])
    monkeypatch.setattr(desk, "TeamPortClient", Client)
    return Client.made


def say(made, t_s, own, command=RefereeCommand.STOP, name="us", keeper=0):
    blue = dataclasses.replace(REFEREE.blue, name=name, goalkeeper=keeper)
    made.hear(dataclasses.replace(REFEREE, command=command, blue=blue), own, t_s)


def test_a_keeper_that_is_not_there_is_replaced_in_a_stop(clients):
    made = desk.TeamDesk(Team.BLUE, "here", Problems())
    say(made, 0.0, [], name="")
    assert clients == []
    for t_s in (0.0, 1.0, 2.0, 3.0):
        say(made, t_s, [2, 3], RefereeCommand.FORCE_START)
    assert clients[0].told == ["us", Team.BLUE, "here", True]
    for t_s in (4.0, 5.0, 6.0):
        say(made, t_s, [2, 3])
    assert clients[0].told[4:] == [2]
    say(made, 9.5, [2, 3])
    assert clients[0].told[4:] == [2, 2]


def test_a_keeper_that_is_there_stays(clients):
    made = desk.TeamDesk(Team.BLUE, "here", Problems())
    for t_s in range(9):
        say(made, float(t_s), [0, 3])
    assert clients[0].told[4:] == []


def test_a_refusal_is_said_once_and_the_team_plays_on(clients):
    problems = Problems()
    made = desk.TeamDesk(Team.BLUE, "here", problems)
    for t_s in range(3):
        say(made, float(t_s), [0, 3], name="refused")
    assert problems.lines() == ["1 x the port refuses: nobody knows you"]
