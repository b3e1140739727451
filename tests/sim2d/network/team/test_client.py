"""The command `play` on the loopback: it plays on a running simulator, and tells what a user can mend."""

import time

import pytest
from ssl_sockets import free_port

from field_models import load_field
from robocup_vision.cli import main
from robocup_vision.ssl.values.simulation import Team
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
        Team.YELLOW,
        FIELD,
        vision_port=simulator.vision_port,
        referee_port=ports.referee,
        robot_port=ports.yellow,
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


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--speed=9"], "--speed must be from 0.2 to 4 m/s"),
        (["--seconds=0"], "--seconds must be positive"),
        (["--robot-port=70000"], "--robot-port must be from 1 to 65535"),
        (["--network=nothing0"], "there is no network interface 'nothing0'"),
    ],
)
def test_wrong_options_are_reported_in_one_line(options, words, capsys):
    assert main(["play", "--team=yellow", *options]) == 2
    assert words in capsys.readouterr().err
