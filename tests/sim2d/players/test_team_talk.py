"""What players tell each other: when, what, and what they make of messages that are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.team.message import BallSighting, TeamMessage, unpack_message
from robocup_vision.team.roles import RoleChooser
from sim2d.players.team_talk import TeamTalk
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import PlayerSetup, RobotLimits

FIELD, CAMERA, LIMITS = load_field("ssl_2001"), sekimori_camera(), RobotLimits()
HERE = PoseEstimate(Pose2(0.5, 0.1, 0.0), 1e-4 * np.eye(3), 1.0, 0.0)
BALL = BallSighting(1.0, 0.9, 0.1, 0.0, 0.0, 1e-4 * np.eye(2))


def talk(number=1, attacks=1):
    roles = RoleChooser(number, is_keeper=False, speed_mps=LIMITS.speed_mps)
    return TeamTalk(PlayerSetup(FIELD, CAMERA, LIMITS, attacks, number, 4, 0), roles)


def test_a_message_goes_out_twice_a_second():
    one = talk()
    told = [one.tell(k / 30, HERE, None, None) is not None for k in range(61)]
    assert [k for k, said in enumerate(told) if said] == [0, 15, 30, 45, 60]


def test_it_tells_its_place_and_the_ball_that_it_saw_itself():
    one = talk()
    one.role(HERE.pose, (0.9, 0.1), 1.1)
    message = unpack_message(one.tell(1.1, HERE, BALL, (0.9, 0.1)))
    assert (message.sender, message.t_s, message.role) == (1, 1.1, "fetch")
    np.testing.assert_allclose(message.pose.array, HERE.pose.array, atol=1e-6)
    assert (message.ball.x_m, message.ball.t_s) == (pytest.approx(0.9), 1.0)
    assert message.time_to_ball_s == pytest.approx(0.4)
    # an old sighting is none
    assert unpack_message(one.tell(9.0, HERE, BALL, None)).ball is None


@pytest.mark.parametrize(
    "belief",
    [NotLocated("lost"), PoseEstimate(HERE.pose, HERE.covariance, 1.0, 0.0, (HERE.pose, HERE.pose.half_turn()))],
)
def test_one_that_does_not_know_its_half_tells_no_place(belief):
    message = unpack_message(talk().tell(1.1, belief, BALL, (0.9, 0.1)))
    assert message.pose is None
    assert message.ball is None
    assert message.time_to_ball_s == math.inf


def test_what_others_saw_and_do_is_taken_in_and_nonsense_refused():
    one = talk()
    other = TeamMessage(2, 1.0, "fetch", 0.1, Pose2(0.8, 0.1, 0.0), np.eye(3), BALL).pack()
    echo = TeamMessage(1, 1.0, "fetch", 0.1, Pose2(0.8, 0.1, 0.0), np.eye(3), BALL).pack()
    one.hear((b"hello", other[:-1], echo), None)
    assert one.ball(None, 1.1) is None
    one.hear((other,), None)
    assert one.refused == 2
    ball = one.ball(None, 1.1)
    assert (ball.x_m, ball.sources) == (pytest.approx(0.9), (2,))
    assert one.role(HERE.pose, (0.9, 0.1), 1.1).role == "support"
    one.reject(ball)
    assert one.ball(None, 1.1) is None


@pytest.mark.parametrize(("attacks", "place"), [(1, 1), (-1, 0)])
def test_places_are_counted_as_the_team_sees_the_field(attacks, place):
    one = talk(attacks=attacks)
    supporter = TeamMessage(2, 1.0, "support", 9.0, Pose2(0.5, -0.5, 0.0), np.eye(3))
    fetcher = TeamMessage(3, 1.0, "fetch", 0.0, Pose2(0.9, 0.1, 0.0), np.eye(3))
    one.hear((supporter.pack(), fetcher.pack()), None)
    chosen = one.role(HERE.pose, (0.9, 0.1), 1.1)
    assert (chosen.role, chosen.place, chosen.places) == ("support", place, 2)
