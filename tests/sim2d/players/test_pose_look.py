"""Where a robot with a fixed camera turns to while it is unsure of its place."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from sim2d.match.setups import camera_for, setup_for
from sim2d.players.built_in import BuiltInPlayer
from sim2d.players.head import PoseLook, PoseLookSettings
from sim2d.players.plan import Plan
from sim2d.robot_link import PlayerSetup

FIELD = load_field("ssl_division_b")
SETTINGS = PoseLookSettings()


def robot(std_m, x_m=1.5, y_m=-1.0):
    return PoseEstimate(Pose2(x_m, y_m, 0.0), np.diag([std_m, 0.01, 0.02]) ** 2, 1.0, 0.0)


def test_the_nearest_crossing_is_faced_from_unsure_until_sure():
    look = PoseLook(FIELD)
    assert look.direction_rad(robot(0.9 * SETTINGS.unsure_m)) is None
    # the centre circle crosses the halfway line 0.5 m from the centre
    circle_rad = math.atan2(0.5, -1.5)
    assert look.direction_rad(robot(1.1 * SETTINGS.unsure_m)) == pytest.approx(circle_rad)
    assert look.direction_rad(robot(0.9 * SETTINGS.unsure_m)) == pytest.approx(circle_rad)
    assert look.direction_rad(robot(0.9 * SETTINGS.sure_m)) is None
    assert look.direction_rad(robot(0.9 * SETTINGS.unsure_m)) is None


def test_a_crossing_below_the_picture_is_none():
    assert PoseLook(FIELD).direction_rad(robot(0.1, 0.1, -0.5)) == pytest.approx(math.atan2(1.0, -0.1))


def test_on_a_field_without_lines_nothing_helps():
    bare = dataclasses.replace(FIELD, lines=FIELD.lines[:0], arcs=FIELD.arcs[:0])
    assert PoseLook(bare).direction_rad(robot(0.1)) is None


def player(attacks, field=FIELD):
    limits = setup_for(field).robot.limits
    return BuiltInPlayer(PlayerSetup(field, camera_for(field), limits, attacks, 1, 2, 0))


@pytest.mark.parametrize("attacks", [1, -1])
def test_a_player_looks_there_on_its_way_unless_the_ball_is_close(attacks):
    way = Plan("search", (1.0, 0.0), 0.3)
    looks = player(attacks)._look_for_pose(way, robot(0.1))
    in_field_rad = math.atan2(0.5, -1.5)
    assert looks.looks
    assert math.remainder(
        looks.heading_rad - in_field_rad - (0.0 if attacks > 0 else math.pi), math.tau
    ) == pytest.approx(0.0)
    for near in (dataclasses.replace(way, close=True), dataclasses.replace(way, holding=True)):
        assert player(attacks)._look_for_pose(near, robot(0.1)) == near
    assert player(attacks)._look_for_pose(way, robot(0.01)) == way


def test_a_head_is_turned_instead():
    way = Plan("search", (1.0, 0.0), 0.3)
    assert player(1, load_field("four_legged_2007"))._look_for_pose(way, robot(0.1)) == way
