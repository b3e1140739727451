"""Tests of how a player tells how fast its camera turned while a frame was read."""

from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import RollingShutter
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter
from sim2d.match.setups import camera_for
from sim2d.players.straight_frames import StraightFrames

CAMERA = replace(camera_for(load_field("four_legged_2007")), readout_s=0.02)
FRAME = np.random.default_rng(1).integers(0, 256, (*CAMERA.size_px[::-1], 3), dtype=np.uint8)
STEP_S = 1 / 30


def second_frame(pan_rad, body_rad, passed_s=STEP_S):
    """Return what a player makes of its second frame: head and body have turned by so much since the first."""
    odometry = PoseFilter()
    odometry.predict(Pose2(0.0, 0.0, 0.0), 0.0)
    straight = StraightFrames(CAMERA, odometry)
    assert straight.straighten(FRAME, 0.0, 0.1) is FRAME  # nothing is known of the turn yet
    odometry.predict(Pose2(0.0, 0.0, body_rad), passed_s)
    return straight.straighten(FRAME, passed_s, 0.1 + pan_rad)


@pytest.mark.parametrize(("pan_rad", "body_rad"), [(0.2, 0.0), (0.0, 0.2), (0.25, -0.05)])
def test_head_and_body_turn_together(pan_rad, body_rad):
    expected = RollingShutter(CAMERA).straighten(FRAME, 0.2 / STEP_S)
    # to the last grey level: rates differ by rounding
    assert np.abs(second_frame(pan_rad, body_rad).astype(int) - expected).max() <= 1


@pytest.mark.parametrize(("pan_rad", "body_rad", "passed_s"), [(0.2, -0.2, STEP_S), (0.2, 0.0, 0.3), (0.2, 0.0, 0.0)])
def test_a_frame_stays_as_it_is_where_nothing_turned_or_nobody_knows(pan_rad, body_rad, passed_s):
    assert second_frame(pan_rad, body_rad, passed_s) is FRAME
