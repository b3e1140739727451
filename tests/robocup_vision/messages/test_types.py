"""Message types: the published type hashes, and CDR that comes back."""

from __future__ import annotations

import hashlib
import json

import pytest

from field_models.errors import PacketError
from robocup_vision.messages.types import (
    CALL,
    added_types,
    decode,
    definition,
    describe,
    encode,
    header,
    make,
    stamp,
    to_seconds,
    type_hash,
)


@pytest.mark.parametrize("name", added_types())
def test_a_type_has_its_published_hash(name: str) -> None:
    assert type_hash(name) == added_types()[name][0]


@pytest.mark.parametrize("name", [*added_types(), "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"])
def test_a_description_is_what_the_hash_is_of(name: str) -> None:
    """REP-2011: the hash is of the description as JSON, with the default values left out."""
    types = [
        {
            "type_name": one,
            "fields": [
                {
                    "name": field.name,
                    "type": {
                        "type_id": field.type_id,
                        "capacity": field.capacity,
                        "string_capacity": field.string_capacity,
                        "nested_type_name": field.nested_type_name,
                    },
                }
                for field in fields
            ],
        }
        for one, fields in describe(name)
    ]
    text = json.dumps({"type_description": types[0], "referenced_type_descriptions": types[1:]})
    assert f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}" == type_hash(name)


def test_a_message_comes_back() -> None:
    message = decode(encode(header(12.25, "map")), "std_msgs/msg/Header")
    assert message.frame_id == "map"
    assert to_seconds(message.stamp) == 12.25


@pytest.mark.parametrize("t_s", [0.0, 1e-9, 0.9999999996, 1_763_000_000.123456])
def test_a_stamp_is_right_to_the_nanosecond(t_s: float) -> None:
    time = stamp(t_s)
    assert 0 <= time.nanosec < 1_000_000_000
    assert abs(time.sec * 1_000_000_000 + time.nanosec - round(t_s * 1e9)) == 0


def test_bytes_that_are_no_message_are_refused() -> None:
    with pytest.raises(PacketError, match="no std_msgs/msg/Header"):
        decode(b"\x00\x01\x00\x00\x01", "std_msgs/msg/Header")
    with pytest.raises(PacketError, match="no no_msgs/msg/Such"):
        decode(b"\x00\x01\x00\x00", "no_msgs/msg/Such")


def test_a_definition_names_all_that_a_type_is_made_of() -> None:
    assert "MSG: builtin_interfaces/Time" in definition(CALL)
    confidence = make("soccer_vision_attribute_msgs/msg/Confidence", -1.0)
    assert decode(encode(confidence), confidence.__msgtype__).confidence == -1.0
