"""A pinhole camera followed while a robot looks around: towards the truth, as sure as it says, and not by nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision import Pose2, PoseEstimate, Vision
from robocup_vision.calibration.online import OnlineCalibration, OnlineSettings
from robocup_vision.calibration.online.evidence import Belief
from robocup_vision.calibration.online.pinhole import PinholeEvidence
from robocup_vision.estimates import NotLocated
from sim2d.match.arena import Arena
from sim2d.match.disturbances import NONE
from sim2d.match.setups import camera_for
from sim2d.sensors.true_cameras import CameraErrorSettings

FIELD = load_field("four_legged_2007")
CAMERA = camera_for(FIELD)
NEAR = np.diag([0.02, 0.02, 0.02]) ** 2
POSES = [
    Pose2(x, y, math.radians(turn))
    for x, y, turn in [
        (0.5, 0.4, 20.0),
        (-0.8, 0.3, 150.0),
        (0.2, -0.8, -30.0),
        (1.2, 0.6, -20.0),
        (-1.4, -0.5, 200.0),
        (0.9, -0.2, 70.0),
        (-0.3, 0.9, 230.0),
        (0.0, 0.0, 0.0),
    ]
]


@pytest.fixture(scope="module")
def looks():
    """Frames by a true camera unlike the file's, with where the robot was."""
    arena = Arena(FIELD, 1, 3, camera=CAMERA, disturbances=replace(NONE, camera=CameraErrorSettings()))
    arena.world.place(1, Pose2(2.4, 1.5, 0.0))
    frames = []
    for pose in POSES:
        arena.world.place(0, pose)
        frames.append((arena.senses()[0].frame, pose))
    return arena.true_camera(0), frames


def look_around(vision, frames, start_s=0.0):
    views = []
    for index, (frame, pose) in enumerate(frames):
        near = PoseEstimate(pose, NEAR, 1.0, 0.0)
        views.append(vision.look(frame, start_s + 0.5 * index, prior=near, pan_rad=0.0))
    return views


def test_it_goes_to_the_true_camera_and_is_as_sure_as_it_says(looks):
    true, frames = looks
    online = OnlineCalibration(FIELD, CAMERA)
    before = online.shift_px(true)
    vision = Vision(FIELD, CAMERA, online=online)
    views = look_around(vision, frames)
    assert all(view.pose for view in views)
    assert before > 4.0
    assert online.shift_px(true) < 0.5 * before
    off = online.parameters_of(true) - online.mean
    assert off @ np.linalg.solve(online.covariance, off) / len(off) < 2.0
    assert vision.camera is online.camera is not CAMERA
    state = online.state
    assert 2 <= state.steps <= len(frames)
    assert state.knocks == 0
    assert not state.at_bound
    assert state.center_px == vision.camera.center_px
    assert state.tilt_rad == (vision.camera.tilt_rad, vision.camera.roll_rad)
    assert state.scale == pytest.approx(vision.camera.focal_px[0] / CAMERA.focal_px[0])
    assert max(state.center_std_px) < 3.0
    assert state.scale_std < 0.01


def test_colours_are_kept_when_the_camera_changes(looks):
    _, frames = looks
    vision = Vision(FIELD, CAMERA, online=OnlineCalibration(FIELD, CAMERA))
    vision.look(frames[0][0])
    colors = vision.colors
    look_around(vision, frames[:1])
    assert vision.camera is not CAMERA
    assert vision.colors is colors is not None


def test_masked_pixels_and_frames_without_pose_tell_nothing(looks):
    _, frames = looks
    view = look_around(Vision(FIELD, CAMERA), frames[:1])[0]
    blind = OnlineCalibration(FIELD, CAMERA, np.full((160, 208), 255, dtype=np.uint8))
    assert blind.follow(frames[0][0], view) is None
    lost = OnlineCalibration(FIELD, CAMERA)
    for t_s in range(5):
        assert lost.follow(frames[0][0], replace(view, t_s=float(t_s), pose=NotLocated("a test"))) is None
    for online in (blind, lost):
        np.testing.assert_array_equal(online.mean, online.parameters_of(CAMERA))
        assert online.state.steps == 0


def test_a_frame_while_the_camera_turns_tells_less(looks):
    _, frames = looks
    view = look_around(Vision(FIELD, CAMERA), frames[:1])[0]
    still, turning = (PinholeEvidence(FIELD, CAMERA, None, OnlineSettings()) for _ in range(2))
    turning.watch(replace(view, t_s=0.0, camera=replace(view.camera, pan_rad=0.1)))
    turning.watch(replace(view, t_s=0.033))
    seen = [
        one.of(frames[0][0], view, Belief(one.start, np.diag(one.std**2), one.start)).reduced()[0]
        for one in (still, turning)
    ]
    assert np.trace(seen[1] @ np.diag(still.std**2)) < 0.5 * np.trace(seen[0] @ np.diag(still.std**2))
