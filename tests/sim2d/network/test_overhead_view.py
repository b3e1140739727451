"""Overhead cameras that look: pixels, hidden and flying balls, calibration errors, and the images that are saved."""

from __future__ import annotations

import csv
import dataclasses
import math

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.cli import main
from robocup_vision.geometry import Pose2
from sim2d.network.overhead_view import Mounting, OverheadView, camera_mounting, camera_rig
from sim2d.network.realism import REALISMS, realism_named
from sim2d.network.vision import CameraImages, OverheadVision, visible_ratio
from sim2d.network.world import LeagueState
from sim2d.world.state import BallState, RobotState

FIELD = load_field("ssl_division_b")
CAMERA = camera_rig(FIELD, 2, 2, 1.0)[0]


def state(ball, *robots):
    return LeagueState(
        1.0,
        tuple(RobotState(number, 1, number, pose, (0.0, 0.0), 0.0) for number, pose in enumerate(robots)),
        BallState(*ball),
    )


def test_without_an_error_pixels_are_the_calibrations():
    view = OverheadView(FIELD, CAMERA)
    points = np.array([[-3.0, -2.0, 0.0], [-1.0, -0.5, 0.15], [-4.0, -2.5, 0.5]])
    for point, pixel in zip(points, view.project(points), strict=True):
        assert pixel == pytest.approx(CAMERA.pixel(*point), abs=1e-9)
        assert view.pixel(*point) == pytest.approx(tuple(pixel), abs=1e-9)
        assert view.on_field(*pixel, point[2]) == pytest.approx(point[:2], abs=1e-9)


def test_a_free_ball_is_where_it_is_and_as_large_as_it_should_be():
    view = OverheadView(FIELD, CAMERA)
    seen = view.ball(state((-3.0, -2.0)))
    assert seen.visible_ratio == 1.0
    assert view.on_field(seen.u_px, seen.v_px, FIELD.ball_radius_m) == pytest.approx((-3.0, -2.0), abs=1e-3)
    radius_px = FIELD.ball_radius_m * CAMERA.focal_length_px / (CAMERA.z_m - FIELD.ball_radius_m)
    assert seen.area_px == pytest.approx(math.pi * radius_px**2, rel=0.15)


@pytest.mark.parametrize("gap_m", [0.105, 0.112, 0.13, 0.2])
def test_behind_a_robot_as_much_is_hidden_as_the_rays_say(gap_m):
    # far from the camera's foot, so that the robot throws its side over what lies behind it
    robot = Pose2(-4.2, -1.65, 0.0)
    ball = (-4.2 - gap_m, -1.65)
    world = state(ball, robot)
    seen = OverheadView(FIELD, CAMERA).ball(world)
    expected = visible_ratio(CAMERA, world, FIELD.ball_radius_m)
    assert (0.0 if seen is None else seen.visible_ratio) == pytest.approx(expected, abs=0.2)
    if seen is not None and seen.visible_ratio < 0.95:
        # what is left of it lies farther out
        x, _ = OverheadView(FIELD, CAMERA).on_field(seen.u_px, seen.v_px, FIELD.ball_radius_m)
        assert x < ball[0]


def test_a_flying_ball_is_before_the_robots_and_where_its_ray_meets_the_floor():
    robot = Pose2(-4.0, -2.0, 0.0)
    view = OverheadView(FIELD, CAMERA)
    seen = view.ball(state((-4.0, -2.0, 0.0, 0.0, 1.0), robot))
    assert seen.visible_ratio == 1.0
    assert view.on_field(seen.u_px, seen.v_px, 0.0) == pytest.approx(
        CAMERA.on_floor(-4.0, -2.0, 1.0 + FIELD.ball_radius_m), abs=2e-3
    )
    assert view.ball(state((4.0, 2.0))) is None


def test_each_camera_is_off_by_its_own_error_and_always_by_the_same():
    realism = dataclasses.replace(REALISMS["cameras"], ball_std_m=0.0, robot_std_m=0.0, robot_std_rad=0.0)
    vision = OverheadVision(FIELD, realism, np.random.default_rng(3))
    world = state((-0.3, 0.3), Pose2(0.1, -0.1, 0.3))
    first, second = vision.capture(world, 0.0), vision.capture(world, 0.0)
    places = [(frame.yellow[0].x_m, frame.yellow[0].y_m) for frame in first]
    assert len({(round(x, 5), round(y, 5)) for x, y in places}) == 4
    assert places == [(frame.yellow[0].x_m, frame.yellow[0].y_m) for frame in second]
    for x, y in places:
        assert 0.0001 < math.hypot(x - 0.1, y + 0.1) < 0.06
    assert all(math.hypot(frame.balls[0].x_m + 0.3, frame.balls[0].y_m - 0.3) < 0.06 for frame in first)


def test_mountings_are_as_large_as_asked_for():
    rng = np.random.default_rng(1)
    made = [camera_mounting(rng, 0.01, 0.001) for _ in range(2000)]
    assert np.std([one.shift_m for one in made]) == pytest.approx(0.01, rel=0.05)
    assert np.std([one.rotation_rad for one in made]) == pytest.approx(0.001, rel=0.05)


def test_an_image_shows_ball_robot_and_lines_where_they_are():
    view = OverheadView(FIELD, CAMERA, Mounting((0.01, 0.0, 0.0)))
    image = view.render(state((-3.0, -2.0), Pose2(-2.0, -1.0, 0.0)), np.random.default_rng(0))
    assert image.shape == (1024, 1280, 3)

    def color(x, y, z):
        u, v = np.rint(view.project(np.array([[x, y, z]]))[0]).astype(int)
        return image[v, u].astype(int)

    blue, green, red = color(-3.0, -2.0, FIELD.ball_radius_m)
    assert red > 200 > green > blue
    blue, green, red = color(-2.0, -1.0, 0.15)
    assert min(green, red) > 180 > blue
    assert color(-4.5, -2.0, 0.0).min() > 120
    assert color(-1.5, -2.0, 0.0)[1] > 100


def test_images_are_saved_with_their_frames(tmp_path, capsys):
    out = tmp_path / "images"
    ports = ["--vision-port=34020", "--control-port=34300", "--tracker-port=34010", "--referee-port=34003"]
    options = ["--realism=cameras", "--cameras=2x1", "--players=1", "--speed=0", "--seconds=0.6", "--images-every=15"]
    assert main(["simulate", *ports, *options, f"--images={out}"]) == 0
    assert "4 images in" in capsys.readouterr().out
    with (out / "images.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["image"], row["camera_id"], row["frame_number"]) for row in rows] == [
        ("camera0_000015.png", "0", "15"),
        ("camera1_000015.png", "1", "15"),
        ("camera0_000030.png", "0", "30"),
        ("camera1_000030.png", "1", "30"),
    ]
    assert cv2.imread(str(out / rows[0]["image"])).shape == (1024, 1280, 3)


def test_what_a_user_can_mend_is_told(tmp_path):
    assert realism_named("cameras", "4x2").camera_columns == 4
    for text in ("0x2", "5x5", "4", "4x2x1"):
        with pytest.raises(ArgumentError, match="cameras are given as 4x2, at most 16"):
            realism_named("cameras", text)
    with pytest.raises(ArgumentError, match="every so many frames"):
        CameraImages(tmp_path, 0)
