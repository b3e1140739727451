"""A rig's mountings followed while its robot drives: towards the truth, as sure as it says, and not by what leans."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rig_pictures import CAMERAS as CERTAIN
from rig_pictures import FIELD, render

from field_models.errors import ArgumentError
from robocup_vision import PoseEstimate, Rig, Vision
from robocup_vision.calibration.online import OnlineCalibration
from robocup_vision.camera import load_rig
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.geometry import Pose2

# cameras whose files own to it that they may be turned: their measurements then agree before they are refined
CAMERAS = tuple(replace(camera, pan_std_rad=0.01) for camera in CERTAIN)
RIG = Rig(CAMERAS)
POSES = [
    Pose2(x, y, math.radians(turn))
    for x, y, turn in [(0.5, 0.4, 20), (-0.8, 0.3, 150), (0.2, -0.8, -30), (1.2, 0.6, -20), (-1.4, -0.5, 200)]
]
NEAR = np.diag([0.05, 0.05, 0.03]) ** 2


def turned(degrees):
    """Return the rig whose cameras' pan and tilt are off by so much."""
    return replace(
        RIG,
        cameras=tuple(
            replace(one, pan_rad=one.pan_rad + math.radians(pan), tilt_rad=one.tilt_rad + math.radians(tilt))
            for one, (pan, tilt) in zip(CAMERAS, degrees, strict=True)
        ),
    )


def leaning(rig, nose_up_rad, left_up_rad):
    """Return the cameras of a body that leans about its middle on the floor."""
    lean = camera_rotation(0.0, nose_up_rad, 0.0) @ camera_rotation(0.0, 0.0, left_up_rad)
    cameras = []
    for one in rig.cameras:
        turn = lean @ one.camera_to_robot
        x, y, height = lean @ (*one.offset_m, one.height_m)
        angles = math.atan2(turn[1, 0], turn[0, 0]), math.asin(turn[2, 0]), math.atan2(turn[2, 1], turn[2, 2])
        cameras.append(replace(one.with_orientation(*angles), offset_m=(x, y), height_m=height))
    return tuple(cameras)


def drive(vision, shown, poses=POSES, given=(True,) * 4):
    """Look from some places through the cameras of each look, of which those that are given give frames."""
    views = []
    for number, (pose, cameras) in enumerate(zip(poses, shown, strict=True)):
        frames = render(pose, number, cameras=cameras)
        frames = tuple(frame if is_given else None for frame, is_given in zip(frames, given, strict=True))
        near = PoseEstimate(pose.compose(Pose2(0.03, -0.02, 0.02)), NEAR, 1.0, 0.0)
        views.append(vision.look(frames, t_s=0.5 * number, prior=near))
    return views


def off_by(online, true):
    """Return how far the estimate is off in standard deviations, all parameters together, and each."""
    off = online.mean - online.parameters_of(true)
    return off @ np.linalg.solve(online.covariance, off) / len(off), np.abs(off) / np.sqrt(np.diag(online.covariance))


# frames of four cameras are rendered and looked at
@pytest.mark.slow
def test_it_goes_to_the_true_rig_and_is_as_sure_as_it_says():
    """Only this finds mountings that drift elsewhere, or are surer than they are right."""
    true = turned(((0, 2.0), (0, 0), (-1.8, 1.0), (0, 0)))
    online = OnlineCalibration(FIELD, RIG)
    before_px = online.shift_px(true)
    vision = Vision(FIELD, RIG, online=online)
    assert all(view.pose for view in drive(vision, [true.cameras] * len(POSES)))
    together, each = off_by(online, true)
    assert together < 2.0
    assert each.max() < 3.0
    assert vision.rig is online.camera
    assert online.shift_px(true) < 0.5 * before_px
    # what all pans have in common is the body's heading
    pans = np.array([one.pan_rad - other.pan_rad for one, other in zip(vision.rig.cameras, true.cameras, strict=True)])
    assert np.abs(pans - pans.mean()).max() < math.radians(0.3)
    for mounting, camera in zip(online.mountings, vision.rig.cameras, strict=True):
        assert (mounting.pan_rad, mounting.tilt_rad) == (camera.pan_rad, camera.tilt_rad)
        assert mounting.pan_std_rad < math.radians(0.3)
        assert mounting.tilt_std_rad < math.radians(0.4)


# frames of four cameras are rendered and looked at
@pytest.mark.slow
def test_a_body_that_leans_leaves_the_mountings_where_they_are():
    """Only this finds a body's leaning that is learnt as a mounting."""
    online = OnlineCalibration(FIELD, RIG)
    leans = [(1.0, -0.5), (-0.8, 1.0), (0.3, 1.1), (-1.0, -0.6), (0.6, -1.0)]
    drive(Vision(FIELD, RIG, online=online), [leaning(RIG, *map(math.radians, lean)) for lean in leans])
    together, each = off_by(online, RIG)
    assert together < 2.0
    assert each.max() < 3.0
    pans = [one.pan_rad - other.pan_rad for one, other in zip(online.mountings, CAMERAS, strict=True)]
    assert np.ptp(pans) < math.radians(0.3)


def test_a_camera_that_gives_no_frame_keeps_its_mounting():
    true = turned(((0, 0), (1.5, 0), (0, 0), (0, 0)))
    online = OnlineCalibration(FIELD, RIG)
    drive(Vision(FIELD, RIG, online=online), [true.cameras], POSES[:1], given=(True, True, False, False))
    moved = (online.mean - online.parameters_of(RIG)).reshape(4, 4)
    assert np.abs(moved[2:]).max() < 1e-9
    assert moved[1, 3] - moved[0, 3] == pytest.approx(math.radians(1.5), abs=math.radians(0.7))


def test_a_look_without_a_pose_tells_nothing():
    online = OnlineCalibration(FIELD, RIG)
    vision = Vision(FIELD, RIG)
    black = tuple(np.zeros((one.size_px[1], one.size_px[0], 3), np.uint8) for one in CAMERAS)
    assert online.follow(black, vision.look(black, t_s=0.0)) is None
    np.testing.assert_array_equal(online.mean, online.parameters_of(RIG))


def test_the_rig_may_be_written(tmp_path):
    online = OnlineCalibration(FIELD, Rig(CAMERAS, (0.0, 0.01, 0.0, 0.02), ("ahead", "left", "behind", "right")))
    online.save(tmp_path / "rig.toml")
    again = load_rig(tmp_path / "rig.toml")
    assert (again.names, again.latency_s) == (online.camera.names, online.camera.latency_s)
    np.testing.assert_allclose(online.parameters_of(again), online.mean, atol=1e-9)


def test_what_does_not_fit_is_told():
    online = OnlineCalibration(FIELD, RIG)
    with pytest.raises(ArgumentError, match="see its mountings"):
        _ = online.state
    with pytest.raises(ArgumentError, match="see its state"):
        _ = OnlineCalibration(FIELD, CAMERAS[0]).mountings
    with pytest.raises(ArgumentError, match="online must be made for this very Rig"):
        Vision(FIELD, CAMERAS, online=online)
    with pytest.raises(ArgumentError, match="mask of a rig must be a sequence of 4"):
        OnlineCalibration(FIELD, RIG, np.zeros((200, 264), np.uint8))
    with pytest.raises(ArgumentError, match="needs its tilt_rad"):
        OnlineCalibration(FIELD, Rig((CAMERAS[0], CAMERAS[1].with_orientation(1.0, None, None))))
