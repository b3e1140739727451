"""`robocup-vision calibrate omni` from its arguments to its files and exit status."""

import cv2
import numpy as np
import pytest

from robocup_vision.camera import load_camera, save_camera
from robocup_vision.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory, off_frames, rough_camera):
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "images").mkdir()
    for i, frame in enumerate(off_frames):
        cv2.imwrite(str(folder / "images" / f"{i}.png"), frame)
    save_camera(rough_camera, folder / "start.toml")
    return folder


@pytest.mark.slow
def test_camera_file_overlays_and_figures_are_written(folder, capsys, true_camera, floor_error_m):
    """Only this finds a figure or a picture that the command leaves out."""
    out = folder / "camera.toml"
    arguments = ["calibrate", "omni", "--field", "ssl_2001", str(folder / "images"), "--out", str(out)]
    assert main([*arguments, "--start", str(folder / "start.toml")]) == 0
    assert floor_error_m(load_camera(out), true_camera) < 3e-3
    pictures = sorted(path.name for path in (folder / "camera_overlays").iterdir())
    assert pictures == [f"{i}.png" for i in range(6)]
    printed = capsys.readouterr().out
    for words in (
        "calibrated by 6 of 6 images",
        "center ",
        "tilt ",
        "curve        hyperboloid: A ",
        "floor's edge",
        "white lines",
        "held-out points",
        "hard to separate",
        "camera_overlays",
    ):
        assert words in printed


@pytest.mark.slow
def test_only_so_many_frames_and_a_mask(folder, capsys):
    """Only this finds a number of frames or a mask that the command does not heed."""
    mask = np.zeros((220, 256, 3), dtype=np.uint8)
    mask[:, :20] = 255
    cv2.imwrite(str(folder / "mask.png"), mask)
    arguments = ["calibrate", "omni", "--field", "ssl_2001", str(folder / "images"), "--out", str(folder / "few.toml")]
    arguments += ["--start", str(folder / "start.toml"), "--frames", "2", "--mask", str(folder / "mask.png")]
    assert main(arguments) == 0
    assert "calibrated by 2 of 6 images" in capsys.readouterr().out


def test_a_refusal_is_one_line_and_writes_nothing(folder, capsys, tmp_path):
    cv2.imwrite(str(tmp_path / "dark.png"), np.zeros((220, 256, 3), dtype=np.uint8))
    out = tmp_path / "camera.toml"
    assert main(["calibrate", "omni", "--field", "ssl_2001", str(tmp_path / "dark.png"), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.err == (
        "robocup-vision calibrate omni: not calibrated: no frame shows enough of the floor's edge or of white lines\n"
    )
    assert "left out dark.png" in printed.out
    assert not out.exists()


PINHOLE = """format = 1
model = "pinhole"
size_px = [256, 220]
focal_px = [200.0, 200.0]
center_px = [127.5, 109.5]
height_m = 0.2
"""


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--start", "absent.toml"], "absent.toml"),
        (["--start", "pinhole.toml"], "must be a mirror camera"),
        (["--field", "nowhere"], "field 'nowhere' is neither"),
        (["--out", "absent_folder/camera.toml"], "its folder does not exist"),
    ],
)
def test_bad_arguments_are_one_line(tmp_path, monkeypatch, refused, more, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pinhole.toml").write_text(PINHOLE)
    cv2.imwrite("dark.png", np.zeros((220, 256, 3), dtype=np.uint8))
    assert message in refused("calibrate", "omni", "dark.png", "--field", "ssl_2001", "--out", "x.toml", *more)
