"""The whole calibration on rendered frames: near the truth from any start, and a reason where there is none."""

import dataclasses

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, FrameError
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.omni.calibrate import OmniCalibration, calibrate_omni, guessed_cameras
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.camera import OmniCamera, Table, Tangent
from robocup_vision.geometry import Pose2


class Damaged(list):
    """Frames of which the second cannot be read."""

    def __getitem__(self, index):
        if index == 1:
            raise FrameError("b.png: is empty")
        return super().__getitem__(index)


@pytest.mark.slow
def test_a_rough_start_leads_to_the_true_camera(
    ssl_field, off_frames, off_samples, rough_camera, true_camera, floor_error_m
):
    """Only this finds a fit from a rough start that ends elsewhere, or useless frames that end it or go unsaid."""
    dark, small = np.zeros_like(off_frames[0]), np.ascontiguousarray(off_frames[0][:, :200])
    frames = Damaged([off_frames[0], off_frames[0], dark, small, *off_frames[1:]])
    result = calibrate_omni(ssl_field, frames, rough_camera, names=["a", "b.png", *"cdefghi"])
    assert isinstance(result, OmniCalibration)
    assert floor_error_m(result.camera, true_camera) < 2e-3
    np.testing.assert_allclose(result.camera.center_px, true_camera.center_px, atol=0.5)
    np.testing.assert_allclose(result.camera.tilt_rad, true_camera.tilt_rad, atol=5e-3)
    assert result.camera.usable_radius_px == true_camera.usable_radius_px
    assert [frame.name for frame in result.frames] == [*"aefghi"]
    errors = [f.pose.error_to(s.pose, symmetric=True)[0] for f, s in zip(result.frames, off_samples, strict=True)]
    assert max(errors) < 0.02
    assert [note for note in result.notes if note.startswith("left out")] == [
        "left out b.png: is empty",
        "left out c: too little of the floor's edge or of white lines in view",
        "left out d: frame must be uint8 (220, 256, 3) as the camera file says, got uint8 (220, 200, 3)",
    ]
    assert set(result.std) == {"center_u_px", "center_v_px", "tilt_x_rad", "tilt_y_rad", "scale", "horizon"}
    assert 0 < result.std["center_u_px"] < 0.5
    assert result.choices[0].curve == "hyperboloid"
    assert result.choices[0].held_out_px < 0.2
    assert any("hard to separate" in note for note in result.notes)
    residual = np.concatenate([frame.boundary_residual_px for frame in result.frames])
    assert np.median(np.abs(residual)) < 0.2
    for frame in result.frames:
        assert len(frame.line_px) == len(frame.line_residual_px)


@pytest.mark.slow
def test_no_start_at_all_leads_there_too(ssl_field, off_frames, true_camera, floor_error_m):
    """Only this finds a search without a start that misses the camera, or its usable rim."""
    result = calibrate_omni(ssl_field, off_frames[:4])
    assert isinstance(result, OmniCalibration)
    assert floor_error_m(result.camera, true_camera) < 2e-3
    inner, outer = result.camera.usable_radius_px
    assert 24 < inner < 32
    assert 90 < outer < 112
    assert any("assumed" in note for note in result.notes)


@pytest.mark.slow
def test_a_carpet_is_calibrated_by_its_lines(mirror_camera, paint_field, floor_error_m):
    """Only this finds a fit that needs walls."""
    field = load_field("msl_6x4")
    truth = dataclasses.replace(mirror_camera, center_px=(163.0, 116.0))
    rng = np.random.default_rng(5)
    poses = [Pose2(0.2, -0.1, 0.3), Pose2(-1.2, 0.6, 2.0), Pose2(1.4, -0.8, -1.0)]
    frames = [paint_field(truth, field, pose, noise=3.0, rng=rng) for pose in poses]
    start = dataclasses.replace(
        truth, center_px=(159.5, 119.5), floor_range=Tangent(0.8 * 2.1456, 1.2 * 0.0114), usable_radius_px=(20.0, 105.0)
    )
    result = calibrate_omni(field, frames, start)
    assert isinstance(result, OmniCalibration)
    assert floor_error_m(result.camera, truth) < 5e-3
    assert [frame.name for frame in result.frames] == ["frame 0", "frame 1", "frame 2"]
    assert all(len(frame.boundary_px) == 0 for frame in result.frames)


def test_images_without_a_field_are_refused(ssl_field, rough_camera):
    rng = np.random.default_rng(6)
    dark = np.zeros((220, 256, 3), dtype=np.uint8)
    refused = calibrate_omni(ssl_field, [dark, dark], rough_camera)
    assert isinstance(refused, NotCalibrated)
    assert not refused
    assert refused.reason == "no frame shows enough of the floor's edge or of white lines"
    assert len(refused.notes) == 2
    noise = rng.integers(0, 255, (3, 220, 256, 3), dtype=np.uint8)
    assert isinstance(calibrate_omni(ssl_field, list(noise), rough_camera), NotCalibrated)


@pytest.mark.slow
def test_images_of_another_field_are_refused(off_frames, rough_camera):
    """Only this finds a wrong field to which a fit bends the camera."""
    refused = calibrate_omni(load_field("ssl_division_b"), off_frames[:3], rough_camera)
    assert isinstance(refused, NotCalibrated)
    assert refused.reason


