"""Each fault that is put into a right set-up is found by name, with its evidence."""

import dataclasses
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from dataset_folders import write_dataset

from robocup_vision.calibration.check import check_dataset, shows_carpet
from robocup_vision.camera import PinholeCamera, load_camera, save_camera
from robocup_vision.cli import main
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.perception.color_table import save_colors
from robocup_vision.vision import Vision


@pytest.fixture
def write(tmp_path, true_camera, off_samples):
    """Write a dataset; what is not said is right."""

    def dataset(*, camera=true_camera, size=None, with_truth=True, colors=None):
        shown = off_samples[:4]
        frames = [one.frame if size is None else cv2.resize(one.frame, size) for one in shown]
        truth = [one.pose.array for one in shown] if with_truth else None
        keys = {"symmetry": "point"}
        if colors is not None:
            save_colors(colors, tmp_path / "colors.toml")
            keys["colors"] = "colors.toml"
        return write_dataset(tmp_path, frames, camera, "ssl_2001", truth=truth, **keys)

    return dataset


def found(path):
    return {finding.subject: finding for finding in check_dataset(load_dataset(path))}


GREEN, BROWN, GREY, DARK = (50, 130, 45), (60, 90, 120), (90, 90, 90), (3, 9, 4)


@pytest.mark.parametrize(
    ("near", "far", "is_carpet"),
    [(GREEN, BROWN, True), (BROWN, GREEN, False), (GREY, GREEN, False), (DARK, GREEN, None)],
)
def test_it_is_a_carpet_if_the_ground_nearest_to_the_robot_is_green(ssl_field, true_camera, near, far, is_carpet):
    width, height = true_camera.size_px
    v, u = np.mgrid[:height, :width]
    inner, outer = true_camera.usable_radius_px
    is_near = np.hypot(u - true_camera.center_px[0], v - true_camera.center_px[1]) < inner + (outer - inner) / 2.5
    frame = np.where(is_near[..., None], np.array(near), np.array(far)).astype(np.uint8)
    assert shows_carpet(Vision(ssl_field, true_camera).look(frame), frame) is is_carpet


def test_swapped_channels_are_found_and_told_how_they_came(write, off_samples):
    path = write()
    for i, one in enumerate(off_samples[:4]):
        cv2.imwrite(str(path / "images" / f"{i}.png"), np.ascontiguousarray(one.frame[..., ::-1]))
    findings = check_dataset(load_dataset(path))
    assert [finding.subject for finding in findings] == ["size", "channels"]
    assert findings[1].state == "wrong"
    assert re.match(r"in [34] of 4 images the goals look as with red and blue swapped", findings[1].evidence)


@pytest.mark.slow
def test_pictures_that_show_no_field_are_reported_as_such_and_nothing_else(write, true_camera, capsys):
    """Only this finds pictures of a room that are explained by a slip."""
    path = write(with_truth=False)
    rng = np.random.default_rng(4)
    width, height = true_camera.size_px
    for i in range(4):
        # brown and grey shapes, as a room has them
        coarse = rng.uniform(40, 160, (6, 8, 1)) * np.array([0.7, 0.9, 1.1])
        cv2.imwrite(str(path / "images" / f"{i}.png"), cv2.resize(coarse.astype(np.uint8), (width, height)))
    assert main(["check", str(path)]) == 1
    *_, last = capsys.readouterr().out.strip().splitlines()
    assert last.strip() == (
        "WRONG    field: these pictures do not show this field: 0 of 4 images can be located on 'ssl_2001', "
        "and in 4 of 4 the ground before the robot is no green carpet"
    )


def test_swapped_channels_of_a_forward_camera_are_found_by_the_ball(tmp_path):
    """Yellow and cyan goals are each other's swapped colour: the ball tells."""
    samples = Path(__file__).resolve().parents[3] / "images" / "goal_four_legged"
    paths = sorted((samples / "images").iterdir())
    images = [cv2.imread(str(paths[n]), cv2.IMREAD_COLOR)[..., ::-1] for n in (3, 23, 24)]
    write_dataset(tmp_path, images, load_camera(samples / "camera.toml"), "four_legged_2007")
    findings = check_dataset(load_dataset(tmp_path))
    assert [finding.subject for finding in findings] == ["size", "channels"]
    assert findings[1].state == "wrong"
    assert findings[1].evidence.startswith("in 3 of 3 images the ball looks as with red and blue swapped")


@pytest.mark.slow
def test_a_sound_set_up_is_reported_to_be_one(write, capsys, ssl_field, true_camera, off_frames):
    """Only this finds a false alarm of the whole check."""
    vision = Vision(ssl_field, true_camera)
    vision.look(off_frames[0])
    path = write(colors=vision.colors)
    assert main(["check", str(path)]) == 0
    printed = capsys.readouterr().out
    for words in (
        "ok       size: 4 images read, all 256x220 as the camera file says",
        "ok       field: 4 of 4 images can be located on 'ssl_2001'",
        "ok       mirrored: 4 of 4 located pictures agree with the truth",
        "ok       heading: ",
        "ok       centre: by the images it is right within",
        "ok       curve: ",
        "ok       colours: colour file and images agree on ",
    ):
        assert words in printed
    assert "WRONG" not in printed


