"""Heads that ask for the half of the field while two mirrored modes are left, and that look at undecided floor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.belief import Hypothesis, MapPicture
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, half_turn_covariance
from robocup_vision.mapping.occupancy import FREE, UNDECIDED
from robocup_vision.planning import Neck
from sim2d.match.match import Match
from sim2d.players.catalog import player_factory
from sim2d.players.head import FieldHalf, FieldHalfSettings, Head, HeadSettings, HeadView, mirrored
from sim2d.robot_link import RobotLimits

FIELD = load_field("four_legged_2007")
CAMERA = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, tilt_rad=-0.2, roll_rad=0.0)
NECK = Neck(1.4)
SURE = np.diag([0.05, 0.05, 0.025]) ** 2
HERE = Pose2(0.5, 0.3, 0.2)


def halves(probability, pose=HERE):
    other = Hypothesis(pose.half_turn(), half_turn_covariance(SURE), 1 - probability)
    return (Hypothesis(pose, SURE, probability), other)


def test_mirrored_takes_the_half_turn_of_the_most_probable_pose():
    first, second = halves(0.5)
    elsewhere = Hypothesis(Pose2(-1.0, 1.0, 0.0), SURE, 0.1)
    assert mirrored((first, elsewhere, second)) == (first, second)
    assert mirrored((first, elsewhere)) == ()
    assert mirrored(()) == ()


def test_it_asks_while_the_half_is_unknown_and_then_no_more():
    half = FieldHalf(FIELD, CAMERA, NECK, FieldHalfSettings())
    fixation = half.choose(halves(0.6), 0.0, ())
    assert fixation is not None
    assert abs(fixation.pan_rad) <= NECK.limit_rad
    assert half.choose(halves(0.995), 0.0, ()) is None
    white = FieldHalf(load_field("spl_2020"), CAMERA, NECK, FieldHalfSettings())
    assert white.choose(halves(0.5), 0.0, ()) is None


def test_a_goal_missed_again_and_again_is_not_looked_for_until_the_robot_is_elsewhere():
    half = FieldHalf(FIELD, CAMERA, NECK, FieldHalfSettings())
    blind = type("Blind", (), {"pose": NotLocated("nothing in view"), "measurement": None, "camera": CAMERA})()
    for _ in range(60):
        fixation = half.choose(halves(0.6), 0.0, ())
        if fixation is None:
            break
        half.observe(halves(0.6), fixation.pan_rad, blind)
    assert fixation is None
    # neither half of the field is elsewhere
    assert half.choose(halves(0.6, HERE.half_turn()), 0.0, ()) is None
    moved = Pose2(HERE.x_m - 0.6, HERE.y_m, HERE.theta_rad)
    assert half.choose(halves(0.6, moved), 0.0, ()) is not None


def test_a_head_asks_before_it_watches_the_ball():
    head = Head(FIELD, RobotLimits(), CAMERA, plans=True, asks=True)
    pose = PoseEstimate(HERE, SURE, 1.0, 0.5)
    unsure, sure = (HeadView(pose, halves(p), (0.8, 0.3), (), None, None) for p in (0.6, 0.999))
    pan_rad = head.turn(0.0, unsure)
    assert head.gaze.choice == "half"
    assert pan_rad == pytest.approx(head.gaze.pan_rad)
    to_ball = HERE.inverse().transform((0.8, 0.3))
    assert head.turn(0.2, sure) == pytest.approx(math.atan2(to_ball[1], to_ball[0]))
    assert head.gaze is None


def test_a_head_leaves_the_ball_when_the_heading_is_unsure():
    head = Head(FIELD, RobotLimits(), CAMERA, plans=False)
    ball = (0.8, 0.3)
    to_ball = HERE.inverse().transform(ball)
    pans = []
    for std_rad in (0.025, 0.06):
        pose = PoseEstimate(HERE, np.diag([0.05, 0.05, std_rad]) ** 2, 1.0, 0.5)
        pans.append(head.turn(0.4, HeadView(pose, (), ball, (), None, None)))
    assert pans[0] == pytest.approx(math.atan2(to_ball[1], to_ball[0]))
    assert abs(pans[1] - pans[0]) > 0.3


def test_a_head_leaves_the_ball_after_many_frames_without_a_pose():
    blind, seen = (type("Seen", (), {"pose": pose})() for pose in (NotLocated("nothing in view"), True))
    head = Head(FIELD, RobotLimits(), CAMERA, plans=False)
    now = HeadView(PoseEstimate(HERE, SURE, 1.0, 0.5), (), (0.8, 0.3), (), None, None)
    watching = head.turn(0.4, now)
    for k in range(HeadSettings().unlocated_looks):
        assert head.turn(0.4, now) == watching, k
        head.observe(blind, ())
    assert abs(head.turn(0.4, now) - watching) > 0.3
    head.observe(seen, ())
    assert head.turn(0.4, now) == watching


def test_a_head_looks_at_undecided_floor_on_the_way_when_it_does_not_watch_the_ball():
    state = np.full((80, 80), FREE, dtype=np.uint8)
    state[60:64, :] = UNDECIDED
    floor = MapPicture(state, (-1.6, -1.6), 0.04)
    pose = PoseEstimate(Pose2(0.0, 0.0, 0.3), SURE, 1.0, 0.5)
    now = HeadView(pose, halves(0.999), (-0.5, 0.0), (), floor, (1.2, 0.0))
    head = Head(FIELD, RobotLimits(), CAMERA, plans=True, looks_again=True)
    sweeping_s = HeadSettings().watch_s + 0.1
    assert head.turn(sweeping_s, now) == pytest.approx(-0.3, abs=0.2)
    assert head.gaze.choice == "floor"
    plain = Head(FIELD, RobotLimits(), CAMERA, plans=True)
    plain.turn(sweeping_s, now)
    assert plain.gaze.choice in ("planned", "sweep")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["asking", "looking"])
def test_players_that_ask_or_look_again_play_on(name):
    """Only this finds a player that its own questions stop."""
    match = Match(FIELD, 1, 3, ours=player_factory(name))
    robots = [moment.robots[0] for moment in match.play(2.0)]
    assert not any(robot.stopped for robot in robots)
    assert any(robot.status.gaze_rad is not None for robot in robots)
