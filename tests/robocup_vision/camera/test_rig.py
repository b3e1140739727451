"""Rigs and rig.toml: what is no rig is told in one line."""

import math
from dataclasses import replace

import pytest

from field_models.errors import ArgumentError, FileError
from robocup_vision.camera import PinholeCamera, Rig, load_camera, load_camera_or_rig, load_rig, save_camera, save_rig
from sim2d.rendering.cameras import sekimori_camera

LEFT = PinholeCamera((64, 48), (60.0, 60.0), (31.5, 23.5), 0.4, offset_m=(0.1, 0.05), pan_rad=0.3, tilt_rad=-0.3)
RIGHT = replace(LEFT, offset_m=(0.1, -0.05), pan_rad=-0.3)


@pytest.fixture
def folder(tmp_path):
    save_camera(LEFT, tmp_path / "left.toml")
    save_camera(RIGHT, tmp_path / "right.toml")
    save_camera(sekimori_camera(), tmp_path / "mirror.toml")
    save_camera(replace(LEFT, pan_rad=None), tmp_path / "head.toml")
    save_camera(LEFT, tmp_path / "copy.toml")
    (tmp_path / "other").mkdir()
    save_camera(RIGHT, tmp_path / "other" / "left.toml")
    return tmp_path


def write(folder, text):
    path = folder / "rig.toml"
    path.write_text("format = 1\n" + text, encoding="utf-8")
    return path


def test_cameras_come_in_the_order_of_the_file_with_their_names_and_latencies(folder):
    rig = load_rig(write(folder, 'cameras = ["right.toml", "left.toml"]\nlatency_s = [0.0, 0.02]\n'))
    assert [camera.pan_rad for camera in rig.cameras] == [-0.3, 0.3]
    assert (rig.names, rig.latency_s, len(rig)) == (("right", "left"), (0.0, 0.02), 2)


def test_a_rig_is_written_and_read_back(folder):
    rig = load_rig(write(folder, 'cameras = ["right.toml", "left.toml"]\nlatency_s = [0.0, 0.02]\n'))
    (folder / "again").mkdir()
    save_rig(rig, folder / "again" / "rig.toml")
    again = load_rig(folder / "again" / "rig.toml")
    assert (again.names, again.latency_s) == (rig.names, rig.latency_s)
    for one, other in zip(again.cameras, rig.cameras, strict=True):
        assert (one.pan_rad, one.offset_m, one.focal_px) == (other.pan_rad, other.offset_m, other.focal_px)
    with pytest.raises(FileError, match="cannot be written"):
        save_rig(rig, folder / "gone" / "rig.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cameras = []", "rig.toml: key 'cameras': names no camera"),
        ('cameras = ["left.toml", "gone.toml"]', "gone.toml: cannot be read"),
        ('cameras = ["left.toml", "left.toml"]', "names a camera file twice"),
        ('cameras = ["left.toml", "other/left.toml"]', "has camera files of one name"),
        ('cameras = ["left.toml", "copy.toml"]', "left and copy of a rig have the same offset_m"),
        ('cameras = ["left.toml", "mirror.toml"]', "mirror of a rig must be a pinhole or fisheye camera"),
        ('cameras = ["left.toml", "head.toml"]', "head of a rig needs a pan_rad"),
        ('cameras = ["left.toml", "right.toml"]\nlatency_s = [0.1]', "one entry for each of the 2 cameras"),
        ('cameras = ["left.toml", "right.toml"]\nlatency_s = [0.0, 12.0]', "latency_s of right must be from 0 to 1 s"),
        ('cameras = ["left.toml"]\ncolour = 1', "key 'colour': is unknown"),
    ],
)
def test_what_is_no_rig_is_told(folder, text, message):
    with pytest.raises(FileError) as caught:
        load_rig(write(folder, text))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_camera_and_rig_files_are_told_apart(folder):
    path = write(folder, 'cameras = ["left.toml"]')
    assert isinstance(load_camera_or_rig(path), Rig)
    assert isinstance(load_camera_or_rig(folder / "left.toml"), PinholeCamera)
    with pytest.raises(FileError, match="is a rig file, must be a camera file"):
        load_camera(path)
    with pytest.raises(FileError, match="is a camera file, must be a rig file"):
        load_rig(folder / "left.toml")


def test_no_cameras_are_no_rig():
    with pytest.raises(ArgumentError, match="at least one camera"):
        Rig(())
    with pytest.raises(ArgumentError, match="one for each of its 2 cameras"):
        Rig((LEFT, RIGHT), latency_s=(0.1, 0.1, 0.1))
    assert math.isclose(sum(Rig((LEFT, RIGHT)).latency_s), 0.0)