def test_what_is_no_use_at_all_raises(ssl_field, off_frames, paper_camera):
    with pytest.raises(ArgumentError, match="at least one frame is needed"):
        calibrate_omni(ssl_field, [], paper_camera)
    with pytest.raises(ArgumentError, match="max_frames must be at least 1, got 0"):
        calibrate_omni(ssl_field, off_frames, paper_camera, max_frames=0)
    bare = dataclasses.replace(load_field("msl_6x4"), lines=np.empty((0, 4)), arcs=np.empty((0, 5)))
    with pytest.raises(ArgumentError, match="neither walls nor lines"):
        calibrate_omni(bare, off_frames, paper_camera)
    with pytest.raises(FrameError, match=r"must be uint8 \(220, 256, 3\) .* got uint8 \(220, 200, 3\)"):
        calibrate_omni(ssl_field, [np.zeros((220, 200, 3), dtype=np.uint8)], paper_camera)


def test_guessed_cameras_know_their_field(ssl_field):
    assert len(guessed_cameras(ssl_field, (256, 220))) == 1
    field = load_field("msl_6x4")
    cameras = guessed_cameras(field, (640, 480))
    assert len(cameras) == 4
    for camera in cameras:
        assert isinstance(camera, OmniCamera)
        assert camera.center_px == (319.5, 239.5)
        q = camera.floor_range.inverse_range_per_m(camera.usable_radius_px[1])
        assert q > 0
    half_way_m = [1 / float(c.floor_range.inverse_range_per_m(c.usable_radius_px[1] / 2)) for c in cameras]
    np.testing.assert_allclose(np.array(half_way_m) / field.length_m, [0.09, 0.15, 0.25, 0.4], rtol=0.05)


@pytest.fixture(scope="module")
def carpet_camera(mirror_camera):
    return dataclasses.replace(mirror_camera, center_px=(163.0, 116.0))


def calibrated_on_carpet(paint_field, camera, pose, start=None, settings=OmniCalibrationSettings()):
    field = load_field("msl_6x4")
    frame = paint_field(camera, field, pose, noise=3.0, rng=np.random.default_rng(12))
    return calibrate_omni(field, [frame], start, settings=settings)


@pytest.mark.slow
def test_where_a_start_leads_to_no_answer_one_is_found_without_its_curve(carpet_camera, paint_field, floor_error_m):
    """Only this finds one image without a start's curve that is refused or wrong, or costs the start's mounting."""
    true = dataclasses.replace(carpet_camera, mirrored=True, heading_rad=0.4, offset_m=(0.02, -0.01))
    # what a start must show is asked for in vain
    settings = dataclasses.replace(OmniCalibrationSettings(), min_started_features=30, max_height_radii=30.0)
    result = calibrated_on_carpet(paint_field, true, Pose2(0.2, -0.1, 0.3), start=true, settings=settings)
    assert isinstance(result, OmniCalibration)
    assert floor_error_m(result.camera, true) < 0.02
    # a camera without a tilt gets next to none, though it may have one
    assert result.choices[0].tilted
    assert np.hypot(*result.camera.tilt_rad) < 0.01
    assert "found without the start's curve: by it, one image of so few lines" in result.notes[0]
    camera = result.camera
    assert (camera.mirrored, camera.heading_rad, camera.offset_m) == (True, 0.4, (0.02, -0.01))
    assert any("mirroring of the camera are taken from the start" in note for note in result.notes)


@pytest.mark.slow
def test_a_table_with_a_kink_is_mended(carpet_camera, paint_field, floor_error_m):
    """Only this finds a table of ranges that is replaced by a smooth curve instead of mended."""
    radius = np.array([18.0, 28.0, 38.0, 48.0, 58.0, 68.0, 73.0, 78.0, 83.0, 88.0, 93.0, 98.0, 103.0, 108.0, 113.0])
    kinked = Table(radius, 0.25 + 0.22 * np.arange(len(radius)))
    true = dataclasses.replace(carpet_camera, floor_range=kinked, tilt_rad=(0.004, -0.003), viewpoint_height_m=0.6)
    rough = Table(radius + np.sin(radius / 20.0), 1.05 * kinked.table_range_m)
    start = dataclasses.replace(true, floor_range=rough, center_px=(160.0, 118.0), tilt_rad=(0.0, 0.0))
    result = calibrated_on_carpet(paint_field, true, Pose2(0.2, -0.1, 0.3), start)
    assert isinstance(result, OmniCalibration)
    assert floor_error_m(start, true) > 0.03
    assert floor_error_m(result.camera, true) < 0.015
    assert result.choices[0].curve == "own"
    assert [choice.curve for choice in result.choices].count("own") == 1
    assert len(result.choices) == 4


@pytest.mark.slow
def test_an_image_whose_camera_does_not_show_it_again_is_refused(carpet_camera, paint_field):
    """Only this finds a camera by one image that is taken though its own image is not located by it."""
    settings = dataclasses.replace(OmniCalibrationSettings(), max_confirmed_radii=0.0)
    refused = calibrated_on_carpet(paint_field, carpet_camera, Pose2(0.2, -0.1, 0.3), carpet_camera, settings)
    assert isinstance(refused, NotCalibrated)
    assert "does not find itself" in refused.reason
