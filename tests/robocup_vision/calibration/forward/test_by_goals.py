"""Pinhole cameras from pictures of a goal, and the command that writes their files."""

import math
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from dataset_folders import write_dataset

from field_models import load_field
from field_models.errors import ArgumentError, FrameError
from robocup_vision.calibration.forward.calibrate import calibrate_forward
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import load_camera, save_camera
from robocup_vision.cli import main
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal

CONDITION = GOAL_CONDITIONS["clean_416x320"]
TRUE = CONDITION.camera
# from the side and near, where perspective tells the focal length
PLACES = ((1.2, 1.2), (1.0, -1.3), (1.5, 1.4), (0.8, 0.9))


@pytest.fixture(scope="module")
def field():
    return load_field("four_legged_2007")


@pytest.fixture(scope="module")
def samples(field):
    return list(sample_goal(field, CONDITION, seed=21, count=len(PLACES), places=PLACES, supersample=3))


def off(ratio, height_m):
    return replace(TRUE, focal_px=(TRUE.focal_px[0] * ratio, TRUE.focal_px[1] * ratio), height_m=height_m)


@pytest.mark.slow
def test_focal_length_and_height_are_reported_with_their_uncertainty(field, samples):
    """Only this finds a fit by goals that is wrong, or surer than it is right."""
    result = calibrate_forward(field, [s.frame for s in samples], off(1.1, 0.21))
    assert result
    height_m = float(np.mean([s.camera.height_m for s in samples]))
    assert abs(result.camera.focal_px[0] - TRUE.focal_px[0]) < min(3 * result.std["focal_px"], 0.03 * TRUE.focal_px[0])
    assert abs(result.camera.height_m - height_m) < min(3 * result.std["height_m"] + 0.005, 0.03)
    assert -1 <= result.correlation <= 1
    # the neck turns between the pictures
    assert result.camera.tilt_rad is None
    assert any("tilt" in note for note in result.notes)
    for frame in result.frames:
        assert frame.tilt_rad == pytest.approx(samples[frame.index].camera.tilt_rad, abs=math.radians(1.0))


def test_one_far_goal_from_the_front_without_lines_is_refused(field):
    bare = replace(field, lines=field.lines[:0], arcs=field.arcs[:0], beacons=())
    (far,) = sample_goal(bare, CONDITION, seed=4, count=1, places=[(-1.5, 0.0)], supersample=3)
    result = calibrate_forward(bare, [far.frame], TRUE)
    assert isinstance(result, NotCalibrated)


class Broken:
    """A sequence of which the first image is damaged."""

    def __len__(self):
        return 1

    def __getitem__(self, index):
        raise FrameError("a.png: is empty")


def test_what_cannot_be_read_is_noted(field):
    result = calibrate_forward(field, Broken(), TRUE)
    assert result.reason == "none of the images can be read"
    assert result.notes == ("a.png: is empty: left out",)


def test_a_field_without_posts_is_refused():
    with pytest.raises(ArgumentError, match="posts and a bar"):
        calibrate_forward(load_field("ssl_2001"), [np.zeros((320, 416, 3), np.uint8)], TRUE)


@pytest.mark.slow
def test_the_command_reports_the_tilt_of_a_fixed_camera(samples, tmp_path, capsys):
    """Only this finds a tilt that all pictures share and is left out, or poses matched to other images."""
    shown = samples[:1] * 3
    truth = [one.pose.array for one in shown]
    write_dataset(tmp_path, [one.frame for one in shown], TRUE, "four_legged_2007", truth=truth)
    save_camera(off(0.95, 0.18), tmp_path / "start.toml")
    out = tmp_path / "found.toml"
    arguments = ["calibrate", "forward", str(tmp_path / "images"), "--field", "four_legged_2007", "--out", str(out)]
    given = ["--start", str(tmp_path / "start.toml"), "--poses", str(tmp_path / "truth.csv")]
    assert main([*arguments, *given]) == 0
    said = capsys.readouterr().out
    assert "focal length" in said
    assert re.search(r"tilt .* \+- 0\.\d*[1-9]", said)
    found = load_camera(out)
    assert found.focal_px[0] == pytest.approx(TRUE.focal_px[0], rel=0.04)
    assert found.tilt_rad == pytest.approx(shown[0].camera.tilt_rad, abs=math.radians(1.0))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--start", "MIRROR"], "must look ahead"),
        (["--poses", "OTHER"], "names none of the images"),
        (["--out", "nowhere/c.toml"], "its folder does not exist"),
        (["--start", "FORWARD"], "no goal is found"),
    ],
)
def test_each_mistake_is_one_line(arguments, said, tmp_path, refused):
    save_camera(sekimori_camera(), tmp_path / "mirror.toml")
    save_camera(TRUE, tmp_path / "forward.toml")
    cv2.imwrite(str(tmp_path / "a.png"), np.full((320, 416, 3), (50, 130, 45), np.uint8))
    (tmp_path / "other.csv").write_text("image,x_m,y_m,theta_rad\nz.png,0,0,0\n")
    places = {name: tmp_path / f"{name.lower()}.toml" for name in ("MIRROR", "FORWARD")}
    places["OTHER"] = tmp_path / "other.csv"
    if "MIRROR" in arguments:
        cv2.imwrite(str(tmp_path / "a.png"), np.zeros((220, 256, 3), np.uint8))
    command = ["calibrate", "forward", str(tmp_path / "a.png"), "--field", "four_legged_2007"]
    command += ["--out", str(tmp_path / "c.toml"), *(str(places.get(a, a)) for a in arguments)]
    assert said in refused(*command)
