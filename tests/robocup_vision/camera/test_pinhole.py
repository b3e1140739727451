"""The laws of the pinhole camera over every lens, mounting and neck angle, and its conventions."""

import dataclasses
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers, pinholes

from field_models import ArgumentError
from robocup_vision.camera import Mounting, PinholeCamera, load_camera
from robocup_vision.camera.pinhole import MOUNTING_NAMES, camera_rotation, project_ideal

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


CAMERA = PinholeCamera((320, 240), (277.0, 270.0), (159.5, 119.5), 0.6)


@given(numbers(-3.2, 3.2), numbers(-1.5, 1.5), numbers(-1.5, 1.5))
def test_the_rotation_is_the_product_of_three(pan, tilt, roll):
    cp, sp, ct, st, cr, sr = (f(a) for a in (pan, tilt, roll) for f in (math.cos, math.sin))
    about_z = np.array([[cp, -sp, 0.0], [sp, cp, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[ct, 0.0, -st], [0.0, 1.0, 0.0], [st, 0.0, ct]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    np.testing.assert_allclose(camera_rotation(pan, tilt, roll), about_z @ about_y @ about_x, atol=1e-15)


def test_many_rotations_at_once_are_those_of_one_each():
    angles = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 4, 5))
    many = camera_rotation(*angles)
    assert many.shape == (4, 5, 3, 3)
    for index in np.ndindex(4, 5):
        np.testing.assert_allclose(many[index], camera_rotation(*(float(a[index]) for a in angles)), atol=1e-15)


def test_ideal_pixels_are_those_of_a_camera_without_distortion():
    points = np.random.default_rng(4).uniform((-1, -2, -2), (5, 2, 2), (200, 3))
    pixels = project_ideal(CAMERA.focal_px, CAMERA.center_px, points)
    np.testing.assert_allclose(pixels, CAMERA.camera_ray_to_pixel(points), rtol=1e-12)
    assert np.isnan(pixels[points[:, 0] <= 0]).all()


def test_each_point_may_have_its_own_focal_length():
    points = np.random.default_rng(5).uniform((1, -2, -2), (5, 2, 2), (20, 3))
    scale = np.linspace(0.9, 1.1, 20)
    pixels = project_ideal((277.0 * scale, 270.0 * scale), CAMERA.center_px, points)
    for k, factor in enumerate(scale):
        one = dataclasses.replace(CAMERA, focal_px=(277.0 * factor, 270.0 * factor))
        np.testing.assert_allclose(pixels[k], one.camera_ray_to_pixel(points[k]), rtol=1e-12)


CAMERA = PinholeCamera(
    (320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, offset_m=(0.05, 0.0), pan_rad=0.1, tilt_rad=-0.26, roll_rad=0.02,
    roll_std_rad=0.02,
)  # fmt: skip


def test_a_camera_is_held_as_a_file_with_those_values_says():
    # looked at once, so that what is worked out of the old orientation would be found again
    CAMERA.camera_to_robot, CAMERA.viewpoint_m  # noqa: B018
    told = Mounting(pan_rad=-0.4, tilt_rad=-0.6, height_m=0.41, tilt_std_rad=0.01, height_std_m=0.004)
    held, file = CAMERA.held(told), dataclasses.replace(CAMERA, **told.known)
    for name in MOUNTING_NAMES:
        assert getattr(held, name) == getattr(file, name)
    pixels = [(10.0, 200.0), (300.0, 230.0)]
    np.testing.assert_array_equal(held.pixel_to_floor(pixels), file.pixel_to_floor(pixels))
    np.testing.assert_array_equal(held.viewpoint_m, file.viewpoint_m)
    assert held.roll_rad == CAMERA.roll_rad
    assert held.sway_std_rad == (0.01, 0.02)
    assert CAMERA.sway_std_rad == (0.02, 0.02)
    assert CAMERA.held(Mounting()).is_held_as(CAMERA)
    assert not held.is_held_as(CAMERA)
    assert CAMERA.held_as(held).is_held_as(held)
    assert CAMERA.held(Mounting(pan_rad=0.9)).is_held_as(CAMERA)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"tilt_rad": -15.0}, "tilt_rad must lie between -pi/2 and pi/2, got -15.0; -15 degrees are -0.2618 rad"),
        ({"pan_rad": 90.0}, "pan_rad must be in radians, within one turn, got 90.0; 90 degrees are 1.5708 rad"),
        ({"tilt_std_rad": 2.0}, "tilt_std_rad must be in radians, at most 0.5, got 2.0; 2 degrees are 0.0349 rad"),
        ({"roll_std_rad": -0.1}, "roll_std_rad must not be negative, got -0.1"),
        ({"height_std_m": -1.0}, "height_std_m must not be negative, got -1.0"),
        ({"height_m": 0.0}, "height_m must be positive, got 0.0"),
        ({"roll_rad": math.nan}, "roll_rad must be a finite number, got nan"),
        ({"height_m": "high"}, "height_m must be a finite number, got 'high'"),
    ],
)
def test_wrong_values_are_named(told, message):
    with pytest.raises(ArgumentError, match=rf"^a mounting's {message}$"):
        Mounting(**told)
