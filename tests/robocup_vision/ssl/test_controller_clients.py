"""Clients of the game controller's ports, against one of the test's own that speaks as the league's does."""

import dataclasses
import json
import queue
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ssl_sockets import free_port
from websockets.sync.server import serve

from benchmarks.worlds.damaged_messages import REFEREE
from field_models.errors import ArgumentError, PacketError
from robocup_vision.ssl.controller_clients import AutoRefClient, CiClient, TeamPortClient
from robocup_vision.ssl.framed import MAX_FRAME_BYTES, take_frame, varint
from robocup_vision.ssl.operator import Operator
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.controller import (
    AdvantageChoice,
    AutoRefMessage,
    AutoRefRegistration,
    ByRobot,
    ControllerMessage,
    ControllerReply,
    EventKind,
    Place,
    ReplyStatus,
    TeamMessage,
    TeamRegistration,
    referee_event,
)
from robocup_vision.ssl.values.referee import CiInput, CiOutput
from robocup_vision.ssl.values.simulation import Team

WAIT_S = 30.0
OK = ControllerReply(ReplyStatus.OK)


def controller(peer, *replies):
    """Return the port of a controller that gives these replies in turn, the first unasked, and what it hears."""
    packed = [encode(ControllerMessage(reply)) for reply in replies]
    heard, left = [], iter([varint(len(data)) + data for data in packed])

    def answer(frame):
        heard.append(frame)
        return next(left, None)

    return peer(answer, next(left)), heard


def test_an_automatic_referee_registers_and_tells_events(peer):
    port, heard = controller(peer, OK, OK, OK, ControllerReply(ReplyStatus.REJECTED, "no such event"))
    event = referee_event(
        EventKind.BOT_TOO_FAST_IN_STOP, ByRobot(Team.BLUE, 3, Place(1.0, 2.0), 1.75), 1_700_000_000_000_000
    )
    with AutoRefClient("eyes", port=port) as client:
        client.tell(event)
        client.tell(event)
        while not client.problems.counts:
            client.listen()
        assert "rejects: no such event" in client.problems.take_new()[0]
    assert decode(AutoRefRegistration, heard[0]).identifier == "eyes"
    assert decode(AutoRefMessage, heard[1]).event == event
    # the league's numbers: type 40, bot_too_fast_in_stop 28
    assert b"\xc0\x02\x1c" in heard[1]
    assert b"\xe2\x01" in heard[1]


def test_a_team_asks_and_what_is_rejected_is_said(peer):
    rejected = ControllerReply(ReplyStatus.REJECTED, "Ball is not in the opponents half")
    port, heard = controller(peer, OK, OK, rejected, OK, OK, OK)
    with TeamPortClient("Test Team", Team.YELLOW, port=port) as client:
        client.change_keeper(4)
        while not client.problems.counts:
            client.listen()
        client.choose_advantage(goes_on=True)
        client.ask_for_substitution()
        client.ping()
        while len(heard) < 5:
            client.listen()
        assert "rejects: Ball is not in the opponents half" in client.problems.take_new()[0]
    registration = decode(TeamRegistration, heard[0])
    assert (registration.team_name, registration.team) == ("Test Team", Team.YELLOW)
    told = [decode(TeamMessage, data) for data in heard[1:]]
    assert told[0] == TeamMessage(desired_keeper=4)
    assert told[1] == TeamMessage(advantage_choice=AdvantageChoice.CONTINUE)
    assert told[2:] == [TeamMessage(substitute_robot=True), TeamMessage(ping=True)]


def test_who_is_refused_or_not_answered_is_told_why(peer):
    port, _ = controller(peer, OK, ControllerReply(ReplyStatus.REJECTED, "already registered"))
    with pytest.raises(ArgumentError, match=r"the port for referees of the game controller at .* refuses: already"):
        AutoRefClient("eyes", port=port)
    with pytest.raises(ArgumentError, match="cannot reach the port for teams of the game controller at"):
        TeamPortClient("x", Team.BLUE, port=free_port())


