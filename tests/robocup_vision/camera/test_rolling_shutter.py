"""Tests of straightening what a rolling shutter reads while its camera turns."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import RollingShutter, camera_rotation, load_camera, save_camera
from sim2d.match.setups import camera_for
from sim2d.rendering.fast.forward import EyeInField, ForwardFrames
from sim2d.rendering.scene import Scene
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

FIELD = load_field("four_legged_2007")
READOUT_S = 0.02
CAMERA = replace(camera_for(FIELD), readout_s=READOUT_S)
EYE = EyeInField(-1.0, 0.3, CAMERA.height_m, 0.2, CAMERA.tilt_rad, 0.0)


@pytest.fixture(scope="module")
def draw():
    """Return a function that draws a frame without noise, of an eye that turns at some rate, rad/s."""
    frames = ForwardFrames(Scene(FIELD, light=MATCH_LIGHT, room=MATCH_ROOM), CAMERA, MATCH_SENSOR)

    def frame(turn_rps):
        up = camera_rotation(EYE.heading_rad, EYE.tilt_rad, 0.0).T @ [0.0, 0.0, turn_rps * READOUT_S]
        return np.array(frames.draw((), None, EYE._replace(turn_rad=tuple(up.tolist()))))

    return frame


def differ(one, other):
    """Mean difference, counts, without the margin that a shift uncovers."""
    return float(np.abs(one[:, 20:-20].astype(int) - other[:, 20:-20]).mean())


@pytest.mark.parametrize("turn_rps", [6.0, -6.0, 2.0])
def test_a_leaning_frame_becomes_the_one_of_a_camera_that_stands(draw, turn_rps):
    still, leaning = draw(0.0), draw(turn_rps)
    straight = RollingShutter(CAMERA).straighten(leaning, turn_rps)
    assert differ(straight, still) < 0.35 * differ(leaning, still)
    # the wrong way it leans twice as far
    assert differ(RollingShutter(CAMERA).straighten(leaning, -turn_rps), still) > 1.3 * differ(leaning, still)


@pytest.mark.parametrize("camera", [CAMERA, replace(CAMERA, tilt_rad=None)])
def test_what_turns_too_little_stays_as_it_is(draw, camera):
    frame = draw(0.0)
    shutter = RollingShutter(camera)
    for turn_rps in (0.0, 0.03, math.nan):
        assert shutter.straighten(frame, turn_rps) is frame
    assert RollingShutter(replace(camera, readout_s=0.0)).straighten(frame, 6.0) is frame


def test_a_camera_file_keeps_the_readout(tmp_path):
    save_camera(CAMERA, tmp_path / "camera.toml")
    assert load_camera(tmp_path / "camera.toml").readout_s == READOUT_S
    save_camera(replace(CAMERA, readout_s=0.0), tmp_path / "plain.toml")
    assert "readout_s" not in (tmp_path / "plain.toml").read_text()
    assert load_camera(tmp_path / "plain.toml").readout_s == 0.0
