"""A team on the network, and what it tells the game controller."""

import dataclasses
import time
from typing import ClassVar

import pytest
from ssl_sockets import free_port

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.cli import main
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.values.referee import RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.team import client as team_client
from sim2d.network.team.client import TeamClient

FIELD = load_field("ssl_division_b")
WAIT_S = 20.0


@pytest.fixture
def running(serve):
    """Run a simulator, two a side."""
    with serve(FIELD, 2) as served:
        yield served


def test_a_team_on_the_network_goes_for_the_ball(running):
    simulator, ports = running.simulator, running.ports
    before = simulator.world.robot(Team.YELLOW, 1).pose.x_m
    end_s = time.monotonic() + WAIT_S
    with TeamClient(
        Team.YELLOW, FIELD, vision_port=simulator.vision_port, referee_port=ports.referee, robot_port=ports.yellow
    ) as client:
        client.run(lambda: simulator.world.robot(Team.YELLOW, 1).pose.x_m < before + 0.2 and time.monotonic() < end_s)
        assert client.sent > 3
        assert client.bad_datagrams == 0
        assert not client.is_blind
        assert client.team.state.phase == "play"
    assert simulator.world.robot(Team.YELLOW, 1).pose.x_m > before + 0.2
    assert simulator.bad_datagrams == 0


def test_without_vision_nothing_is_sent_and_the_command_ends(capsys):
    ports = [f"--vision-port={free_port()}", f"--referee-port={free_port()}", f"--robot-port={free_port()}"]
    assert main(["play", "--team=blue", "--seconds=1.3", *ports]) == 0
    out = capsys.readouterr().out
    assert "blue on ssl_division_b" in out
    assert "no vision" in out
    assert "0 packets of commands, 0 bad datagrams" in out


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
    monkeypatch.setattr(team_client, "TeamPortClient", Client)
    return Client.made


def say(made, t_s, own, command=RefereeCommand.STOP, name="us", keeper=0):
    blue = dataclasses.replace(REFEREE.blue, name=name, goalkeeper=keeper)
    made.hear(dataclasses.replace(REFEREE, command=command, blue=blue), own, t_s)


def test_a_keeper_that_is_not_there_is_replaced_in_a_stop(clients):
    made = team_client.TeamDesk(Team.BLUE, "here", Problems())
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
    made = team_client.TeamDesk(Team.BLUE, "here", Problems())
    for t_s in range(9):
        say(made, float(t_s), [0, 3])
    assert clients[0].told[4:] == []


def test_a_refusal_is_said_once_and_the_team_plays_on(clients):
    problems = Problems()
    made = team_client.TeamDesk(Team.BLUE, "here", problems)
    for t_s in range(3):
        say(made, float(t_s), [0, 3], name="refused")
    assert problems.lines() == ["1 x the port refuses: nobody knows you"]
