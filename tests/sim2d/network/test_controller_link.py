"""The simulator at a game controller that goes by the simulator's time: one moment after the other."""

import time
from functools import partial
from unittest.mock import MagicMock

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from robocup_vision.ssl.controller_clients import CiClient
from robocup_vision.ssl.framed import varint
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.referee import CiInput, CiOutput
from sim2d.network import controller_link
from sim2d.network.controller_link import ControllerLink
from sim2d.network.league import LeagueSimulator
from sim2d.network.realism import REALISMS

FIELD = load_field("ssl_division_b")
MOMENTS = 5


def test_no_moment_is_told_before_the_one_before_was_answered(peer, monkeypatch):
    answer, stamps = encode(CiOutput(REFEREE)), []

    def think(frame):
        time.sleep(0.02)
        stamps.append(decode(CiInput, frame).time_ns)
        return varint(len(answer)) + answer

    monkeypatch.setattr(controller_link, "CiClient", partial(CiClient, port=peer(think)))
    for name in ("AutoRefClient", "Operator"):
        monkeypatch.setattr(controller_link, name, MagicMock())
    simulator = LeagueSimulator(FIELD, 1, REALISMS["none"])
    with ControllerLink(FIELD, "127.0.0.1", drives=True) as link:
        for moment in range(1, MOMENTS + 1):
            simulator.step()
            assert [packet.command for packet in link.drive(simulator.world.state, 1.7e9)] == [REFEREE.command]
            assert len(stamps) == moment
        assert link.problems.lines() == []
    assert stamps == sorted(set(stamps))