@pytest.mark.slow
def test_a_wrong_size_comes_with_its_factor(write, capsys):
    """Only this finds pictures of another size whose scale is not told."""
    path = write(size=(512, 440))
    findings = found(path)
    assert list(findings) == ["size", "pictures"]
    assert findings["size"].state == findings["pictures"].state == "wrong"
    assert "4 of 4 images cannot be used" in findings["size"].evidence
    assert findings["pictures"].evidence.startswith("with the pictures scaled from 512x440 to 256x220 4 of 4 pictures ")
    assert findings["pictures"].evidence.endswith("times 2")
    assert main(["check", str(path)]) == 1
    assert "WRONG    size" in capsys.readouterr().out


@pytest.mark.slow
def test_a_mirrored_camera_is_reported_by_truth(write, true_camera):
    """Only this finds a wrong `mirrored` that truth does not bring to light."""
    findings = found(write(camera=dataclasses.replace(true_camera, mirrored=True)))
    assert findings["mirrored"].state == "wrong"
    evidence = "with mirrored = false in the camera file 4 of 4 pictures agree with the truth (0 of 4 as it is)"
    assert findings["mirrored"].evidence == evidence


@pytest.mark.slow
def test_a_turned_camera_whose_centre_is_off_is_reported(write, true_camera):
    """Only this finds a centre two pixels off that passes, or a heading that is told with the wrong sign."""
    u, v = true_camera.center_px
    findings = found(write(camera=dataclasses.replace(true_camera, center_px=(u + 2.0, v), heading_rad=0.2)))
    assert findings["field"].state == "ok"
    assert findings["centre"].state == "wrong"
    assert re.match(r"by the images it is off by \(-.*calibrate omni", findings["centre"].evidence)
    assert findings["heading"].state == "wrong"
    off, wanted = re.search(r"by (\S+) deg: heading_rad = (\S+) in", findings["heading"].evidence).groups()
    assert float(off) == pytest.approx(math.degrees(-0.2), abs=0.4)
    assert float(wanted) == pytest.approx(0.0, abs=7e-3)


@pytest.mark.parametrize(
    ("level", "evidence"),
    [
        (5, "3 of 3 are black or nearly so: is the lens covered?"),
        (130, "3 of 3 have the same brightness all over, and show nothing"),
    ],
)
def test_pictures_of_nothing_are_told_as_such(tmp_path, true_camera, level, evidence, capsys):
    (tmp_path / "images").mkdir()
    for i in range(3):
        cv2.imwrite(str(tmp_path / "images" / f"{i}.png"), np.full((220, 256, 3), level, dtype=np.uint8))
    save_camera(true_camera, tmp_path / "camera.toml")
    assert main(["check", str(tmp_path), "--field", "ssl_2001", "--camera", str(tmp_path / "camera.toml")]) == 1
    assert capsys.readouterr().out.splitlines()[2:] == [f"  WRONG    pictures: {evidence}"]


@pytest.mark.slow
def test_colours_of_another_light_are_reported(write, ssl_field, true_camera, off_frames):
    """Only this finds a colour file of another light that passes."""
    vision = Vision(ssl_field, true_camera)
    vision.look(np.ascontiguousarray(off_frames[0][..., ::-1] // 3))
    wrong = vision.colors
    assert wrong is not None
    red = dataclasses.replace(wrong.floor, red_ratio=wrong.floor.red_ratio * 4, blue_ratio=wrong.floor.blue_ratio * 3)
    findings = found(write(colors=dataclasses.replace(wrong, floor=red)))
    assert findings["colours"].state == "wrong"
    assert "leave it out, or make a new one" in findings["colours"].evidence


@pytest.mark.slow
def test_fields_whose_goals_the_method_cannot_use_are_not_tried(tmp_path):
    """Only this finds a check that ends in an error of a field that it tries."""
    (tmp_path / "images").mkdir()
    carpet = np.full((240, 320, 3), (50, 130, 45), dtype=np.uint8)
    carpet[::20, ::20] = 0
    cv2.imwrite(str(tmp_path / "images" / "0.png"), carpet)
    save_camera(PinholeCamera((320, 240), (320.0, 320.0), (159.5, 119.5), 0.3), tmp_path / "camera.toml")
    dataset = load_dataset(tmp_path / "images", field="spl_2020", camera=tmp_path / "camera.toml")
    assert dataset.method == "goal"
    findings = {finding.subject: finding for finding in check_dataset(dataset)}
    assert findings["field"].state == "wrong"
    assert "0 of 1 images" in findings["field"].evidence
    assert "nor with any slip in field, camera or pictures that was tried" in findings["field"].evidence
