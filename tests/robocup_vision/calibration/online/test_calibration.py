"""A camera followed while a robot plays: towards the truth, within its bounds, and not by what tells nothing."""

import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import Vision, load_camera
from robocup_vision.calibration.online import OnlineCalibration, OnlineSettings
from robocup_vision.calibration.online.parameter_filter import ParameterFilterSettings
from robocup_vision.calibration.online.settings import MirrorCalibrationSettings
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from sim2d.rendering.random_scenes import CONDITIONS, Condition, sample

# a frame a call, without times: each is used, from another place, and the camera may change by each
OFTEN = OnlineSettings(every_s=0.01, min_step_s=0.01, filter=ParameterFilterSettings(alike_s=1 / 30, moment_s=0.1))


@pytest.fixture(scope="module")
def walk(ssl_field, paper_camera):
    """Frames of a camera that is not quite the one given, robot all over the field."""
    return list(sample(ssl_field, paper_camera, CONDITIONS["miscalibrated"], seed=51, count=24, supersample=2))


@pytest.fixture(scope="module")
def true_camera(paper_camera):
    return CONDITIONS["miscalibrated"].true_camera(paper_camera)


@pytest.mark.slow
def test_it_goes_to_the_true_camera_and_poses_get_better(ssl_field, paper_camera, true_camera, walk):
    """Only this finds a followed calibration that does not make poses better, or follows a knock like a drift."""
    online = OnlineCalibration(ssl_field, paper_camera, settings=OFTEN)
    vision, by_file = Vision(ssl_field, paper_camera, online=online), Vision(ssl_field, paper_camera)
    errors, errors_by_file = [], []
    for number, one in enumerate([*walk, *walk]):
        view = vision.look(one.frame)
        errors.append(view.pose.pose.error_to(one.pose, symmetric=True)[0])
        if number < 12:
            errors_by_file.append(by_file.look(one.frame).pose.pose.error_to(one.pose, symmetric=True)[0])
    # fitting centre and tilt in each frame leaves this much
    assert np.median(errors_by_file) > 3e-3
    assert np.median(errors[-12:]) < 2.5e-3
    assert vision.camera is online.camera is view.camera is not paper_camera
    np.testing.assert_allclose(vision.camera.center_px, true_camera.center_px, atol=0.3)
    np.testing.assert_allclose(vision.camera.tilt_rad, true_camera.tilt_rad, atol=math.radians(0.15))
    state = online.state
    assert state.center_px == pytest.approx(vision.camera.center_px)
    assert state.tilt_rad == pytest.approx(vision.camera.tilt_rad)
    assert 0.4 < state.moved_px < 1.2
    assert state.steps > 2
    assert not state.at_bound
    assert str(state).startswith(f"centre moved by {state.moved_px:.2f} px, tilt by ")
    assert state.knocks == 0
    # the frames now come from elsewhere on the sensor: as if the camera had moved by two pixels
    for one in walk:
        vision.look(np.roll(one.frame, 2, axis=0))
    assert online.state.knocks == 1
    assert online.state.center_px[1] == pytest.approx(true_camera.center_px[1] + 2.0, abs=0.4)


def test_it_stops_at_its_bound_and_says_so(ssl_field, paper_camera, walk):
    off = dataclasses.replace(paper_camera, center_px=(125.5, 111.0))
    online = OnlineCalibration(
        ssl_field, off, settings=OnlineSettings(every_s=0.01, min_step_s=0.01, max_center_px=0.5, max_tilt_rad=1e-3)
    )
    vision = Vision(ssl_field, off, online=online)
    for one in walk[:6]:
        vision.look(one.frame)
    state = online.state
    assert state.at_bound
    assert str(state).endswith("at the bound: calibrate again")
    assert np.abs(np.subtract(vision.camera.center_px, off.center_px)).max() <= 0.5 + 1e-9
    assert np.abs(vision.camera.tilt_rad).max() <= 1e-3 + 1e-9


def test_the_same_frame_over_and_over_counts_once(ssl_field, paper_camera, walk):
    online = OnlineCalibration(ssl_field, paper_camera, settings=OFTEN)
    vision = Vision(ssl_field, paper_camera, online=online)
    vision.look(walk[0].frame)
    once = online.state
    for _ in range(12):
        vision.look(walk[0].frame)
    assert online.state.steps == once.steps <= 1
    assert online.state.knocks == 0
    # a frame says nothing new of what it showed before, and a little is forgotten
    assert min(np.subtract(online.state.center_std_px, once.center_std_px)) >= 0.0


