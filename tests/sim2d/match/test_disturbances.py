"""What disturbs robots is on by their league, is repeated by a seed, and each part can be switched off."""

import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from sim2d.commands.match_options import add_match_options, match_plan
from sim2d.match.arena import Arena
from sim2d.match.disturbances import LEGS, MIRRORS_ON_LEGS, MIRRORS_ON_WHEELS, NAMES, NONE, WHEELS, disturbances_for
from sim2d.match.setups import ROBOTS, camera_for
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import Command
from sim2d.world.robot_spec import BodySettings

FIELD = load_field("four_legged_2007")
SMALL = PinholeCamera((52, 40), (48.0, 48.0), (25.5, 19.5), 0.2, tilt_rad=-0.2)


def sensed(disturbances, seed=3, periods=12, camera=SMALL):
    """Return the senses of a robot that walks ahead."""
    arena = Arena(FIELD, 1, seed, camera=camera, disturbances=disturbances)
    found = []
    for _ in range(periods):
        found.append(arena.senses()[0])
        arena.step({0: Command(forward_mps=0.4, turn_rps=0.3)})
    return found


def test_legs_have_all_of_them_and_a_mirror_camera_those_of_bodies_and_messages():
    assert disturbances_for(ROBOTS["four_legged"], SMALL) is LEGS
    assert disturbances_for(ROBOTS["small_size"], SMALL) is WHEELS
    for robot in ROBOTS.values():
        mirrors = MIRRORS_ON_LEGS if robot.has_legs else MIRRORS_ON_WHEELS
        assert disturbances_for(robot, sekimori_camera()) is mirrors
    assert Arena(FIELD, 1, 0).disturbances is LEGS
    assert Arena(load_field("ssl_2001"), 1, 0).disturbances is MIRRORS_ON_WHEELS
    assert isinstance(camera_for(FIELD), PinholeCamera)
    assert set(NAMES) - set(LEGS.names) == {"knock"}
    assert MIRRORS_ON_WHEELS.names == ("sway", "messages")
    assert set(LEGS.names) - set(WHEELS.names) == {"slip"}


@pytest.mark.parametrize("name", NAMES)
def test_each_can_be_on_alone(name):
    calm, disturbed = sensed(NONE), sensed(LEGS.only([name]))
    late = [one.frame is None or one.frame_t_s != one.t_s for one in disturbed]
    slips = any(one.odometry != other.odometry for one, other in zip(calm, disturbed, strict=True))
    shown = [
        np.abs(a.frame.astype(int) - b.frame).mean()
        for a, b in zip(calm, disturbed, strict=True)
        if b.frame_t_s == a.t_s
    ]
    assert all(late) == (name == "latency")
    assert slips == (name == "slip")
    if name in ("sway", "drift", "shutter", "camera"):
        assert max(shown) > 0.1
    assert LEGS.only([name]).names == (name,)


def test_legs_odometry_is_some_ten_percent_off():
    body = LEGS.slip.of(BodySettings(mass_kg=3.0))
    assert (body.gain_std, body.slip_part, body.mass_kg) == (0.05, 0.1, 3.0)
    ratios = []
    for seed in range(12):
        arena = Arena(FIELD, 1, seed, camera=SMALL, disturbances=LEGS.only(["slip"]))
        way = 0.0
        start = arena.state.robots[0].pose
        for _ in range(30):
            arena.step({0: Command(forward_mps=0.4)})
            way += arena.world.odometry(0).x_m
        true = arena.state.robots[0].pose
        ratios.append(way / math.hypot(true.x_m - start.x_m, true.y_m - start.y_m))
    assert 0.03 < np.std(ratios) < 0.12


def test_a_mirror_camera_leans_while_its_robot_speeds_up():
    field, camera = load_field("ssl_2001"), sekimori_camera()
    shown = []
    for on in (NONE, NONE.only(["sway"])):
        arena = Arena(field, 1, 3, camera=camera, disturbances=on)
        for _ in range(6):
            frame = arena.senses()[0].frame.astype(int)
            arena.step({0: Command(forward_mps=1.0)})
        shown.append(frame)
    # edges move, the plain carpet stays
    off = np.abs(shown[0] - shown[1]).max(axis=2)
    assert np.percentile(off, 99) > 40
    assert np.percentile(off, 60) < 3


def test_names_come_from_the_command_line():
    import argparse

    parser = argparse.ArgumentParser()
    add_match_options(parser, "out")
    plan = match_plan(parser.parse_args(["--field", "four_legged_2007", "--disturb", "sway,slip"]))
    assert plan.disturbances == LEGS.only(["sway", "slip"])
    assert match_plan(parser.parse_args([])).disturbances is None
    assert match_plan(parser.parse_args(["--disturb", "none"])).disturbances == NONE
    assert match_plan(parser.parse_args(["--disturb", "all"])).disturbances.names == NAMES
    with pytest.raises(
        ArgumentError,
        match="there is no disturbance 'swing': they are sway, latency, slip, drift, shutter, camera, knock, messages",
    ):
        match_plan(parser.parse_args(["--disturb", "swing"]))
