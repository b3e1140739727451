"""Datasets with a rig: a folder of images a camera, one row a look, whatever is missing told or taken for missing."""

import csv
import json
import shutil

import cv2
import numpy as np
import pytest
from rig_pictures import CAMERAS, POSE, render

from field_models.errors import FileError
from robocup_vision.camera import save_camera
from robocup_vision.cli import main
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.geometry import Pose2

pytestmark = pytest.mark.usefixtures("without_plots")

PAIR, STEP = (CAMERAS[0], CAMERAS[2]), Pose2(0.04, 0.0, 0.05)
FRAMES = """image,camera,t_s,dx_m,dy_m,dtheta_rad
0.png,front,1.000,,,
0.png,back,1.000,,,
1.png,front,1.100,0.04,0.0,0.05
1.png,back,1.100,,,
2.png,front,1.200,0.04,0.0,0.05
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    rows, pose = ["image,x_m,y_m,theta_rad"], POSE
    for number in range(3):
        for name, frame in zip(("front", "back"), render(pose, 30 + number, cameras=PAIR), strict=True):
            (folder / "images" / name).mkdir(parents=True, exist_ok=True)
            # the last look has no picture of the camera behind
            if (name, number) != ("back", 2):
                cv2.imwrite(str(folder / "images" / name / f"{number}.png"), frame)
        rows.append(f"{number}.png,{pose.x_m},{pose.y_m},{pose.theta_rad}")
        pose = pose.compose(STEP)
    for name, camera in zip(("front", "back"), PAIR, strict=True):
        save_camera(camera, folder / f"{name}.toml")
    (folder / "rig.toml").write_text('format = 1\ncameras = ["front.toml", "back.toml"]\n')
    (folder / "truth.csv").write_text("\n".join(rows) + "\n")
    (folder / "frames.csv").write_text(FRAMES)
    (folder / "dataset.toml").write_text(
        'format = 1\nfield = "msl_6x4"\ncamera = "rig.toml"\nimages = "images"\nframes = "frames.csv"\n'
        'truth = "truth.csv"\nsymmetry = "point"\n'
    )
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "set")
    return tmp_path / "set"


def rows_of(out):
    with (out / "results.csv").open() as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("memory", [["--memory"], pytest.param([], marks=pytest.mark.slow)])
def test_a_look_is_a_row(folder, tmp_path, memory):
    """Without a memory it alone finds looks that need one."""
    assert main(["evaluate", str(folder), "--out", str(tmp_path / "out"), *memory]) == 0
    rows = rows_of(tmp_path / "out")
    assert [row["image"] for row in rows] == ["0.png", "1.png", "2.png"]
    assert [row["status"] for row in rows] == ["located"] * 3
    assert max(float(row["error_m"]) for row in rows) < 0.03
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["images"], summary["located"]) == (3, 3)


def test_looks_stand_alone_without_times(folder, tmp_path):
    toml = folder / "dataset.toml"
    toml.write_text(toml.read_text().replace('frames = "frames.csv"\n', ""))
    assert main(["evaluate", str(folder), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["located"] * 3


def test_an_image_that_is_not_readable_is_a_row_that_names_the_camera(folder, tmp_path, capsys):
    cv2.imwrite(str(folder / "images" / "back" / "1.png"), np.zeros((20, 30, 3), np.uint8))
    assert main(["evaluate", str(folder), "--out", str(tmp_path / "out")]) == 2
    row = rows_of(tmp_path / "out")[1]
    assert row["status"] == "unreadable"
    assert "back/1.png" in row["reason"]
    assert "1 of 3 images failed" in capsys.readouterr().err


def test_masks_are_of_the_cameras(folder):
    toml = folder / "dataset.toml"
    toml.write_text(toml.read_text() + 'mask = "masks"\n')
    (folder / "masks").mkdir()
    mask = np.zeros(PAIR[1].size_px[::-1], np.uint8)
    mask[:20] = 255
    cv2.imwrite(str(folder / "masks" / "back.png"), mask)
    front, back = load_dataset(folder, takes_rig=True).rig_masks
    assert front is None
    assert np.array_equal(back, mask)


def edit(folder, name, old, new):
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("frames.csv", "0.png,back,1.000", "0.png,left,1.000", "line 3: camera must be one of front, back"),
        ("frames.csv", "2.png,front", "2.png,back", "line 6: names an image that is not there, got 'back/2.png'"),
        ("frames.csv", "1.png,back,1.100,,,\n", "", "must name every image, does not name, got 'back/1.png'"),
        ("frames.csv", "1.png,back,1.100,,,", "1.png,front,1.100,,,", "line 5: names an image again"),
        ("frames.csv", "1.png,back,1.100,,,", "1.png,back,1.100,0.1,0,0", "line 5: another motion"),
        ("frames.csv", "2.png,front,1.200", "2.png,front,1.050", "t_s must be later than in the look before"),
        ("frames.csv", ",camera,", ",lens,", "'camera'"),
        ("dataset.toml", 'symmetry = "point"', 'pose_of = "camera"', "must be robot with a rig"),
        ("dataset.toml", 'symmetry = "point"', 'mask = "rig.toml"', "must be a folder of masks"),
        ("dataset.toml", 'symmetry = "point"', 'method = "landmarks"', "'landmarks' takes one camera"),
        ("dataset.toml", '"images"', '"gone"', "must be a folder"),
        ("rig.toml", "front.toml", "gone.toml", "gone.toml: cannot be read"),
    ],
)
def test_what_does_not_fit_together_is_told(folder, name, old, new, message):
    edit(folder, name, old, new)
    with pytest.raises(FileError) as caught:
        load_dataset(folder, takes_rig=True)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_camera_without_a_folder_is_told(folder):
    shutil.rmtree(folder / "images" / "back")
    with pytest.raises(FileError, match="has no folder back of that camera's images"):
        load_dataset(folder, takes_rig=True)


def test_other_commands_take_one_camera(folder, capsys):
    assert main(["check", str(folder)]) == 2
    assert "rig.toml: names several cameras, a rig: this command takes one camera" in capsys.readouterr().err
