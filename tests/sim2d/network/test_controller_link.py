"""The simulator at a game controller that goes by the simulator's time: one moment after the other."""

import select
import socket
import threading
import time
from functools import partial
from unittest.mock import MagicMock

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from robocup_vision.ssl.controller_clients import CiClient
from robocup_vision.ssl.framed import take_frame, varint
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.referee import CiInput, CiOutput
from sim2d.network import controller_link
from sim2d.network.controller_link import ControllerLink
from sim2d.network.league import LeagueSimulator
from sim2d.network.realism import REALISMS

FIELD = load_field("ssl_division_b")
MOMENTS, WAIT_S = 5, 10.0


@pytest.fixture
def slow_controller():
    """Run a game controller that thinks for 20 ms; return its port, and what it got with whether more was there."""
    answer = encode(CiOutput(REFEREE))
    got = []
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(WAIT_S)

        def serve():
            connection, _ = listening.accept()
            connection.settimeout(WAIT_S)
            buffer = bytearray()
            with connection:
                while data := connection.recv(1 << 16):
                    buffer += data
                    while (frame := take_frame(buffer)) is not None:
                        time.sleep(0.02)
                        overtaken = bool(buffer or select.select([connection], [], [], 0.0)[0])
                        got.append((decode(CiInput, frame), overtaken))
                        connection.sendall(varint(len(answer)) + answer)

        thread = threading.Thread(target=serve)
        thread.start()
        yield listening.getsockname()[1], got
        thread.join(WAIT_S)


def test_no_moment_is_told_before_the_one_before_was_answered(slow_controller, monkeypatch):
    port, got = slow_controller
    monkeypatch.setattr(controller_link, "CiClient", partial(CiClient, port=port))
    for name in ("AutoRefClient", "Operator"):
        monkeypatch.setattr(controller_link, name, MagicMock())
    simulator = LeagueSimulator(FIELD, 1, REALISMS["none"])
    with ControllerLink(FIELD, "127.0.0.1", drives=True) as link:
        for _ in range(MOMENTS):
            simulator.step()
            assert [packet.command for packet in link.drive(simulator.world.state, 1.7e9)] == [REFEREE.command]
        assert link.problems.lines() == []
    assert [overtaken for _, overtaken in got] == [False] * MOMENTS
    stamps = [told.time_ns for told, _ in got]
    assert stamps == sorted(set(stamps))
