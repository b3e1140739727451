"""The connection to a game controller for continuous integration: framing, answers, and peers that misbehave."""

import dataclasses

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