def test_only_every_so_many_frames_count_and_only_located_ones(ssl_field, paper_camera, walk):
    view = Vision(ssl_field, paper_camera).look(walk[0].frame)
    lost = dataclasses.replace(view, pose=NotLocated("a test"))
    online = OnlineCalibration(ssl_field, paper_camera, settings=OnlineSettings(lost_s=10.0))
    for _ in range(30):
        assert online.follow(walk[0].frame, lost) is None
    assert online.state.center_std_px == (1.5, 1.5)
    online.follow(walk[0].frame, view)
    after = online.state
    assert max(after.center_std_px) < 1.5
    elsewhere = Vision(ssl_field, paper_camera).look(walk[1].frame)
    for _ in range(3):
        online.follow(walk[1].frame, elsewhere)
    assert online.state.center_std_px == after.center_std_px
    for _ in range(3):
        online.follow(walk[1].frame, elsewhere)
    assert max(online.state.center_std_px) < max(after.center_std_px)


def test_a_robot_that_is_not_located_tries_other_cameras_and_comes_back(ssl_field, paper_camera, walk):
    view = Vision(ssl_field, paper_camera).look(walk[0].frame)
    lost = dataclasses.replace(view, pose=NotLocated("a test"))
    online = OnlineCalibration(ssl_field, paper_camera)
    tried = [camera for _ in range(60 * 10) if (camera := online.follow(walk[0].frame, lost)) is not None]
    assert len({(camera.center_px, camera.floor_range) for camera in tried}) > 5
    assert min(np.hypot(*np.subtract(camera.center_px, paper_camera.center_px)) for camera in tried) == 0.0
    assert online.state.center_std_px == (1.5, 1.5)
    for _ in range(20):
        online.follow(walk[0].frame, view)
    assert max(online.state.center_std_px) < 1.0
    assert online.state.moved_px < 1.5


def _leaning_walk(field, camera):
    """Frames of a true camera whose body leans another way in each, by half a degree."""
    turns = np.random.default_rng(8).uniform(0.0, math.tau, 30)
    for number, turn in enumerate(turns.tolist()):
        lean = (math.radians(0.5) * math.cos(turn), math.radians(0.5) * math.sin(turn))
        yield from sample(field, camera, Condition(tilt_rad=lean), seed=52, count=0, indices=[number], supersample=2)


@pytest.mark.slow
def test_a_body_that_leans_is_no_knock_and_no_tilt(ssl_field, paper_camera):
    """Only this finds a body's leaning that is learnt as tilt, or counted as knocks."""
    online = OnlineCalibration(ssl_field, paper_camera, settings=OFTEN)
    upright = dataclasses.replace(OFTEN, mirror=MirrorCalibrationSettings(sway_std_rad=1e-6))
    stiff = OnlineCalibration(ssl_field, paper_camera, settings=upright)
    vision, believed_upright = Vision(ssl_field, paper_camera, online=online), Vision(ssl_field, paper_camera)
    for one in _leaning_walk(ssl_field, paper_camera):
        vision.look(one.frame)
        stiff.follow(one.frame, believed_upright.look(one.frame))
    assert online.state.knocks == 0
    assert online.state.tilted_rad < math.radians(0.15)
    # what is not known to lean is taken for knocks
    assert stiff.state.knocks > 2


def test_the_camera_may_be_written(ssl_field, paper_camera, walk, tmp_path):
    online = OnlineCalibration(ssl_field, paper_camera)
    online.follow(walk[0].frame, Vision(ssl_field, paper_camera).look(walk[0].frame))
    online.save(tmp_path / "camera.toml")
    again = load_camera(tmp_path / "camera.toml")
    assert online.state.steps == 1
    np.testing.assert_allclose(again.center_px, online.camera.center_px, atol=1e-6)
    radius = np.linspace(30.0, 100.0, 8)
    np.testing.assert_allclose(
        again.floor_range.inverse_range_per_m(radius), online.camera.floor_range.inverse_range_per_m(radius), rtol=1e-6
    )


def test_it_is_made_for_one_camera_of_known_tilt(ssl_field, paper_camera):
    online = OnlineCalibration(ssl_field, paper_camera)
    with pytest.raises(ArgumentError, match="online must be made for this very camera"):
        Vision(ssl_field, dataclasses.replace(paper_camera, center_px=(127.0, 109.0)), online=online)
    pinhole = PinholeCamera((416, 320), (384.0, 384.0), (207.5, 159.5), height_m=0.185)
    with pytest.raises(ArgumentError, match="online must be made for this very camera"):
        Vision(load_field("four_legged_2007"), pinhole, online=online)
    with pytest.raises(ArgumentError, match="needs its tilt_rad in the camera file"):
        OnlineCalibration(load_field("four_legged_2007"), pinhole)


@pytest.mark.parametrize("name", ["max_center_px", "max_tilt_rad", "every_s"])
def test_wrong_settings_are_named(name):
    with pytest.raises(ArgumentError, match=f"{name} must be positive"):
        OnlineSettings(**{name: 0.0})
