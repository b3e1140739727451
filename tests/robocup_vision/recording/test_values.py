"""Values of a recording come back in every bit, and nothing but values can be named in a file."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_runs import FIELD, is_same, make_steering, make_vision, run_frames

from field_models import field_names, load_field
from field_models.errors import ArgumentError, PacketError
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.recording.calls import look_outputs
from robocup_vision.recording.run import Run
from robocup_vision.recording.values import value_codec

CODEC = value_codec()
arrays = st.builds(
    lambda values, dtype: np.array(values, dtype=dtype),
    st.lists(st.integers(0, 100), max_size=5),
    st.sampled_from(["u1", "i4", "f4", "f8", "?"]),
)
leaves = st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text() | arrays
plain = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=4).map(tuple) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(plain)
def test_any_value_comes_back_from_messagepack_and_from_json(value: object) -> None:
    assert is_same(CODEC.unpack(CODEC.pack(value)), value)
    assert is_same(CODEC.from_json(CODEC.to_json(value)), value)


def test_a_run_makes_the_same_objects_again() -> None:
    run = Run.of(make_vision(), make_steering())
    again = CODEC.from_json(CODEC.to_json(run))
    assert is_same(CODEC.to_plain(again), CODEC.to_plain(run))
    assert again.vision is not None
    assert again.steering is not None
    vision, steering = again.vision.make(), again.steering.make()
    assert CODEC.to_plain(Run.of(vision, steering)) == CODEC.to_plain(run)
    assert (again.field.lines == FIELD.lines).all()


def test_a_class_that_is_no_value_is_refused() -> None:
    with pytest.raises(ArgumentError, match="cannot be recorded"):
        CODEC.pack(object())
    with pytest.raises(ArgumentError, match="cannot be recorded"):
        CODEC.pack(np.array([object()]))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b'{"class": "Popen", "fields": {"args": "true"}}',
        b'{"class": "Pose2", "fields": {"x_m": 1}}',
        b"{}",
    ],
)
def test_bytes_that_are_no_value_are_refused(data: bytes) -> None:
    with pytest.raises(PacketError, match="cannot be read"):
        CODEC.from_json(data)
    with pytest.raises(PacketError, match="cannot be read"):
        CODEC.unpack(b"\xc1" + data)


def test_the_digest_is_of_the_views_values() -> None:
    vision = make_vision()
    first, second = (vision.look(now.frame, now.t_s, now.odometry) for now in run_frames()[:2])
    assert look_outputs(first)["digest"] != look_outputs(second)["digest"]
    again = make_vision().look(run_frames()[0].frame, run_frames()[0].t_s, run_frames()[0].odometry)
    assert look_outputs(first)["digest"] == look_outputs(again)["digest"]


@pytest.mark.parametrize("name", field_names())
def test_every_field_comes_back(name: str) -> None:
    field = CODEC.unpack(CODEC.pack(load_field(name)))
    assert (field.name, field.goals, field.beacons) == (name, load_field(name).goals, load_field(name).beacons)


FORWARD = ((64, 48), (60.0, 61.0), (31.5, 23.5), 0.45)


@pytest.mark.parametrize("camera", [make_vision().camera, PinholeCamera(*FORWARD), FisheyeCamera(*FORWARD)])
def test_every_kind_of_camera_comes_back(camera: object) -> None:
    again = CODEC.unpack(CODEC.pack(camera))
    assert type(again) is type(camera)
    assert is_same(CODEC.to_plain(again), CODEC.to_plain(camera))
