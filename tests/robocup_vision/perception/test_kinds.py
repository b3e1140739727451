"""Upright pictures show what stands on a foot at one size; kinds are told by the frame that was looked at, or not."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, FrameError
from robocup_vision.camera import FisheyeCamera, PinholeCamera, load_camera
from robocup_vision.perception.joined import join_obstacles
from robocup_vision.perception.kinds.network import FOOT_PX, PIXEL_M, SEEN_PX, KindSource, log_odds, upright_pictures
from robocup_vision.perception.networks import Shrunk, read_network
from robocup_vision.perception.obstacles import Obstacle
from robocup_vision.vision import Vision

REAL = Path(__file__).resolve().parents[4] / "shared" / "real" / "msl_fisheye" / "images"
HELD = {"pan_rad": 0.0, "tilt_rad": -0.1, "roll_rad": 0.03}
FISHEYE = FisheyeCamera((608, 800), (326.0, 326.0), (303.5, 399.5), 0.77, **HELD)
AHEAD = PinholeCamera((640, 480), (420.0, 420.0), (319.5, 239.5), 0.6, **HELD)


def board(camera, place, width_m=0.4, height_m=0.9):
    """Draw a white board on black, upright on its foot and facing the camera."""
    x, y = place
    away = math.hypot(x, y)
    along = np.linspace(-0.5, 0.5, 40)
    side, up = np.meshgrid(width_m * along, height_m * (along + 0.5))
    ring = np.concatenate([side[0], side[:, -1], side[-1, ::-1], side[::-1, 0]])
    tall = np.concatenate([up[0], up[:, -1], up[-1, ::-1], up[::-1, 0]])
    points = np.stack([x - ring * y / away, y + ring * x / away, tall], axis=-1)
    frame = np.zeros((camera.size_px[1], camera.size_px[0], 3), np.uint8)
    corners = np.round(16 * camera.point_to_pixel(points)).astype(np.int32)
    cv2.fillPoly(frame, [corners], (255, 255, 255), cv2.LINE_AA, 4)
    return frame


@pytest.mark.parametrize("camera", [FISHEYE, AHEAD], ids=["fisheye", "pinhole"])
@pytest.mark.parametrize("place", [(1.8, 0.0), (3.0, 1.0), (5.5, -2.0)])
def test_an_upright_picture_shows_a_board_upright_and_of_one_size(camera, place):
    (picture,) = upright_pictures(Shrunk(board(camera, place)), camera, np.array([place]))
    width, height = SEEN_PX
    assert picture.shape == (height, width, 3)
    rows, columns = np.nonzero(picture[..., 0] > 127)
    assert columns.mean() == pytest.approx((width - 1) / 2, abs=0.7)
    assert np.ptp(columns) + 1 == pytest.approx(0.4 / PIXEL_M, abs=2)
    assert rows.max() == pytest.approx(height - 1 - FOOT_PX, abs=1)
    assert np.ptp(rows) + 1 == pytest.approx(0.9 / PIXEL_M, abs=2)


def test_beyond_the_frame_a_picture_is_black():
    white = np.full((480, 640, 3), 255, np.uint8)
    behind, ahead = upright_pictures(Shrunk(white), AHEAD, np.array([(-2.0, 0.1), (4.0, 0.0)]))
    assert not behind.any()
    assert ahead.mean() > 250


def test_what_speaks_for_a_kind_is_its_chance_against_all_else():
    answers = np.log([(0.7, 0.2, 0.1), (0.05, 0.9, 0.05)]) + 3.0
    assert log_odds(answers) == pytest.approx(np.log([(0.7 / 0.3, 0.2 / 0.8), (0.05 / 0.95, 0.9 / 0.1)]))


def test_a_file_that_is_no_network_is_refused():
    with pytest.raises(ArgumentError, match="no ONNX file"):
        read_network(b"no network")


def thing(kind, bearing=0.0, range_m=2.0):
    x, y = range_m * math.cos(bearing), range_m * math.sin(bearing)
    return Obstacle(x, y, 0.4, bearing, range_m, kind_teller=None if kind == "untold" else lambda: kind)


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        ("robot", None, "robot"),
        (None, "person", "person"),
        ("person", "person", "person"),
        ("robot", "person", None),
        ("untold", "robot", "robot"),
        ("untold", "untold", None),
    ],
)
def test_what_two_cameras_show_has_the_kind_that_none_of_them_contradicts(one, other, told):
    (joined,) = join_obstacles([[thing(one)], [thing(other, bearing=0.02)]], 0.25)
    assert joined.kind == told


@pytest.fixture(scope="module")
def carpet():
    """Draw a fisheye's frame: carpet, and a low grey box on it, which is neither robot nor person."""
    field = load_field("msl_18x12")
    pixels = np.stack(np.meshgrid(np.arange(608), np.arange(800)), axis=-1)
    rays = FISHEYE.pixel_to_ray(pixels)
    frame = np.where(rays[..., 2:] < 0, (60.0, 130.0, 70.0), (150.0, 150.0, 150.0))
    lit = board(FISHEYE, (2.5, 0.0), 0.5, 0.3)[..., :1] / 255.0
    frame = frame * (1 - lit) + 175.0 * lit
    frame += np.random.default_rng(0).normal(0.0, 3.0, frame.shape)
    return field, np.clip(frame, 0, 255).astype(np.uint8)


def test_kinds_are_told_by_the_frame_that_was_looked_at(carpet):
    field, frame = carpet
    frame = frame.copy()
    view = Vision(field, FISHEYE).look(frame)
    nearest = view.obstacles[0]
    assert nearest.range_m == pytest.approx(2.5, abs=0.2)
    kept = view.of_frame(frame.copy())
    frame[...] = 0
    with pytest.raises(FrameError, match="kinds"):
        _ = nearest.kind
    # a low grey box looks like neither
    assert kept.obstacles[0] == nearest
    assert kept.obstacles[0].kind is None
    assert "kind_teller" not in repr(nearest)


def test_a_thing_of_no_camera_is_of_unknown_kind():
    assert Obstacle(1.0, 0.0, 0.3, 0.0, 1.0).kind is None


@pytest.mark.skipif(not REAL.is_dir(), reason="the photographs are not here")
@pytest.mark.parametrize(
    ("pixel", "kind"),
    [((337.1, 469.0), "person"), ((388.5, 430.7), "robot"), ((493.0, 441.9), "robot"), ((200.0, 520.0), None)],
)
def test_a_robot_and_a_person_of_a_photograph_are_told_apart(pixel, kind):
    camera = load_camera(Path(__file__).parents[2] / "data" / "msl_fisheye_camera.toml")
    frame = np.asarray(cv2.imread(str(REAL / "20260503_r5_cam0_20260503_111804.jpg")), dtype=np.uint8)
    foot = camera.pixel_to_floor(np.array([pixel]))
    assert KindSource(lambda: frame, camera, foot).kind(0) == kind
