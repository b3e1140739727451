"""Colour files from images, and the command that writes them."""

import cv2
import numpy as np
import pytest
from dataset_folders import write_dataset

from field_models import load_field
from field_models.errors import FrameError
from robocup_vision.calibration.colors import calibrate_colors
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import PinholeCamera
from robocup_vision.cli import main
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import CLASS_NAMES, build_color_table, load_colors
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample

CAST = CONDITIONS["warm"].cast_bgr


@pytest.fixture(scope="module")
def warm():
    return list(sample(load_field("ssl_2001"), sekimori_camera(), CONDITIONS["warm"], seed=12, count=8, supersample=2))


@pytest.fixture(scope="module")
def folder(warm, tmp_path_factory):
    root, truth = tmp_path_factory.mktemp("colors"), [one.pose.array for one in warm]
    return write_dataset(root, [one.frame for one in warm], sekimori_camera(), "ssl_2001", truth=truth)


def reads(samples):
    return [(str(one.index), lambda one=one: one.frame) for one in samples]


def under(bgr):
    blue, green, red = np.array(bgr) * CAST
    return red / green, blue / green


@pytest.mark.parametrize("known", ["nothing", "camera", "poses"])
def test_every_class_is_found_without_a_click(warm, ssl_field, known):
    camera = None if known == "nothing" else sekimori_camera()
    poses = {str(one.index): one.pose for one in warm} if known == "poses" else None
    result = calibrate_colors(ssl_field, reads(warm), camera, poses)
    assert result.frames == len(warm)
    colors = result.colors
    for paint, bgr in ((colors.floor.lit, (50, 130, 45)), (colors.line, (230, 230, 230))):
        assert (paint.red_ratio, paint.blue_ratio) == pytest.approx(under(bgr), rel=0.06)
    assert result.pixels["goal_negative_x"] > 100
    blue = colors.goal_negative_x
    assert (blue.red_ratio, blue.blue_ratio) == pytest.approx(under((190, 80, 35)), rel=0.12)
    classes = build_color_table(colors).segment(
        np.clip(np.array([[(50, 130, 45), (190, 80, 35), (30, 110, 235)]]) * CAST, 0, 255).astype(np.uint8)
    )[0]
    assert [CLASS_NAMES[c] for c in classes] == ["floor", "goal_negative_x", "ball"]


def test_frames_that_are_of_no_use_are_left_out(warm, ssl_field):
    def damaged():
        raise FrameError("x.png: is empty")

    wall = np.full_like(warm[0].frame, 190)
    useless = [("wall", lambda: wall), ("night", lambda: np.zeros_like(wall)), ("x.png", damaged)]
    result = calibrate_colors(ssl_field, [*useless, *reads(warm[:4])])
    assert result.frames == 4
    assert result.notes == (
        "night: too dark, or nothing of the floor in view: left out",
        "x.png: is empty: left out",
        "1 of 5 images show another floor than the rest: left out",
    )


def test_nothing_to_learn_from(ssl_field):
    result = calibrate_colors(ssl_field, [("night", lambda: np.zeros((220, 256, 3), np.uint8))])
    assert isinstance(result, NotCalibrated)
    assert not result
    assert "floor" in result.reason


def test_frames_are_read_one_at_a_time(warm, ssl_field):
    held = []

    def frames():
        for i, (name, read) in enumerate(reads(warm)):
            assert len(held) == i
            yield name, lambda name=name, read=read: held.append(name) or read()

    assert calibrate_colors(ssl_field, frames()).frames == len(warm)


def test_the_command_writes_a_file_and_a_preview(folder, capsys):
    out = folder / "colors.toml"
    arguments = ["calibrate", "colors", str(folder / "images"), "--out", str(out)]
    arguments += ["--camera", str(folder / "camera.toml"), "--poses", str(folder / "truth.csv")]
    assert main(arguments) == 0
    colors = load_colors(out)
    assert colors.floor.lit.red_ratio == pytest.approx(under((50, 130, 45))[0], rel=0.06)
    said = capsys.readouterr().out
    assert "colours by 8 of 8 images" in said
    preview = cv2.imread(str(folder / "colors_preview.png"))
    assert preview.shape[1] == 960
    # the right half of the preview shows the floor green
    assert ((preview[:, 480:] == (60, 170, 60)).all(axis=-1)).mean() > 0.2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["IMAGES", "--out", "OUT", "--poses", "TRUTH"], "--poses needs --camera"),
        (["nowhere", "--out", "OUT"], "nowhere: does not exist"),
        (["IMAGES", "--out", "nowhere/colors.toml"], "its folder does not exist"),
        (["IMAGES", "--out", "OUT", "--field", "nono"], "nono"),
        (["IMAGES", "--out", "OUT", "--mask", "SMALL"], "must be as large as the images"),
        (["NIGHT", "--out", "OUT"], "not calibrated"),
        (["IMAGES", "--out", "OUT", "--camera", "CAMERA", "--poses", "OTHER"], "names none of the images"),
    ],
)
def test_each_mistake_is_one_line(arguments, said, folder, tmp_path, refused):
    cv2.imwrite(str(tmp_path / "small.png"), np.full((4, 4, 3), 255, np.uint8))
    cv2.imwrite(str(tmp_path / "night.png"), np.zeros((220, 256, 3), np.uint8))
    (tmp_path / "other.csv").write_text("image,x_m,y_m,theta_rad\nz.png,0,0,0\n")
    places = {
        "IMAGES": folder / "images",
        "OUT": tmp_path / "c.toml",
        "TRUTH": folder / "truth.csv",
        "CAMERA": folder / "camera.toml",
        "SMALL": tmp_path / "small.png",
        "NIGHT": tmp_path / "night.png",
        "OTHER": tmp_path / "other.csv",
    }
    assert said in refused("calibrate", "colors", *(places.get(a, a) for a in arguments))


def test_a_ball_and_white_lines_wide_in_view(paint_field):
    field, pose = load_field("four_legged_2007"), Pose2(1.0, 0.0, 0.0)
    camera = PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.3, pan_rad=0.0, tilt_rad=-0.35, roll_rad=0.0)
    frame = paint_field(camera, field, pose, noise=2.0, rng=np.random.default_rng(2))
    cv2.circle(frame, (200, 200), 14, (30, 100, 220), -1)
    frame = np.clip(0.8 * frame * CAST, 0, 255).astype(np.uint8)
    result = calibrate_colors(field, [("0", lambda: frame)], camera, {"0": pose})
    line, ball = result.colors.line, result.colors.ball
    assert (line.red_ratio, line.blue_ratio) == pytest.approx(under((225, 230, 225)), rel=0.03)
    assert result.pixels["ball"] > 0
    assert (ball.red_ratio, ball.blue_ratio) == pytest.approx(under((30, 100, 220)), rel=0.1)
