"""A camera followed while a robot plays: towards the truth, within its bounds, and not by what tells nothing."""

import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import Vision
from robocup_vision.calibration.online import OnlineCalibration, OnlineSettings
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from sim2d.rendering.random_scenes import CONDITIONS, sample


@pytest.fixture(scope="module")
def walk(ssl_field, paper_camera):
    """Frames of a camera that is not quite the one given, robot all over the field."""
    return list(sample(ssl_field, paper_camera, CONDITIONS["miscalibrated"], seed=51, count=24, supersample=2))


@pytest.fixture(scope="module")
def true_camera(paper_camera):
    return CONDITIONS["miscalibrated"].true_camera(paper_camera)


@pytest.mark.slow
def test_it_goes_to_the_true_camera_and_poses_get_better(ssl_field, paper_camera, true_camera, walk):
    online = OnlineCalibration(ssl_field, paper_camera, settings=OnlineSettings(every=1))
    vision = Vision(ssl_field, paper_camera, online=online)
    errors = []
    for one in [*walk, *walk]:
        view = vision.look(one.frame)
        errors.append(view.pose.pose.error_to(one.pose, symmetric=True)[0])
    assert np.median(errors[:6]) > 4e-3
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


@pytest.mark.slow
def test_it_stops_at_its_bound_and_says_so(ssl_field, paper_camera, walk):
    off = dataclasses.replace(paper_camera, center_px=(125.5, 111.0))
    online = OnlineCalibration(ssl_field, off, settings=OnlineSettings(every=1, max_center_px=0.5, max_tilt_rad=1e-3))
    vision = Vision(ssl_field, off, online=online)
    for one in walk[:16]:
        vision.look(one.frame)
    state = online.state
    assert state.at_bound
    assert str(state).endswith("at the bound: calibrate again")
    assert np.abs(np.subtract(vision.camera.center_px, off.center_px)).max() <= 0.5 + 1e-9
    assert np.abs(vision.camera.tilt_rad).max() <= 1e-3 + 1e-9


def test_the_same_frame_over_and_over_moves_nothing(ssl_field, paper_camera, walk):
    online = OnlineCalibration(ssl_field, paper_camera, settings=OnlineSettings(every=1))
    vision = Vision(ssl_field, paper_camera, online=online)
    for _ in range(12):
        vision.look(walk[0].frame)
    assert online.state.steps == 0
    assert vision.camera is paper_camera


def test_only_every_so_many_frames_count_and_only_located_ones(ssl_field, paper_camera, walk):
    online = OnlineCalibration(ssl_field, paper_camera, settings=OnlineSettings(every=3))
    view = Vision(ssl_field, paper_camera).look(walk[0].frame)
    lost = dataclasses.replace(view, pose=NotLocated("a test"))
    for _ in range(30):
        assert online.follow(walk[0].frame, lost) is None
    for i, one in enumerate(walk[:12]):
        vision = Vision(ssl_field, paper_camera)
        online.follow(one.frame, vision.look(one.frame))
        assert len(online._seen) <= (i + 1) // 3
    assert online.state.steps == 0


def test_colours_and_place_are_kept_when_the_camera_changes(ssl_field, paper_camera, walk):
    vision = Vision(ssl_field, paper_camera)
    vision.look(walk[0].frame)
    pipeline = vision._pipeline
    other = pipeline.with_camera(dataclasses.replace(paper_camera, center_px=(128.0, 109.0)))
    assert other.colors is pipeline.colors
    assert other.camera.center_px == (128.0, 109.0)
    assert other.grid.directions == pipeline.grid.directions


def test_it_is_made_for_one_mirror_camera(ssl_field, paper_camera):
    online = OnlineCalibration(ssl_field, paper_camera)
    with pytest.raises(ArgumentError, match="online must be made for this very camera"):
        Vision(ssl_field, dataclasses.replace(paper_camera, center_px=(127.0, 109.0)), online=online)
    pinhole = PinholeCamera((416, 320), (384.0, 384.0), (207.5, 159.5), height_m=0.185)
    with pytest.raises(ArgumentError, match="must be a mirror camera"):
        Vision(load_field("four_legged_2007"), pinhole, online=online)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_center_px": 0.0}, "max_center_px must be positive"),
        ({"max_tilt_rad": -1.0}, "max_tilt_rad must be positive"),
        ({"every": 0}, "every must be at least 1"),
        ({"window": 5}, "window must be at least 6"),
    ],
)
def test_wrong_settings_are_named(wrong, message):
    with pytest.raises(ArgumentError, match=message):
        OnlineSettings(**wrong)
