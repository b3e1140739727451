"""Team messages: what is packed comes back, and bytes that are no message are refused with the reason."""

from __future__ import annotations

import math
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError, PacketError
from robocup_vision.geometry import Pose2
from robocup_vision.team.message import (
    MAX_MESSAGE_BYTES,
    MESSAGE_BYTES,
    ROLES,
    BallSighting,
    TeamMessage,
    unpack_message,
)

LENGTHS = st.floats(-100.0, 100.0)
TIMES = st.floats(0.0, 1e6)


@st.composite
def covariances(draw, size):
    """Return a covariance, a product of a triangle with itself: flat in some directions, too."""
    triangle = np.zeros((size, size))
    triangle[np.tril_indices(size)] = draw(
        st.lists(st.floats(-1.0, 1.0), min_size=size * (size + 1) // 2, max_size=size * (size + 1) // 2)
    )
    return triangle @ triangle.T


@st.composite
def messages(draw):
    pose = covariance = ball = None
    if draw(st.booleans()):
        pose = Pose2(draw(LENGTHS), draw(LENGTHS), draw(st.floats(-math.pi, math.pi)))
        covariance = draw(covariances(3))
    if draw(st.booleans()):
        ball = BallSighting(
            draw(TIMES), *(draw(LENGTHS) for _ in range(4)), draw(covariances(2)), draw(st.floats(0.0, 9.0))
        )
    time_s = draw(st.one_of(st.floats(0.0, 1e3), st.just(math.inf)))
    return TeamMessage(
        draw(st.integers(0, 255)), draw(TIMES), draw(st.sampled_from(ROLES)), time_s, pose, covariance, ball
    )


def near(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@settings(max_examples=60)
@given(messages())
def test_what_is_packed_comes_back(message):
    data = message.pack()
    assert len(data) == MESSAGE_BYTES <= MAX_MESSAGE_BYTES
    found = unpack_message(data)
    assert (found.sender, found.t_s, found.role) == (message.sender, message.t_s, message.role)
    assert found.time_to_ball_s == pytest.approx(message.time_to_ball_s)
    assert (found.pose is None) == (message.pose is None)
    assert (found.ball is None) == (message.ball is None)
    if message.pose is not None:
        # rounded to single precision, a heading of half a turn may come back as minus half a turn
        away_m, turned_rad = found.pose.error_to(message.pose)
        near((away_m / max(1.0, *abs(message.pose.array[:2])), turned_rad), (0.0, 0.0))
        near(found.pose_covariance, message.pose_covariance)
    if message.ball is not None:
        assert found.ball.t_s == message.ball.t_s
        for name in ("x_m", "y_m", "vx_mps", "vy_mps", "velocity_std_mps"):
            near(getattr(found.ball, name), getattr(message.ball, name))
        near(found.ball.covariance, message.ball.covariance)
    # once rounded to 32 bits nothing changes any more
    assert found.pack() == data


@settings(max_examples=60)
@given(st.binary(max_size=200))
def test_foreign_bytes_are_refused(data):
    with pytest.raises(PacketError):
        unpack_message(data)


@settings(max_examples=60)
@given(messages(), st.integers(0, MESSAGE_BYTES * 8 - 1))
def test_a_flipped_bit_is_seen(message, bit):
    data = bytearray(message.pack())
    data[bit // 8] ^= 1 << bit % 8
    with pytest.raises(PacketError):
        unpack_message(bytes(data))


def checked(body):
    return body + struct.pack("<I", zlib.crc32(body))


BODY = TeamMessage(3, 1.0, "fetch", 2.0, Pose2(1.0, 2.0, 0.5), np.eye(3)).pack()[:-4]


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "these 0 bytes are no team message: they do not begin with RV"),
        (b"RV", f"a team message has {MESSAGE_BYTES} bytes, got 2"),
        (checked(BODY) + b"x", f"a team message has {MESSAGE_BYTES} bytes, got {MESSAGE_BYTES + 1}"),
        (checked(BODY[:2] + b"\x02" + BODY[3:]), "the team message has version 2, this program reads version 1"),
        (checked(BODY)[:-1] + b"x", "the team message is damaged: its checksum does not fit"),
        (checked(BODY[:4] + b"\x09" + BODY[5:]), "the team message has role 9 and flags 1, which"),
        (checked(BODY[:5] + b"\x11" + BODY[6:]), "the team message has role 1 and flags 17, which"),
        (checked(BODY[:6] + struct.pack("<d", math.nan) + BODY[14:]), "impossible values: t_s must be finite"),
        (checked(BODY[:14] + struct.pack("<f", -1.0) + BODY[18:]), "impossible values: time_to_ball_s"),
        (checked(BODY[:18] + struct.pack("<f", math.nan) + BODY[22:]), "impossible values"),
        (checked(BODY[:30] + struct.pack("<f", -1.0) + BODY[34:]), "must not be negative in any direction"),
        ("text", "a team message is bytes, got str"),
    ],
)
def test_the_reason_of_a_refusal_is_told(data, problem):
    with pytest.raises(PacketError, match=problem):
        unpack_message(data)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"sender": 256}, "sender must be within 0 to 255, got 256"),
        ({"role": "dance"}, "role must be one of search, fetch, support, keep, got 'dance'"),
        ({"t_s": math.inf}, "t_s must be finite"),
        ({"time_to_ball_s": math.nan}, "time_to_ball_s must not be negative"),
        ({"pose": Pose2(0.0, 0.0, 0.0)}, "pose and pose_covariance are given together"),
        ({"pose": Pose2(0.0, 0.0, 0.0), "pose_covariance": np.eye(2)}, "covariance of a pose must be"),
        ({"pose": Pose2(0.0, 0.0, 0.0), "pose_covariance": -np.eye(3)}, "must not be negative in any direction"),
        ({"pose": Pose2(0.0, 0.0, 0.0), "pose_covariance": np.triu(np.ones((3, 3)))}, "must be symmetric"),
    ],
)
def test_impossible_messages_are_refused(values, problem):
    with pytest.raises(ArgumentError, match=problem):
        TeamMessage(**{"sender": 0, "t_s": 0.0, "role": "keep", **values})


def test_impossible_balls_are_refused():
    with pytest.raises(ArgumentError, match="place and velocity of a ball must be finite"):
        BallSighting(0.0, math.nan, 0.0, 0.0, 0.0, np.eye(2))
    with pytest.raises(ArgumentError, match="velocity_std_mps must not be negative"):
        BallSighting(0.0, 0.0, 0.0, 0.0, 0.0, np.eye(2), -1.0)
    with pytest.raises(ArgumentError, match="covariance of a ball"):
        BallSighting(0.0, 0.0, 0.0, 0.0, 0.0, np.eye(3))
    with pytest.raises(ArgumentError, match="too large for 32 bits"):
        TeamMessage(0, 0.0, "fetch", ball=BallSighting(0.0, 1e300, 0.0, 0.0, 0.0, np.eye(2))).pack()
