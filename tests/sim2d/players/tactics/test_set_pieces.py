"""Tactics while the rules bind a team: who keeps away, who takes the ball, who places it."""

from __future__ import annotations

import math

import pytest
from situations import situation

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.players.tactics.tactics import Tactics
from sim2d.robot_link import RobotLimits

FIELD = load_field("ssl_division_b")
LIMITS = RobotLimits()


def decide(number=1, players=4, pose=Pose2(-1.0, 0.2, 0.0), **changes):
    return Tactics(FIELD, LIMITS, number, players).decide(situation(pose, **changes))


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("phase", ["stop", "free_kick", "ball_placement"])
def test_whose_turn_it_is_not_keeps_half_a_metre_away(phase, number):
    plan = decide(number, phase=phase, placement=(1.0, 1.0))
    (zone,) = plan.keep_outs
    assert zone.signed_distance_m((0.45, 0.0)) < 0
    if phase == "ball_placement":
        # along the ball's way, too
        assert zone.signed_distance_m((0.5, 0.5)) < 0
    assert plan.kick_mps == 0.0
    assert (plan.speed_mps is None) == (phase == "free_kick")
    assert plan.speed_mps is None or plan.speed_mps <= 1.5


def test_one_robot_takes_its_teams_free_kick_and_kicks_at_once():
    assert decide(1, phase="free_kick", own_turn=True).intent == "fetch"
    kick = decide(1, phase="free_kick", own_turn=True, in_mouth=True)
    assert (kick.intent, kick.kick_mps) == ("free kick", LIMITS.kick_speed_mps)
    assert "support" in decide(2, phase="free_kick", own_turn=True).intent


def test_a_penalty_is_between_kicker_and_keeper():
    kicker = decide(1, phase="prepare_penalty", own_turn=True, ball=(1.5, 0.0))
    assert kicker.intent == "prepare penalty"
    assert kicker.target[0] < 1.5
    assert decide(1, phase="penalty", own_turn=True, ball=(1.5, 0.0)).intent == "fetch"
    others = decide(2, phase="penalty", own_turn=True, ball=(1.5, 0.0))
    assert others.target[0] <= 0.5
    keeper = decide(0, phase="prepare_penalty", ball=(-1.5, 0.0))
    assert keeper.target[0] < -4.3
    assert decide(0, phase="penalty", ball=(-1.5, 0.0)).intent == "keep"
    assert decide(2, phase="penalty", ball=(-1.5, 0.0)).target[0] >= -0.5


def test_the_ball_is_fetched_taken_along_and_left_where_it_shall_be():
    there = {"phase": "ball_placement", "own_turn": True, "placement": (2.0, 0.0)}
    assert decide(1, **there).intent == "place: fetch"
    carry = decide(1, in_mouth=True, **there)
    assert carry.intent == "place the ball"
    assert carry.dribble
    assert carry.target[0] == pytest.approx(2.0 - 0.1115, abs=1e-6)
    leave = decide(1, pose=Pose2(1.9, 0.0, 0.0), ball=(2.0, 0.0), in_mouth=True, **there)
    assert leave.intent == "leave the ball"
    assert not leave.dribble
    assert math.dist(leave.target, (2.0, 0.0)) > 0.6


def test_a_ball_at_the_boards_is_taken_from_before_them_and_pulled_away():
    there = {"phase": "ball_placement", "own_turn": True, "placement": (0.0, 2.8), "ball": (0.0, 3.27)}
    before = decide(1, pose=Pose2(-1.0, 3.0, 0.0), **there)
    assert before.intent == "place: before the wall"
    assert before.target[1] < 3.27
    straight = decide(1, pose=Pose2(0.0, 3.05, math.pi / 2), **there)
    assert straight.intent == "place: at the wall"
    pull = decide(1, pose=Pose2(0.0, 3.15, math.pi / 2), in_mouth=True, **there)
    assert pull.intent == "pull the ball"
    assert pull.target[1] < 2.9
    assert pull.dribble
