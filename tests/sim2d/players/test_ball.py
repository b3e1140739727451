"""What a player knows of the ball: sightings, who hides it, what others told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.belief import Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.team.message import BallSighting, TeamMessage
from robocup_vision.team.roles import RoleChooser
from sim2d.players.ball import (
    BallKnowledge,
    BallMemory,
    NoddingCamera,
    block_ball,
    is_in_sight,
)
from sim2d.players.team_talk import TeamTalk
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import PlayerSetup, RobotLimits

FIELD = load_field("ssl_2001")
HERE = PoseEstimate(Pose2(0.0, 0.0, math.pi / 2), np.diag([1e-4, 1e-4, 1e-3]), 1.0, 0.0)
BEARING = (np.arange(64) + 0.5) * math.tau / 64
OPEN, SHUT = FreeSpace(BEARING, np.full(64, 3.0)), FreeSpace(BEARING, np.full(64, 0.1))
NODS = NoddingCamera((3.0, 2.1), 0.3)
AHEAD = Ball(0.5, 0.0, np.diag([4e-4, 1e-4]), 0.0, 0.0)


def knowledge(*told, talks=True, hides=False, nods=None):
    talk = None
    if talks:
        setup = PlayerSetup(FIELD, sekimori_camera(), RobotLimits(), 1, 1, 3, 0)
        talk = TeamTalk(setup, RoleChooser(1, is_keeper=False, speed_mps=1.0))
        for k, ball in enumerate(told):
            talk.hear((TeamMessage(k + 2, ball.t_s, "support", ball=ball).pack(),), None)
    return BallKnowledge(0.12, hides=hides, talk=talk, nods=nods)


def seen(t_s, x_m, y_m):
    return BallSighting(t_s, x_m, y_m, 0.0, 0.0, 1e-3 * np.eye(2))


def locate(known, t_s, free_space=SHUT, robot=HERE.pose, tracks=()):
    return known.locate(robot, free_space, t_s, tracks, 0.0)


def test_a_seen_ball_is_where_it_was_seen_with_the_errors_of_frame_and_pose():
    known = knowledge()
    known.see(HERE, AHEAD, 1.0, (), 0.0)
    assert locate(known, 1.1).place == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.5))
    # the heading's error moves it sideways, the range error along y
    np.testing.assert_allclose(known.sighting.covariance, np.diag([1e-4 + 0.25e-3 + 1e-4, 1e-4 + 4e-4]), atol=1e-12)


def test_a_player_that_does_not_speak_has_no_sighting_to_tell():
    known = knowledge(talks=False)
    known.see(HERE, AHEAD, 1.0, (), 0.0)
    assert known.sighting is None
    assert known.place(1.0) == locate(known, 1.0).place


def test_messages_tell_of_a_ball_that_it_has_never_seen_even_when_it_is_lost():
    known = knowledge(seen(1.0, 0.7, 0.3))
    assert locate(known, 1.1).place == pytest.approx((0.7, 0.3), abs=1e-6)
    assert locate(known, 1.2, None, None).place == pytest.approx((0.7, 0.3), abs=1e-6)
    assert known.place(1.2) == pytest.approx((0.7, 0.3), abs=1e-6)
    assert locate(known, 6.0).place is None


def test_its_own_sighting_stands_while_it_is_new_and_the_newer_one_afterwards():
    known = knowledge(seen(2.0, 0.7, 0.3))
    known.see(HERE, AHEAD, 2.0, (), 0.0)
    assert locate(known, 2.1).place == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.5))
    known = knowledge(seen(2.0, 0.7, 0.3))
    known.see(HERE, AHEAD, 1.0, (), 0.0)
    assert math.dist(locate(known, 2.1).place, (0.7, 0.3)) < 0.05


def test_a_told_ball_that_is_not_there_is_forgotten_near_by_but_not_far_off():
    assert locate(knowledge(seen(1.0, 0.0, 0.7)), 1.1, OPEN).place is None
    assert locate(knowledge(seen(1.0, 0.0, 0.7)), 1.1, SHUT).place is not None
    assert locate(knowledge(seen(1.0, 0.0, 1.2)), 1.1, OPEN).place is not None


def test_a_ball_of_its_own_that_is_not_there_is_forgotten():
    known = knowledge(talks=False)
    known.see(HERE, AHEAD, 1.0, (), 0.0)
    assert locate(known, 1.3, OPEN).place is not None
    assert locate(known, 1.6, SHUT).place is not None
    assert locate(known, 1.7, OPEN).place is None
    assert locate(known, 1.8, SHUT).place is None


@pytest.mark.parametrize("talks", [False, True])
def test_a_hidden_ball_goes_with_the_robot_that_has_it(talks):
    known = knowledge(talks=talks, hides=True)
    track = Track(7, 0.0, 0.6, 0.5, 0.0, 1e-4 * np.eye(4), 1.0, 10, 0)
    known.see(HERE, AHEAD, 1.0, (track,), 0.0)
    hidden = known.locate(HERE.pose, SHUT, 1.4, (track,), 0.4)
    assert talks or hidden.velocity_mps == (0.5, 0.0)
    assert hidden.place == pytest.approx((0.2 + 0.12 * math.sin(0.3217), 0.6 + 0.12 * math.cos(0.3217)), abs=0.02)


def test_a_nodding_cameras_far_sightings_are_filtered():
    known = knowledge(talks=False, nods=NODS)
    for k in range(60):
        range_m = 1.8 + 0.3 * math.sin(0.4 * k)
        known.see(HERE, Ball(range_m, 0.0, np.diag([0.05, 1e-4]), 0.0, 0.0), 1.0 + k / 30, (), 0.0)
    x_m, y_m = locate(known, 3.0).place
    assert abs(x_m) < 0.01
    assert y_m == pytest.approx(1.8, abs=0.15)


@pytest.mark.parametrize("range_m", [30.0, 1e6])
@pytest.mark.parametrize("heading", [0.0, 0.5, math.pi / 2, 2.5, -2.0])
def test_a_ball_seen_beyond_the_floor_lies_where_its_ray_leaves_it(heading, range_m):
    known, robot = knowledge(talks=False, nods=NODS), Pose2(0.5, -0.3, heading)
    belief = PoseEstimate(robot, np.diag([1e-6, 1e-6, 1e-6]), 1.0, 0.0)
    # as a camera 0.2 m high measures it
    covariance = np.diag([(range_m**2 / 0.2 * 5e-3) ** 2, (range_m * 5e-3) ** 2])
    for t_s in (0.9, 1.0):
        known.see(belief, Ball(range_m, 0.0, covariance, 0.0, 0.0), t_s, (), 0.0)
    assert np.sqrt(np.diag(known.sighting.covariance)).max() < 2.0
    x_m, y_m = known.place(1.0)
    assert max(abs(x_m) / 3.0, abs(y_m) / 2.1) == pytest.approx(1.0)
    assert math.atan2(y_m + 0.3, x_m - 0.5) == pytest.approx(heading)


def test_a_ball_too_near_to_be_seen_is_not_missed():
    for away_m, is_kept in ((0.25, True), (0.5, False)):
        known = knowledge(talks=False, nods=NODS)
        known.see(HERE, Ball(away_m, 0.0, 1e-4 * np.eye(2), 0.0, 0.0), 1.0, (), 0.0)
        assert (locate(known, 1.7, OPEN).place is not None) == is_kept


@pytest.mark.parametrize("talks", [False, True])
def test_a_held_ball_is_in_the_mouth(talks):
    known = knowledge(talks=talks)
    known.hold(HERE, 1.2)
    assert locate(known, 1.2).place == pytest.approx((0.0, 0.12))


def test_after_a_kick_off_nothing_is_known_of_before():
    known = knowledge(seen(1.0, 0.7, 0.3))
    known.see(HERE, AHEAD, 1.0, (), 0.0)
    known.forget(1.5)
    assert locate(known, 1.5).place is None
    # a frame that comes late
    known.see(HERE, AHEAD, 1.45, (), 0.0)
    assert locate(known, 1.5).place is None
    known.see(HERE, AHEAD, 1.55, (), 0.0)
    assert locate(known, 1.6).place is not None


@pytest.mark.parametrize("range_m", [4.0, 1e3, 1e7, 1e9])
@pytest.mark.parametrize("bearing_rad", [0.3, -0.85, 1.2])
def test_a_ball_at_the_horizon_has_a_covariance(range_m, bearing_rad):
    # as a head's camera has it: the error along the ray grows with the square of the range
    turn = np.array([[math.cos(bearing_rad), -math.sin(bearing_rad)], [math.sin(bearing_rad), math.cos(bearing_rad)]])
    along, across = 0.05 * range_m**2, 0.005 * range_m
    covariance = turn @ np.diag([along**2, across**2]) @ turn.T
    place = range_m * turn[:, 0]
    known = knowledge(nods=NODS)
    known.see(HERE, Ball(*place.tolist(), covariance, 0.0, 0.0), 1.0, (), 0.0)
    x_m, y_m = known.sighting.x_m, known.sighting.y_m
    assert abs(x_m) <= 3.0 + 1e-6
    assert abs(y_m) <= 2.1 + 1e-6
    values = np.linalg.eigvalsh(known.sighting.covariance)
    away_m = math.hypot(x_m, y_m)
    assert values[0] > 0
    # what rounding leaves open may make it less sure, never surer
    expected_m = math.hypot(0.05 * away_m**2, 0.01)
    assert 0.9 * expected_m < math.sqrt(values[1]) < (1.1 if range_m < 1e8 else 3.0) * expected_m


BALL_MEMORY_OPEN = FreeSpace(BEARING, np.full(64, 1.0))


def test_a_rolling_ball_has_a_velocity_and_an_unseen_one_is_forgotten():
    memory = BallMemory()
    assert memory.place(0.0) is None
    for k in range(20):
        memory.update((0.03 * k, 0.0), k / 30)
    assert memory.velocity_mps == (pytest.approx(0.9, abs=0.01), 0.0)
    assert memory.place(1.0) == (pytest.approx(0.57), 0.0)
    assert memory.age_s(1.0) == pytest.approx(1.0 - 19 / 30)
    assert memory.place(9.0) is None
    # seen elsewhere later, it has not rolled there
    memory.update((-1.0, 0.0), 2.0)
    assert memory.velocity_mps == (0.0, 0.0)
    memory.miss()
    assert memory.place(2.0) is None


def test_a_ball_that_jumps_did_not_roll():
    memory = BallMemory()
    memory.update((0.0, 0.0), 0.0)
    memory.update((1.0, 0.0), 1 / 30)
    assert memory.velocity_mps == (0.0, 0.0)


def test_a_ball_blocks_its_own_directions_only():
    blocked = block_ball(BALL_MEMORY_OPEN, (0.5, 0.0), 0.02).range_m
    assert blocked[0] == blocked[-1] == pytest.approx(0.48)
    assert np.all(blocked[2:-2] == 1.0)
    assert block_ball(BALL_MEMORY_OPEN, (0.01, 0.0), 0.02) is BALL_MEMORY_OPEN


def test_a_place_is_in_sight_where_the_floor_is_free_up_to_it():
    assert is_in_sight(BALL_MEMORY_OPEN, (0.6, 0.3))
    assert not is_in_sight(BALL_MEMORY_OPEN, (1.2, 0.3))
    ahead = FreeSpace(np.linspace(-0.3, 0.3, 9), np.full(9, 2.0))
    assert not is_in_sight(ahead, (-1.0, 0.0))
