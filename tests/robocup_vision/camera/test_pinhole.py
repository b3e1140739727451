"""The laws of the pinhole camera over every lens, mounting and neck angle, and its conventions."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import pinholes

from field_models import ArgumentError
from robocup_vision.camera import PinholeCamera, camera_rotation, load_camera

PLAIN = PinholeCamera((640, 480), (600.0, 610.0), (319.5, 239.5), 0.46)


def pixels_of(camera: PinholeCamera) -> np.ndarray:
    width, height = camera.size_px
    return np.stack(np.meshgrid(np.linspace(0, width - 1, 13), np.linspace(0, height - 1, 11)), axis=-1)


@given(pinholes())
def test_slopes_of_pixels_are_those_of_their_rays(camera: PinholeCamera):
    pixels = pixels_of(camera).reshape(-1, 2)
    rays = camera.pixel_to_camera_ray(pixels)
    slopes = camera.pixel_slopes([(u, v) for u, v in pixels.tolist()])
    np.testing.assert_allclose(slopes, -rays[:, 1:] / rays[:, :1], rtol=1e-9, atol=1e-12)


@given(pinholes(), st.tuples(st.integers(100, 900), st.integers(100, 900)))
def test_a_picture_in_another_size_shows_the_same(camera: PinholeCamera, size_px: tuple[int, int]):
    other = camera.in_size(size_px)
    scale = np.array(size_px) / camera.size_px
    pixels = pixels_of(camera)
    scaled = (pixels + 0.5) * scale - 0.5
    np.testing.assert_allclose(other.pixel_to_camera_ray(scaled), camera.pixel_to_camera_ray(pixels), atol=1e-7)


@given(pinholes(), st.integers(0, 2**31))
def test_projection_is_opencvs(camera: PinholeCamera, seed: int):
    rays = np.random.default_rng(seed).normal((1.0, 0.0, 0.0), (0.1, 0.25, 0.2), (40, 3))
    matrix = np.array(
        [[camera.focal_px[0], 0, camera.center_px[0]], [0, camera.focal_px[1], camera.center_px[1]], [0, 0, 1]]
    )
    in_opencv = np.column_stack([-rays[:, 1], -rays[:, 2], rays[:, 0]])
    expected = cv2.projectPoints(in_opencv, np.zeros(3), np.zeros(3), matrix, np.array(camera.distortion))[0]
    np.testing.assert_allclose(camera.camera_ray_to_pixel(rays), expected.reshape(-1, 2), atol=1e-8)


def test_u_grows_to_the_right_and_v_downwards():
    center = np.array(PLAIN.center_px)
    np.testing.assert_allclose(PLAIN.camera_ray_to_pixel([1.0, 0.0, 0.0]), center)
    np.testing.assert_allclose(PLAIN.camera_ray_to_pixel([1.0, 0.1, 0.0]), center - (60.0, 0.0))
    np.testing.assert_allclose(PLAIN.camera_ray_to_pixel([1.0, 0.0, 0.1]), center - (0.0, 61.0))


def test_negative_tilt_looks_down_and_pan_looks_left():
    ahead, down = PLAIN.with_orientation(0.0, 0.0, 0.0), PLAIN.with_orientation(0.0, -0.3, 0.0)
    assert np.isnan(ahead.pixel_to_floor(PLAIN.center_px)).all()
    np.testing.assert_allclose(down.pixel_to_floor(PLAIN.center_px), [0.46 / math.tan(0.3), 0.0], atol=1e-12)
    left = PLAIN.with_orientation(0.5, -0.3, 0.0).pixel_to_floor(PLAIN.center_px)
    assert math.atan2(left[1], left[0]) == pytest.approx(0.5)


def test_positive_roll_lowers_the_right_side_of_the_camera():
    # the camera's left rises, so a level horizon rises to the left as it shows: higher v on the right is farther down
    rolled = PLAIN.with_orientation(0.0, 0.0, 0.1)
    right = rolled.pixel_to_ray([PLAIN.center_px[0] + 200, PLAIN.center_px[1]])
    assert right[2] < -0.01


def test_behind_the_camera_is_nowhere():
    assert np.isnan(PLAIN.camera_ray_to_pixel([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])).all()


def test_rays_beyond_the_fold_of_a_lens_do_not_come_back_into_the_image():
    barrel = PinholeCamera((640, 480), (600.0, 600.0), (319.5, 239.5), 0.46, (-0.3, 0.0, 0.0, 0.0))
    steep = np.array([1.0, 1.7, 0.0])
    folded = 1.7 * (1 - 0.3 * 1.7**2) * 600
    assert abs(folded) < 320  # the bare polynomial would show it
    assert np.isnan(barrel.camera_ray_to_pixel(steep)).all()
    assert np.isnan(barrel.pixel_to_camera_ray([1500.0, 239.5])).all()


def test_unknown_pan_and_roll_count_as_none_but_tilt_is_needed():
    known = PLAIN.with_orientation(None, -0.2, None)
    assert known.known_orientation
    np.testing.assert_array_equal(known.camera_to_robot, camera_rotation(0.0, -0.2, 0.0))
    unknown = PLAIN.with_orientation(0.1, None, 0.0)
    assert not unknown.known_orientation
    with pytest.raises(ArgumentError, match="tilt_rad is unknown"):
        unknown.pixel_to_floor([320.0, 400.0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size_px": (640, 0)}, r"size_px must be positive, got \(640, 0\)"),
        ({"focal_px": (-1.0, 600.0)}, "focal_px must be positive"),
        ({"height_m": 0.0}, "height_m must be positive"),
        ({"height_m": math.nan}, "height_m must be positive"),
        (
            {"height_m": 450.0},
            "height_m must be in metres, at most 3, got 450.0; in millimetres it is 0.45 m, in centimetres 4.5 m",
        ),
        ({"height_std_m": -0.01}, "height_std_m must not be negative, got -0.01"),
        ({"offset_m": (0.0, 60.0)}, "offset_m must be in metres, at most 3"),
        ({"tilt_rad": -15.0}, "tilt_rad must lie between -pi/2 and pi/2, got -15.0; -15 degrees are -0.2618 rad"),
        ({"pan_rad": 30.0}, "pan_rad must be in radians, within one turn, got 30.0"),
        ({"roll_rad": -10.0}, "roll_rad must be in radians, within one turn, got -10.0"),
        ({"distortion": (0.1,)}, "distortion must have 0, 4, 5 or 8 coefficients, got 1"),
    ],
)
def test_impossible_cameras_are_refused(changes: dict, message: str):
    good = {"size_px": (640, 480), "focal_px": (600.0, 600.0), "center_px": (320.0, 240.0), "height_m": 0.2}
    with pytest.raises(ArgumentError, match=message):
        PinholeCamera(**{**good, **changes})


REAL = Path(__file__).resolve().parents[4] / "shared" / "real"


@pytest.mark.skipif(not REAL.is_dir(), reason="real photographs are not here")
def test_cameras_of_real_robots_load():
    nao, small = load_camera(REAL / "goal_spl" / "camera.toml"), load_camera(REAL / "onboard_ssl" / "camera.toml")
    assert isinstance(nao, PinholeCamera)
    assert isinstance(small, PinholeCamera)
    assert not nao.known_orientation
    assert small.known_orientation
    np.testing.assert_array_equal(small.pixel_to_floor([322.8, 239.76])[1], 0.0)
