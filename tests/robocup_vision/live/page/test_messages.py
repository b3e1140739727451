"""What pages send is read, or refused: nothing else."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import PacketError
from robocup_vision.live.page import messages

GOOD = [
    ({"type": "drawn", "robot": "robot", "number": 3}, messages.Drawn("robot", 3)),
    ({"type": "pause", "on": True}, messages.Pause(True)),
    ({"type": "step", "frames": -10}, messages.Step(-10)),
    ({"type": "back", "seconds": 12.5}, messages.Back(12.5)),
    ({"type": "seek", "t_s": 3}, messages.Seek(3.0)),
    ({"type": "open", "recording": "a.mcap"}, messages.Open("a.mcap", 0.0)),
    ({"type": "record", "on": False}, messages.Record(False)),
    ({"type": "save", "robot": "robot", "number": 0}, messages.Save("robot", 0)),
    ({"type": "place", "thing": "ball", "x_m": 1, "y_m": -0.5}, messages.Place("ball", 1.0, -0.5, None)),
    (
        {"type": "place", "thing": "robot 1", "x_m": 1.5, "y_m": 0, "theta_rad": 3},
        messages.Place("robot 1", 1.5, 0.0, 3.0),
    ),
    ({"type": "collect", "on": True}, messages.Collect(True)),
    ({"type": "calibrate", "kind": "omni"}, messages.Calibrate("omni")),
    ({"type": "markings", "on": True}, messages.ShowMarkings(True)),
]


@pytest.mark.parametrize(("told", "message"), GOOD)
def test_each_message_is_read(told, message):
    assert messages.read_message(json.dumps(told)) == message


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "null", "{", '{"type": "eval"}', '{"type": "pause"}', '{"type": "pause", "on": 1}',
        '{"type": "pause", "on": true, "more": 1}', '{"type": "step", "frames": 1.5}',
        '{"type": "step", "frames": 100000}', '{"type": "back", "seconds": -1}', '{"type": "back", "seconds": NaN}',
        '{"type": "back", "seconds": 1e999}', '{"type": "save", "robot": "", "number": 1}',
        '{"type": "save", "robot": "r", "number": -1}', '{"type": "calibrate", "kind": "fisheye"}',
        '{"type": "place", "thing": "ball", "x_m": 1}', '{"type": "place", "thing": "ball", "x_m": 1e999, "y_m": 0}',
        '{"type": "place", "thing": "ball", "x_m": 1, "y_m": NaN}',
        '{"type": "place", "thing": "", "x_m": 1, "y_m": 0}',
        '{"type": "open", "recording": "' + "a" * 300 + '"}', '{"type": "pause", "on": true}' + " " * 2000,
        '"\\ud800"', "\ud800",
    ],
)  # fmt: skip
def test_what_is_no_message_is_refused(text):
    with pytest.raises(PacketError, match="message of a page"):
        messages.read_message(text)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(PacketError):
        messages.read_message(text)
