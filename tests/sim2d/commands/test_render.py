"""`robocup-vision render` from its words to the folder it writes."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import math
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, FileError
from field_models.toml_file import read_toml
from robocup_vision.camera import PinholeCamera, Tangent, load_camera, save_camera
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.geometry import Pose2
from sim2d.commands.render import add_parser, run_render
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.dataset import write_dataset
from sim2d.rendering.random_scenes import CONDITIONS, Condition, sample

SSL = load_field("ssl_2001")
SMALL = "sekimori:128x110"


def render(*words: str | Path) -> int:
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers())
    return run_render(parser.parse_args(["render", *map(str, words)]))


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "truth.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_dataset_holds_pictures_and_their_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "data"
    assert (
        render(
            "--field", "ssl_2001", "--camera", SMALL, "--count", 4, "--seed", 3, "--obstacles", 1, 2, "--ball", 0.5, out
        )
        == 0
    )
    assert "4 images of ssl_2001" in capsys.readouterr().out
    settings = read_toml(out / "dataset.toml")
    assert settings == {
        "format": 1,
        "field": "ssl_2001",
        "camera": "camera.toml",
        "images": "images",
        "truth": "truth.csv",
        "symmetry": "point",
    }
    camera = load_camera(out / "camera.toml")
    assert camera.size_px == (128, 110)
    rows = rows_of(out)
    assert [row["image"] for row in rows] == ["0000.png", "0001.png", "0002.png", "0003.png"]
    condition = Condition(obstacles=(1, 2), ball_rate=0.5)
    for row, drawn in zip(rows, sample(SSL, camera, condition, 3, 4), strict=True):
        np.testing.assert_array_equal(cv2.imread(str(out / "images" / row["image"])), drawn.frame)
        assert float(row["x_m"]) == pytest.approx(drawn.pose.x_m, abs=1e-6)
        assert float(row["theta_rad"]) == pytest.approx(drawn.pose.theta_rad, abs=1e-6)
        assert -math.pi <= float(row["theta_rad"]) <= math.pi
        if drawn.scene.ball is None:
            assert row["ball_x_m"] == row["ball_y_m"] == ""
        else:
            assert float(row["ball_y_m"]) == pytest.approx(drawn.scene.ball.y_m, abs=1e-6)


def test_the_noted_command_makes_the_same_pictures(tmp_path: Path):
    first, again = tmp_path / "first", tmp_path / "again"
    words = "--condition bad_day --noise 3 --blur 0.5 --vignette 0.1 --cast 0.9 1 1.1 --gain 0.8 --tilt 0.3 -0.2"
    words += " --center-offset 0.5 -0.25 --texture 0.05 --shadow --highlights 1 --spin 2 --jpeg 70 --light-gradient 0.1"
    render("--field", "ssl_2001", "--camera", SMALL, "--count", 2, "--seed", 9, *words.split(), first)
    noted = (first / "dataset.toml").read_text().splitlines()[0].removeprefix("# made by: robocup-vision render ")
    assert noted.endswith(" OUT")
    render(*shlex.split(noted)[:-1], again)
    for name in ("0000.png", "0001.png"):
        assert (first / "images" / name).read_bytes() == (again / "images" / name).read_bytes()
    # the camera handed out knows nothing of the true one's tilt and centre
    assert load_camera(first / "camera.toml").tilt_rad == (0.0, 0.0)


def test_camera_from_a_file_and_field_from_a_file(tmp_path: Path):
    save_camera(sekimori_camera(128, 110), tmp_path / "mirror.toml")
    field = tmp_path / "own.toml"
    field.write_text(
        'format = 1\nname = "own"\nsource = "test"\nlength_m = 3.0\nwidth_m = 2.0\nline_width_m = 0.02\n'
        '[boundary]\nkind = "walls"\nmargin_m = 0.1\nheight_m = 0.1\n'
    )
    render("--field", field, "--camera", tmp_path / "mirror.toml", "--count", 1, tmp_path / "out")
    assert read_toml(tmp_path / "out" / "dataset.toml")["field"] == "field.toml"
    assert (tmp_path / "out" / "field.toml").read_text() == field.read_text()


def pinhole(tmp_path: Path, **changes: object) -> Path:
    camera = PinholeCamera(
        (160, 120), (150.0, 150.0), (79.5, 59.5), 0.3, offset_m=(0.04, 0.01), pan_rad=0.1, tilt_rad=-0.3, roll_rad=0.0
    )
    save_camera(dataclasses.replace(camera, **changes), tmp_path / "head.toml")
    return tmp_path / "head.toml"


def test_a_forward_camera_with_robots_and_a_ball_in_sight(tmp_path: Path):
    camera, out = pinhole(tmp_path), tmp_path / "out"
    words = ["--count", 3, "--seed", 4, "--robots", 5, "--obstacles", 0, 0, "--ball", 1]
    words += ["--noise", 2, "--tilt", 0.2, -0.3, "--spin", 0.5]
    render("--field", "humanoid_kid_2025", "--camera", camera, *words, out)
    held, field = load_camera(out / "camera.toml"), load_field("humanoid_kid_2025")
    assert held.tilt_rad == -0.3
    true = Condition(tilt_rad=(math.radians(0.2), math.radians(-0.3))).true_camera(held)
    assert (true.tilt_rad, true.roll_rad) == pytest.approx((-0.3 + math.radians(0.3), math.radians(0.2)))
    noted = (out / "dataset.toml").read_text().splitlines()[0]
    assert "--robots 5" in noted
    condition = Condition(robots=5, robot_height_m=0.65, obstacles=(0, 0), ball_rate=1.0)
    for row, drawn in zip(rows_of(out), sample(field, held, condition, 4, 3), strict=True):
        pose = Pose2(*(float(row[key]) for key in ("x_m", "y_m", "theta_rad")))
        assert pose.array == pytest.approx(drawn.pose.array, abs=1e-6)
        robots, ball = drawn.scene.robots, drawn.scene.ball
        assert len(robots) == 5
        places = np.array([(pose.x_m, pose.y_m), *((robot.x_m, robot.y_m) for robot in robots)])
        apart = np.hypot(*np.moveaxis(places[:, None] - places, -1, 0)) + np.eye(6)
        assert apart.min() > 2 * field.robot_radius_m
        assert ball is not None
        assert ball.patches_bgr is not None
        # where the ball is, the camera looks
        in_robot = pose.inverse().transform([ball.x_m, ball.y_m])
        u, v = held.floor_to_pixel(in_robot)
        assert 0 <= u < 160
        assert -60 < v < 140
    dataset = load_dataset(out)
    assert dataset.method == "edges"
    assert len(dataset.truth) == 3


def test_what_a_forward_camera_cannot_render_is_named(tmp_path: Path):
    with pytest.raises(FileError, match=r"head\.toml: key 'tilt_rad': is needed to render"):
        render("--field", "ssl_2001", "--camera", pinhole(tmp_path, tilt_rad=None), tmp_path / "out")


def test_full_folder_is_refused_and_left_alone(tmp_path: Path):
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(ArgumentError, match="not an empty folder; nothing was written"):
        render("--field", "ssl_2001", "--camera", SMALL, "--count", 1, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["precious.txt"]
    with pytest.raises(ArgumentError, match="not an empty folder"):
        write_dataset(tmp_path / "precious.txt", "ssl_2001", sekimori_camera(), [])


def test_a_failure_leaves_nothing_behind(tmp_path: Path):
    def pictures():
        yield from sample(SSL, sekimori_camera(128, 110), CONDITIONS["nominal"], 1, 1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_dataset(tmp_path / "deep" / "data", "ssl_2001", sekimori_camera(128, 110), pictures())
    assert list(tmp_path.iterdir()) == []


def test_a_camera_without_height_is_named_with_its_file(tmp_path: Path):
    camera = tmp_path / "mirror.toml"
    save_camera(dataclasses.replace(sekimori_camera(128, 110), floor_range=Tangent(a_m=0.2, b_per_px=0.025)), camera)
    with pytest.raises(FileError, match=r"mirror\.toml: key 'viewpoint_height_m': is needed to render"):
        render("--field", "ssl_2001", "--camera", camera, tmp_path / "data")
    assert [path.name for path in tmp_path.iterdir()] == ["mirror.toml"]


def test_subset_keeps_its_numbers(tmp_path: Path):
    camera = sekimori_camera(128, 110)
    drawn = sample(SSL, camera, CONDITIONS["nominal"], 1, 5, indices=[4, 2])
    assert write_dataset(tmp_path / "some", "ssl_2001", camera, drawn) == 2
    assert [row["image"] for row in rows_of(tmp_path / "some")] == ["0004.png", "0002.png"]