class Page:
    """A page of a game controller: a web socket's server for one connection."""

    def __init__(self):
        self.heard, self.opened = queue.Queue(), queue.Queue()
        self.server = serve(self.serve, "127.0.0.1", 0)
        self.port = self.server.socket.getsockname()[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def serve(self, connection):
        """Hear what comes until the connection ends."""
        self.opened.put(connection)
        for text in connection:
            self.heard.put(json.loads(text))

    def say(self, value):
        """Send a text, and wait until it is there.

        A client answers a ping before it hands over the texts that came with it, and reads the next one afterwards.
        """
        if not hasattr(self, "connection"):
            self.connection = self.opened.get(timeout=WAIT_S)
        self.connection.send(json.dumps(value))
        for _ in range(2):
            assert self.connection.ping().wait(WAIT_S)

    def hear(self):
        """Return the next value."""
        return self.heard.get(timeout=WAIT_S)


@pytest.fixture
def page():
    """Return a page that an operator may connect to."""
    made = Page()
    yield made
    made.server.shutdown()


def keep_looking(operator):
    """Look until the operator learns of a lost connection, a while at most."""
    end_s = time.monotonic() + WAIT_S
    while time.monotonic() < end_s:
        operator.look(119.0)


def action(kind, state="READY_MANUAL", *issues):
    return {"type": kind, "forTeam": "UNKNOWN", "state": state, "continuationIssues": list(issues)}


def test_the_operator_sets_the_match_and_presses_what_a_person_would(page):
    with Operator(port=page.port, division="DIV_B") as operator:
        page.say({"matchState": {"matchType": "UNKNOWN_MATCH", "teamState": {"YELLOW": {"name": ""}}}})
        operator.look(0.0)
        assert page.hear() == {"change": {"updateConfigChange": {"matchType": "FRIENDLY", "division": "DIV_B"}}}
        named = {"forTeam": "YELLOW", "teamName": "Yellow"}
        assert page.hear() == {"change": {"updateTeamStateChange": named}}
        page.say({"gcState": {"continueActions": [action("STOP_GAME"), action("RESUME_FROM_HALT")]}})
        operator.look(1.0)
        operator.look(1.9)
        assert operator.pressed == []
        operator.look(2.0)
        assert page.hear() == {"continueAction": {"type": "RESUME_FROM_HALT", "forTeam": "UNKNOWN"}}
        operator.look(3.0)
        assert operator.pressed == ["RESUME_FROM_HALT"]


def test_the_operator_leaves_play_alone_and_waits_for_what_is_in_the_way(page):
    with Operator(port=page.port) as operator:
        page.say({"gcState": {"continueActions": [action("STOP_GAME"), action("BALL_PLACEMENT_CANCEL")]}})
        operator.look(0.0)
        operator.look(100.0)
        page.say({"gcState": {"continueActions": [action("NORMAL_START", "BLOCKED", "a robot is in the way")]}})
        operator.look(101.0)
        operator.look(115.0)
        assert operator.pressed == []
        operator.look(116.5)
        assert operator.pressed == ["NORMAL_START"]
        page.say({"gcState": {"continueActions": [action("NEXT_STAGE"), action("END_GAME")]}})
        operator.look(116.5)
        operator.look(118.0)
        assert operator.pressed == ["NORMAL_START", "END_GAME"]
        page.connection.close()
        with pytest.raises(ArgumentError, match=r"has closed the connection|is gone"):
            keep_looking(operator)


def test_a_page_that_is_none_is_reported():
    with pytest.raises(ArgumentError, match="cannot reach the game controller's page"):
        Operator(port=free_port())


@given(frames=st.lists(st.binary(max_size=300), max_size=5), cut=st.integers(0, 40))
def test_frames_come_back_however_they_are_cut(frames, cut):
    data = b"".join(varint(len(frame)) + frame for frame in frames)
    buffer, found = bytearray(), []
    for piece in (data[:cut], data[cut:]):
        buffer += piece
        while (frame := take_frame(buffer)) is not None:
            found.append(frame)
    assert found == frames
    assert not buffer


def test_a_frame_over_8_mb_and_a_size_that_is_none_are_refused():
    assert take_frame(bytearray(varint(MAX_FRAME_BYTES))) is None
    with pytest.raises(PacketError, match="at most 8388608 bytes, announced are 8388609"):
        take_frame(bytearray(varint(MAX_FRAME_BYTES + 1)))
    with pytest.raises(PacketError, match="no varint"):
        take_frame(bytearray(b"\xff" * 5))
    assert take_frame(bytearray(b"\xff" * 4)) is None


def packet(counter):
    data = encode(CiOutput(dataclasses.replace(REFEREE, command_counter=counter)))
    return varint(len(data)) + data


def packets(frame):
    """Answer as many packets as the nanoseconds told, numbered from that on."""
    told = decode(CiInput, frame).time_ns
    return b"".join(packet(told + k) for k in range(told))


def test_inputs_are_answered_with_any_number_of_packets(peer):
    with CiClient(port=peer(packets)) as client:
        assert [one.command_counter for one in client.exchange(CiInput(2), WAIT_S)][:1] == [2]
        assert client.exchange(CiInput(0), 0.05) in ([], [dataclasses.replace(REFEREE, command_counter=3)])


def test_who_closes_or_talks_rubbish_is_told(peer):
    with CiClient(port=peer(lambda frame: None)) as client, pytest.raises(ArgumentError, match="has closed"):
        client.exchange(CiInput(1), WAIT_S)
    port = peer(lambda frame: b"\xff\xff\xff\xff\x7f")
    with CiClient(port=port) as client, pytest.raises(PacketError, match="at most 8388608 bytes"):
        client.exchange(CiInput(1), WAIT_S)
    with pytest.raises(ArgumentError, match=r"cannot reach the game controller at 127.0.0.1:1"):
        CiClient(port=1)
