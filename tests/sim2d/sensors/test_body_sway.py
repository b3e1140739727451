"""Bodies sway as they walk, brake and kick, and the camera goes along."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.sensors.body_sway import LEGS_SWAY, UPRIGHT, WHEELS_SWAY, BodySway, Sway
from sim2d.sensors.match_camera import MATCH_SENSOR, MatchCamera
from sim2d.world.state import RobotState, WorldState

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


def test_the_same_seed_sways_alike():
    assert (sways(LEGS_SWAY, [0.3] * 50) == sways(LEGS_SWAY, [0.3] * 50)).all()
    assert (sways(LEGS_SWAY, [0.3] * 50) != sways(LEGS_SWAY, [0.3] * 50, seed=2)).any()


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
