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


def test_only_so_many_frames_and_a_mask(folder, capsys):
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


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--start", "absent.toml"], "absent.toml"),
        (["--field", "nowhere"], "field 'nowhere' is neither"),
        (["--out", "absent_folder/camera.toml"], "its folder does not exist"),
    ],
)
def test_bad_arguments_are_one_line(folder, capsys, more, message):
    arguments = ["calibrate", "omni", str(folder / "images"), "--field", "ssl_2001", "--out", str(folder / "x.toml")]
    assert main([*arguments, *more]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1


def test_a_pinhole_start_is_refused(folder, capsys):
    start = folder / "pinhole.toml"
    start.write_text(
        'format = 1\nmodel = "pinhole"\nsize_px = [256, 220]\nfocal_px = [200.0, 200.0]\n'
        "center_px = [127.5, 109.5]\nheight_m = 0.2\n"
    )
    arguments = ["calibrate", "omni", "--field", "ssl_2001", str(folder / "images"), "--out", str(folder / "x.toml")]
    assert main([*arguments, "--start", str(start)]) == 2
    assert "must be a mirror camera" in capsys.readouterr().err
