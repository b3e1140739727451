"""Where a player looks: a head to ball, goals and undecided floor, a fixed camera to crossings while it is unsure."""

from __future__ import annotations

import dataclasses
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
from sim2d.match.setups import camera_for, setup_for
from sim2d.players.built_in import BuiltInPlayer
from sim2d.players.catalog import player_factory
from sim2d.players.head import (
    SURE_M,
    UNLOCATED_LOOKS,
    UNSURE_M,
    WATCH_S,
    FieldHalf,
    FloorLook,
    Head,
    HeadView,
    PoseLook,
    mirrored,
)
from sim2d.players.plan import Plan
from sim2d.robot_link import PlayerSetup, RobotLimits, Senses

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
    half = FieldHalf(FIELD, CAMERA, NECK)
    fixation = half.choose(halves(0.6), 0.0, ())
    assert fixation is not None
    assert abs(fixation.pan_rad) <= NECK.limit_rad
    assert half.choose(halves(0.995), 0.0, ()) is None
    white = FieldHalf(load_field("spl_2020"), CAMERA, NECK)
    assert white.choose(halves(0.5), 0.0, ()) is None


def test_a_goal_missed_again_and_again_is_not_looked_for_until_the_robot_is_elsewhere():
    half = FieldHalf(FIELD, CAMERA, NECK)
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
    for k in range(UNLOCATED_LOOKS):
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
    sweeping_s = WATCH_S + 0.1
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


FLOOR_LOOK_HERE = Pose2(0.0, 0.0, 0.3)
TARGET = (1.2, 0.0)


def picture():
    """80 cells of 4 cm about the origin: free, but for a strip across the way."""
    state = np.full((80, 80), FREE, dtype=np.uint8)
    state[60:64, :] = UNDECIDED
    return MapPicture(state, (-1.6, -1.6), 0.04)


def look():
    return FloorLook(RobotLimits(), 0.5)


def test_two_looks_from_one_place_are_enough():
    planner = look()
    for _ in range(2):
        pan_rad, _ = planner.choose(picture(), FLOOR_LOOK_HERE, TARGET)
        planner.observe(pan_rad + 1.0)  # not there yet: no look
        planner.observe(pan_rad)
    left = planner.choose(picture(), FLOOR_LOOK_HERE, TARGET)
    assert left is None or abs(math.remainder(left[0] - pan_rad, math.tau)) > 0.4


def test_known_floor_needs_no_look():
    free = MapPicture(np.full((80, 80), FREE, dtype=np.uint8), (-1.6, -1.6), 0.04)
    assert look().choose(free, FLOOR_LOOK_HERE, TARGET) is None


def test_a_target_off_the_map_counts_as_on_its_rim_and_a_robot_off_it_does_not_look():
    assert look().choose(picture(), FLOOR_LOOK_HERE, (9.0, 0.0)) is not None
    assert look().choose(picture(), Pose2(3.0, 0.0, 0.0), TARGET) is None


POSE_LOOK_FIELD = load_field("ssl_division_b")


def robot(std_m, x_m=1.5, y_m=-1.0):
    return PoseEstimate(Pose2(x_m, y_m, 0.0), np.diag([std_m, 0.01, 0.02]) ** 2, 1.0, 0.0)


def test_the_nearest_crossing_is_faced_from_unsure_until_sure():
    look = PoseLook(POSE_LOOK_FIELD)
    assert look.direction_rad(robot(0.9 * UNSURE_M)) is None
    # the centre circle crosses the halfway line 0.5 m from the centre
    circle_rad = math.atan2(0.5, -1.5)
    assert look.direction_rad(robot(1.1 * UNSURE_M)) == pytest.approx(circle_rad)
    assert look.direction_rad(robot(0.9 * UNSURE_M)) == pytest.approx(circle_rad)
    assert look.direction_rad(robot(0.9 * SURE_M)) is None
    assert look.direction_rad(robot(0.9 * UNSURE_M)) is None


def test_a_crossing_below_the_picture_is_none():
    assert PoseLook(POSE_LOOK_FIELD).direction_rad(robot(0.1, 0.1, -0.5)) == pytest.approx(math.atan2(1.0, -0.1))


def test_on_a_field_without_lines_nothing_helps():
    bare = dataclasses.replace(POSE_LOOK_FIELD, lines=POSE_LOOK_FIELD.lines[:0], arcs=POSE_LOOK_FIELD.arcs[:0])
    assert PoseLook(bare).direction_rad(robot(0.1)) is None


@pytest.mark.parametrize("attacks", [1, -1])
def test_a_player_looks_there_on_its_way_unless_the_ball_is_close(attacks):
    way = Plan("search", (1.0, 0.0), 0.3)
    looks = PoseLook(POSE_LOOK_FIELD).on_the_way(way, robot(0.1), attacks)
    in_field_rad = math.atan2(0.5, -1.5)
    assert looks.looks
    assert math.remainder(
        looks.heading_rad - in_field_rad - (0.0 if attacks > 0 else math.pi), math.tau
    ) == pytest.approx(0.0)
    for near in (dataclasses.replace(way, close=True), dataclasses.replace(way, holding=True)):
        assert PoseLook(POSE_LOOK_FIELD).on_the_way(near, robot(0.1), attacks) == near
    assert PoseLook(POSE_LOOK_FIELD).on_the_way(way, robot(0.01), attacks) == way


@pytest.mark.parametrize(("pan_limit_rad", "turns"), [(0.0, True), (1.5, False)])
def test_a_head_is_turned_instead_of_the_robot(pan_limit_rad, turns):
    field = load_field("four_legged_2007")
    camera, limits = camera_for(field), dataclasses.replace(setup_for(field).robot.limits, pan_limit_rad=pan_limit_rad)
    player = BuiltInPlayer(PlayerSetup(field, camera, limits, 1, 1, 2, 0))
    carpet = np.full((*camera.size_px[::-1], 3), (50, 130, 45), dtype=np.uint8)
    # it waits for the kick-off, and knows its place to 5 cm
    command = player.act(Senses(0.0, carpet, 0.0, Pose2(0.0, 0.0, 0.0), False, "kick_off", False, 0.0))
    assert (command.turn_rps != 0.0) == turns
