"""Cameras as they truly are: off their file, and swaying with the body."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.match.arena import Arena
from sim2d.match.disturbances import Disturbances
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.sensors.body_sway import LEGS_SWAY, UPRIGHT, WHEELS_SWAY, BodySway, Sway
from sim2d.sensors.match_camera import MATCH_SENSOR, MatchCamera
from sim2d.sensors.true_cameras import CameraErrorSettings, KnockSettings, TrueCamera, draw_camera, with_stated_errors
from sim2d.world.state import RobotState, WorldState

FORWARD = PinholeCamera((52, 40), (48.0, 48.0), (25.5, 19.5), 0.2, tilt_rad=-0.2, roll_rad=0.0)
MIRROR = sekimori_camera()
ERROR = CameraErrorSettings()


def test_forward_cameras_are_drawn_about_their_file():
    rng = np.random.default_rng(1)
    assert draw_camera(FORWARD, ERROR, rng).pan_rad == 0.0
    panned = replace(ERROR, pan_rad=math.radians(0.5))
    drawn = [draw_camera(FORWARD, panned, rng) for _ in range(400)]
    values = np.array([(*c.center_px, c.focal_px[0], c.tilt_rad, c.roll_rad, c.height_m, c.pan_rad) for c in drawn])
    assert values.std(axis=0) == pytest.approx(
        [3.0, 3.0, 0.48, *[math.radians(0.5)] * 2, 0.005, math.radians(0.5)], rel=0.12
    )
    about = np.array([25.5, 19.5, 48.0, -0.2, 0.0, 0.2, 0.0])
    assert (np.abs(values.mean(axis=0) - about) < 4 * values.std(axis=0) / 20).all()
    assert all(c.focal_px[0] == c.focal_px[1] for c in drawn)


def test_mirror_cameras_are_drawn_about_their_file():
    rng = np.random.default_rng(2)
    drawn = [draw_camera(MIRROR, ERROR, rng) for _ in range(400)]
    radius = [float(c.floor_range.radius_px(2.0)) / float(MIRROR.floor_range.radius_px(2.0)) for c in drawn]
    values = np.array([(*c.center_px, *c.tilt_rad, r) for c, r in zip(drawn, radius, strict=True)])
    assert values.std(axis=0) == pytest.approx([1.5, 1.5, *[math.radians(0.3)] * 2, 0.02], rel=0.12)
    one = drawn[0].floor_range
    assert one.inverse_range_per_m(one.radius_px(2.0)) == pytest.approx(2.0)
    assert one.implied_height_m == pytest.approx(MIRROR.floor_range.implied_height_m)


def test_a_player_is_told_how_sure_its_file_is():
    sure = replace(FORWARD, height_std_m=0.001, roll_std_rad=0.01)
    doubted = with_stated_errors(sure, ERROR)
    tilts = [draw_camera(sure, ERROR, rng) for rng in map(np.random.default_rng, range(300))]
    # a centre that is off looks like a tilt
    seen = [camera.tilt_rad + 0.2 - (camera.center_px[1] - 19.5) / 48.0 for camera in tilts]
    assert np.std(seen) == pytest.approx(doubted.roll_std_rad, rel=0.12)
    assert doubted.height_std_m == ERROR.height_m
    # a file that doubts more stays as it is, and one that leaves it open
    assert with_stated_errors(replace(sure, roll_std_rad=0.3), ERROR).roll_std_rad == 0.3
    assert with_stated_errors(replace(sure, roll_std_rad=None), ERROR).roll_std_rad is None
    field = load_field("ssl_division_b")
    setups = [Arena(field, 1, 0, disturbances=Disturbances(camera=error)).setup(0) for error in (None, ERROR)]
    assert setups[0].camera.roll_std_rad < setups[1].camera.roll_std_rad


def test_a_knock_moves_a_camera_once_and_changes_no_lens():
    true = TrueCamera(None, KnockSettings(1.0, 2.0), FORWARD, [3, 0])
    assert true.camera is FORWARD
    assert 1.0 <= true.knock_s <= 2.0
    assert not true.is_knocked_by(0.99)
    assert true.is_knocked_by(2.0)
    assert true.camera.focal_px == FORWARD.focal_px
    assert true.camera.tilt_rad != FORWARD.tilt_rad
    assert not true.is_knocked_by(3.0)
    assert not TrueCamera(ERROR, None, FORWARD, [3, 0]).is_knocked_by(1e9)


@pytest.mark.parametrize("camera", [FORWARD, MIRROR], ids=["forward", "mirror"])
def test_players_know_the_file_alone_and_see_by_the_true_camera(camera):
    field = load_field("four_legged_2007")
    knocks = KnockSettings(0.0, 1e-3)
    arenas = [
        Arena(field, 1, 5, camera=camera, disturbances=Disturbances(camera=error, knock=knock))
        for error, knock in ((None, None), (ERROR, None), (ERROR, knocks))
    ]
    shown = []
    for arena in arenas:
        assert arena.setup(0).camera is camera
        arena.senses()
        arena.step({})
        shown.append(arena.senses()[0].frame.astype(int))
    assert np.abs(shown[0] - shown[1]).mean() > 1.0
    assert np.abs(shown[1] - shown[2]).mean() > 1.0


def test_a_robots_own_camera_is_of_the_matchs_kind():
    eye = MatchCamera(load_field("four_legged_2007"), FORWARD, RobotLimits(), np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="of the kind and image size"):
        eye.set_camera(0, MIRROR)


LIMITS = RobotLimits()


def sways(settings, speeds, kicks=(), seed=1):
    """Return (N, 3) sways of a robot that drives straight at speeds."""
    body = BodySway(settings, LIMITS, np.random.default_rng(seed))
    states = (RobotState(0, 1, 0, Pose2(0.0, 0.0, 0.7), (v * math.cos(0.7), v * math.sin(0.7)), 0.0) for v in speeds)
    return np.array([body.update(state, k in kicks) for k, state in enumerate(states)])


def test_legs_nod_at_the_steps_rhythm_and_stand_still_when_the_robot_does():
    count = 1200
    walked = sways(LEGS_SWAY, [0.5] * count)
    spectrum = np.abs(np.fft.rfft(walked - walked.mean(axis=0), axis=0))
    hertz = np.fft.rfftfreq(count, CONTROL_PERIOD_S)
    for column, rhythm in ((0, 1.7), (1, 0.85), (2, 1.7)):
        assert hertz[int(np.argmax(spectrum[:, column]))] == pytest.approx(rhythm, abs=0.1)
    # a sine of amplitude 1 and chance of 0.7
    assert walked[60:].std(axis=0) == pytest.approx(
        math.hypot(math.sqrt(0.5), 0.7) * np.array([LEGS_SWAY.nod_rad, LEGS_SWAY.roll_rad, LEGS_SWAY.height_m]), rel=0.2
    )
    assert np.abs(sways(LEGS_SWAY, [0.0] * 60)).max() == 0.0


def test_wheels_pitch_when_they_brake():
    braked = sways(WHEELS_SWAY, [0.8] * 10 + [0.8 - 0.04 * k for k in range(20)] + [0.04] * 30)
    assert braked[15:29, 0] == pytest.approx(-1.2 * WHEELS_SWAY.pitch_rad_per_mps2, rel=0.2)
    assert np.abs(braked[-10:]).max() < 1e-4
    # a robot that is carried elsewhere does not fall over
    assert np.abs(sways(WHEELS_SWAY, [0.0, 50.0, 0.0])).max() <= 2.4 * WHEELS_SWAY.pitch_rad_per_mps2


def test_a_kick_shakes_the_body_for_a_moment():
    shaken = sways(WHEELS_SWAY, [0.0] * 60, kicks={20})
    assert np.abs(shaken[:20]).max() == 0.0
    assert shaken[20, 0] == pytest.approx(WHEELS_SWAY.kick_rad)
    assert np.abs(shaken[22:30, 0]).max() > 0.1 * WHEELS_SWAY.kick_rad
    assert np.abs(shaken[40:]).max() == 0.0


@pytest.mark.parametrize("pan", [0.0, math.pi / 2])
def test_a_bodys_pitch_is_the_cameras_tilt_or_roll_by_where_the_head_looks(pan):
    lens = PinholeCamera((104, 80), (100.0, 100.0), (51.5, 39.5), 0.2, tilt_rad=0.0, offset_m=(0.1, 0.0))
    clean = replace(MATCH_SENSOR, noise_sigma=0.0)
    field, rng = load_field("four_legged_2007"), np.random.default_rng(0)
    robot = RobotState(0, 1, 0, Pose2(0.3, 0.2, 0.4), (0.0, 0.0), 0.0, pan)
    state = WorldState(0.0, (robot,), None, (0, 0), "play", 1, ())
    swayed = MatchCamera(field, lens, LIMITS, rng, sensor=clean).render(state, 0, Sway(0.05, 0.0, 0.01))
    up = 0.2 + 0.01 + 0.1 * math.sin(0.05)
    looking = {"tilt_rad": 0.05} if pan == 0.0 else {"roll_rad": -0.05}
    held = replace(lens, height_m=up, **looking)
    upright = MatchCamera(field, held, LIMITS, rng, sensor=clean).render(state, 0, UPRIGHT)
    assert np.abs(swayed.astype(int) - upright).max() <= 3
