"""Values are their messages: nothing is lost on the way there and back, and no bytes do more than be refused."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.worlds.damaged_messages import EXAMPLES, REFEREE, damaged_messages
from field_models.errors import PacketError
from robocup_vision.ssl.protocol.mapping import decode, encode, message_class
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, VisionPacket
from robocup_vision.ssl.values.referee import GameEvent, Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import RobotCommand, RobotControl

FLOAT32 = st.floats(width=32, allow_nan=False)
UINT32 = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("value", EXAMPLES, ids=lambda value: type(value).__name__)
def test_a_value_comes_back(value):
    data = encode(value)
    again = decode(type(value), data)
    assert encode(again) == data
    assert dataclasses.asdict(again).keys() == dataclasses.asdict(value).keys()


@given(x=FLOAT32, y=FLOAT32, angle=FLOAT32, number=UINT32)
def test_float32_millimetres_come_back_to_the_last_bit(x, y, angle, number):
    message = message_class(DetectionRobot)(
        confidence=1.0, robot_id=number, x=x, y=y, orientation=angle, pixel_x=0.0, pixel_y=0.0
    )
    data = message.SerializeToString()
    robot = decode(DetectionRobot, data)
    assert robot.x_m == np.float64(np.float32(x)) / 1000
    assert encode(robot) == data


@given(degrees=FLOAT32.filter(lambda value: abs(value) > 1e-35), rpm=FLOAT32.filter(lambda value: abs(value) > 1e-35))
def test_degrees_and_rpm_come_back(degrees, rpm):
    data = message_class(RobotCommand)(id=1, kick_angle=degrees, dribbler_speed=rpm).SerializeToString()
    assert encode(decode(RobotCommand, data)) == data


def test_required_zeros_are_written_and_absent_fields_are_none():
    data = encode(DetectionBall(0.0, 0.0, 0.0))
    assert data == b"".join(bytes([number << 3 | 5, 0, 0, 0, 0]) for number in (1, 3, 4, 6, 7))
    ball = decode(DetectionBall, data)
    assert (ball.z_m, ball.area_px) == (None, None)
    assert encode(DetectionFrame(0, 0.0, 0.0, 0))[:2] == b"\x08\x00"
    # stage_time_left is a zigzag number
    assert b"\x18\x09" in encode(REFEREE)


def test_fields_that_a_value_does_not_have_are_kept():
    ball = message_class(DetectionBall)(confidence=1.0, x=1.0, y=2.0, pixel_x=0.0, pixel_y=0.0)
    extra = b"\xa2\x06\x03abc"
    data = ball.SerializeToString() + extra
    value = decode(DetectionBall, data)
    assert value.unknown == extra
    assert encode(value) == data
    # of game events no field is known
    told = dataclasses.replace(REFEREE, game_events=(GameEvent(unknown=b"\x08\x01" + extra),))
    assert decode(Referee, encode(told)).game_events == told.game_events


def test_an_enum_number_of_a_later_version_is_kept():
    data = encode(dataclasses.replace(REFEREE, command=RefereeCommand.STOP, next_command=RefereeCommand.HALT))
    at = data.rindex(b"\x60\x00")
    later = data[:at] + b"\x60\x63" + data[at + 2 :]
    # a required one does not lose the packet
    later = later.replace(b"\x20\x01", b"\x20\x12")
    value = decode(Referee, later)
    assert (value.command, value.next_command) == (18, 99)
    assert str(value.next_command) == "unknown command 99"
    assert not value.next_command.is_known
    assert encode(value) == later


@pytest.mark.parametrize(
    ("cls", "data", "words"),
    [
        (VisionPacket, b"\xff", r"1 bytes are no vision\.SSL_WrapperPacket"),
        (VisionPacket, b"\x0a\x00", r"lacks the required detection\.frame_number, .*detection\.camera_id"),
        (RobotControl, b"\x0a\x00", r"lacks the required robot_commands\[0\]\.id"),
    ],
)
def test_wrong_bytes_are_refused_in_words(cls, data, words):
    with pytest.raises(PacketError, match=words):
        decode(cls, data)


def test_a_text_that_is_none_is_refused():
    data = encode(REFEREE).replace(b"ours", b"\xff\xfe\xfd\xfc")
    with pytest.raises(PacketError, match=r"the text b'.*' is not UTF-8"):
        decode(Referee, data)


def test_a_number_that_does_not_fit_is_refused():
    with pytest.raises(PacketError, match="a DetectionFrame cannot be written"):
        encode(DetectionFrame(-1, 0.0, 0.0, 0))


def test_mutated_messages_are_read_or_refused():
    count, rng = 6_000, np.random.default_rng(20)
    read = refused = 0
    for cls, data in damaged_messages(rng, count):
        try:
            value = decode(cls, data)
        except PacketError:
            refused += 1
            continue
        read += 1
        if read % 16 == 0:
            encode(value)
    assert read + refused == count
    # a fuzz that never gets through to the values tests nothing
    assert min(read, refused) > count // 20


def test_a_team_may_load_its_own_modules_of_the_same_messages():
    program = """
from google.protobuf import descriptor_pb2, descriptor_pool
from robocup_vision.ssl.protocol.mapping import message_class, message_name
from robocup_vision.ssl.values.detection import DetectionBall
name = message_class(DetectionBall).DESCRIPTOR.file.name
file = descriptor_pb2.FileDescriptorProto(name=name, package="robocup_vision.vision")
file.message_type.add(name="SSL_DetectionBall").field.add(name="other", number=1, type=5, label=1)
descriptor_pool.Default().Add(file)
descriptor_pool.Default().FindMessageTypeByName(message_name(DetectionBall))
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_without_protobuf_one_line_says_what_to_install():
    program = """
import sys
sys.modules["google"] = None
from robocup_vision.cli import main
sys.exit(main(["simulate"]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "pip install 'robocup-vision[ssl]'" in done.stderr
    assert done.stderr.count("\n") == 1
