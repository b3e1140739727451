"""The laws of the pinhole camera over every lens, mounting and neck angle, its conventions, and its files."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from field_models import ArgumentError
from robocup_vision.camera import PinholeCamera, camera_rotation, load_camera, save_camera

PLAIN = PinholeCamera((640, 480), (600.0, 610.0), (319.5, 239.5), 0.46)
# barrel, pincushion, a rational wide angle, and one with much tangential distortion
LENSES = [
    (),
    (-0.30, 0.10, 0.001, -0.002),
    (0.15, -0.05, 0.0, 0.0, 0.01),
    (0.4, 0.1, 0.001, 0.001, 0.01, 0.7, 0.2, 0.02),
    (-0.05, 0.0, 0.02, -0.02),
]


@st.composite
def pinholes(draw: st.DrawFn, *, lenses: list[tuple[float, ...]] = LENSES) -> PinholeCamera:
    return PinholeCamera(
        size_px=(640, 480),
        focal_px=(draw(numbers(400, 900)), draw(numbers(400, 900))),
        center_px=(draw(numbers(300, 340)), draw(numbers(220, 260))),
        height_m=draw(numbers(0.05, 1.5)),
        distortion=draw(st.sampled_from(lenses)),
        offset_m=(draw(numbers(-0.2, 0.2)), draw(numbers(-0.2, 0.2))),
        pan_rad=draw(st.none() | numbers(-3.0, 3.0)),
        tilt_rad=draw(numbers(-1.2, 0.6)),
        roll_rad=draw(st.none() | numbers(-0.5, 0.5)),
    )


def pixels_of(camera: PinholeCamera) -> np.ndarray:
    width, height = camera.size_px
    return np.stack(np.meshgrid(np.linspace(0, width - 1, 13), np.linspace(0, height - 1, 11)), axis=-1)


@given(pinholes())
def test_pixel_to_ray_to_pixel_is_identity_and_rays_are_unit(camera: PinholeCamera):
    pixels = pixels_of(camera)
    for to_ray, to_pixel in (
        (camera.pixel_to_ray, camera.ray_to_pixel),
        (camera.pixel_to_camera_ray, camera.camera_ray_to_pixel),
    ):
        rays = to_ray(pixels)
        np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(to_pixel(rays), pixels, atol=1e-6)
        np.testing.assert_allclose(to_pixel(17.0 * rays), pixels, atol=1e-6)


@given(pinholes())
def test_slopes_of_pixels_are_those_of_their_rays(camera: PinholeCamera):
    pixels = pixels_of(camera).reshape(-1, 2)
    rays = camera.pixel_to_camera_ray(pixels)
    slopes = camera.pixel_slopes([(u, v) for u, v in pixels.tolist()])
    np.testing.assert_allclose(slopes, -rays[:, 1:] / rays[:, :1], rtol=1e-9, atol=1e-12)


@given(pinholes())
def test_pixel_to_floor_to_pixel_is_identity(camera: PinholeCamera):
    pixels = pixels_of(camera)
    floor = camera.pixel_to_floor(pixels)
    seen = np.isfinite(floor).all(axis=-1)
    np.testing.assert_array_equal(seen, camera.pixel_to_ray(pixels)[..., 2] < -1e-9)
    np.testing.assert_allclose(camera.floor_to_pixel(floor[seen]), pixels[seen], atol=1e-5)


@given(pinholes(), numbers(-1, 1), numbers(-1, 1))
def test_floor_lies_where_the_ray_meets_it(camera: PinholeCamera, across: float, down: float):
    pixel = np.array([320 + 319 * across, 240 + 239 * down])
    ray, floor = camera.pixel_to_ray(pixel), camera.pixel_to_floor(pixel)
    if ray[2] >= -1e-6:
        return
    met = camera.viewpoint_m + ray * (camera.height_m / -ray[2])
    np.testing.assert_allclose(met, [*floor, 0.0], atol=1e-6 * max(1.0, np.abs(met).max()))


@given(pinholes(), st.integers(0, 2**31))
def test_projection_is_opencvs(camera: PinholeCamera, seed: int):
    rays = np.random.default_rng(seed).normal((1.0, 0.0, 0.0), (0.1, 0.25, 0.2), (40, 3))
    matrix = np.array(
        [[camera.focal_px[0], 0, camera.center_px[0]], [0, camera.focal_px[1], camera.center_px[1]], [0, 0, 1]]
    )
    in_opencv = np.column_stack([-rays[:, 1], -rays[:, 2], rays[:, 0]])
    expected = cv2.projectPoints(in_opencv, np.zeros(3), np.zeros(3), matrix, np.array(camera.distortion))[0]
    np.testing.assert_allclose(camera.camera_ray_to_pixel(rays), expected.reshape(-1, 2), atol=1e-8)


@given(pinholes(), numbers(-3, 3), numbers(-1.5, 1.5), numbers(-3, 3))
def test_turning_the_neck_leaves_the_cameras_own_rays_alone(
    camera: PinholeCamera, pan: float, tilt: float, roll: float
):
    turned = camera.with_orientation(pan, tilt, roll)
    pixels = pixels_of(camera)
    own = camera.pixel_to_camera_ray(pixels)
    np.testing.assert_array_equal(turned.pixel_to_camera_ray(pixels), own)
    np.testing.assert_allclose(turned.pixel_to_ray(pixels), own @ camera_rotation(pan, tilt, roll).T, atol=1e-12)


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


def test_offset_moves_the_floor_forward_and_left():
    there = PinholeCamera((640, 480), (600.0, 610.0), (319.5, 239.5), 0.46, offset_m=(0.1, 0.02), tilt_rad=-0.3)
    here = PLAIN.with_orientation(None, -0.3, None)
    moved = there.pixel_to_floor(pixels_of(there)) - here.pixel_to_floor(pixels_of(here))
    np.testing.assert_allclose(moved[-1], [[0.1, 0.02]] * 13, atol=1e-12)


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


@pytest.mark.parametrize("name", ["camera_to_robot", "viewpoint_m"])
def test_cached_arrays_are_read_only(name: str):
    with pytest.raises(ValueError, match="read-only"):
        getattr(PLAIN.with_orientation(0.0, -0.1, 0.0), name)[0] = 1.0


@given(pinholes(), st.none() | numbers(0, 0.5))
def test_saved_camera_loads_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, camera: PinholeCamera, roll_std: float | None
):
    path = tmp_path_factory.mktemp("camera") / "camera.toml"
    object.__setattr__(camera, "roll_std_rad", roll_std)
    save_camera(camera, path)
    loaded = load_camera(path)
    assert isinstance(loaded, PinholeCamera)
    assert {n: getattr(loaded, n) for n in PinholeCamera.__dataclass_fields__} == {
        n: getattr(camera, n) for n in PinholeCamera.__dataclass_fields__
    }


REAL = Path(__file__).resolve().parents[4] / "shared" / "real"


@pytest.mark.skipif(not REAL.is_dir(), reason="real photographs are not here")
def test_cameras_of_real_robots_load():
    nao, small = load_camera(REAL / "goal_spl" / "camera.toml"), load_camera(REAL / "onboard_ssl" / "camera.toml")
    assert isinstance(nao, PinholeCamera)
    assert isinstance(small, PinholeCamera)
    assert not nao.known_orientation
    assert small.known_orientation
    np.testing.assert_array_equal(small.pixel_to_floor([322.8, 239.76])[1], 0.0)
