"""The connection to a game controller for continuous integration: framing, answers, and peers that misbehave."""

import dataclasses
import socket
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.worlds.damaged_messages import REFEREE
from field_models.errors import ArgumentError, PacketError
from robocup_vision.ssl.controller_clients import CiClient
from robocup_vision.ssl.framed import MAX_FRAME_BYTES, take_frame, varint
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.referee import CiInput, CiOutput

WAIT_S = 10.0


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


@pytest.fixture
def controller():
    """Return a function that starts a game controller of a few lines, and returns its port."""
    opened, threads = [], []

    def start(answer):
        listening = socket.create_server(("127.0.0.1", 0))
        listening.settimeout(WAIT_S)
        opened.append(listening)

        def serve():
            connection, _ = listening.accept()
            connection.settimeout(WAIT_S)
            buffer = bytearray()
            with connection:
                while data := connection.recv(4096):
                    buffer += data
                    while (frame := take_frame(buffer)) is not None:
                        reply = answer(decode(CiInput, frame))
                        if reply is None:
                            return
                        connection.sendall(reply)

        thread = threading.Thread(target=serve)
        thread.start()
        threads.append(thread)
        return listening.getsockname()[1]

    yield start
    for listening in opened:
        listening.close()
    for thread in threads:
        thread.join(WAIT_S)


def packet(counter):
    data = encode(CiOutput(dataclasses.replace(REFEREE, command_counter=counter)))
    return varint(len(data)) + data


def test_inputs_are_answered_with_any_number_of_packets(controller):
    port = controller(lambda told: b"".join(packet(told.time_ns + k) for k in range(told.time_ns)))
    with CiClient(port=port) as client:
        assert [one.command_counter for one in client.exchange(CiInput(2), WAIT_S)][:1] == [2]
        assert client.exchange(CiInput(0), 0.05) in ([], [dataclasses.replace(REFEREE, command_counter=3)])


def test_who_closes_or_talks_rubbish_is_told(controller):
    with CiClient(port=controller(lambda told: None)) as client, pytest.raises(ArgumentError, match="has closed"):
        client.exchange(CiInput(1), WAIT_S)
    port = controller(lambda told: b"\xff\xff\xff\xff\x7f")
    with CiClient(port=port) as client, pytest.raises(PacketError, match="at most 8388608 bytes"):
        client.exchange(CiInput(1), WAIT_S)
    with pytest.raises(ArgumentError, match=r"cannot reach a game controller at 127.0.0.1:1"):
        CiClient(port=1)
