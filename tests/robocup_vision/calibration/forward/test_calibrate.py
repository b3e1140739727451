"""Forward cameras by edges: rendered with known truth, pinhole and fisheye, and the laws of the parts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from forward_pictures import PLACES, render
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.calibration.forward.calibrate import calibrate_forward
from robocup_vision.calibration.forward.starts import KnownOfCamera, circle_of, dark_rim, starts_of
from robocup_vision.calibration.forward_parameters import CENTER, LENS, LINE_WIDTH, ForwardParameters
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.geometry import Pose2

STRAIGHT = PinholeCamera(
    (320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, pan_rad=0.0, tilt_rad=math.radians(-15.0), roll_rad=0.0
)
BENT = replace(STRAIGHT, center_px=(161.0, 118.0), distortion=(-0.25, 0.08, 0.0, 0.0))
FISHEYE = FisheyeCamera(
    (304, 400),
    (163.0, 163.0),
    (148.0, 203.0),
    0.75,
    (-0.02, -0.003, 0.0, 0.0),
    pan_rad=0.0,
    tilt_rad=0.02,
    roll_rad=-0.01,
    usable_radius_px=(0.0, 190.0),
)
IN_MIDDLE_SIZE = (
    Pose2(1.0, -2.5, 1.6),
    Pose2(-5.0, 2.0, 2.9),
    Pose2(4.0, 1.5, -0.4),
    Pose2(6.0, -3.0, 0.6),
    Pose2(-1.5, 3.0, -1.2),
    Pose2(-7.0, -1.0, 3.0),
    Pose2(2.0, 0.5, 2.5),
    Pose2(-3.0, -4.0, -1.9),
)


@pytest.fixture(scope="module")
def spl():
    return load_field("spl_2020")


@pytest.fixture(scope="module")
def frames(spl):
    return render(spl, STRAIGHT, PLACES, 8, margin_m=0.4)


def assert_is_true(result, truth):
    """Within what it states, and that is little."""
    assert result, result.reason
    camera, std = result.camera, result.std
    focal = truth.focal_px[0]
    assert abs(camera.focal_px[0] - focal) < 3 * std["focal_px"] + 0.003 * focal
    assert std["focal_px"] < 0.03 * focal
    assert abs(camera.height_m - truth.height_m) < 3 * std["height_m"] + 0.002
    assert abs(camera.tilt_rad - truth.tilt_rad) < 3 * std["tilt_rad"]
    assert abs(camera.roll_rad - truth.roll_rad) < 3 * std["roll_rad"] + 0.002
    for name, found, true in zip("uv", camera.center_px, truth.center_px, strict=True):
        assert abs(found - true) < 3 * std[f"center_{name}_px"] + 0.5


def test_lines_alone_correct_a_start(spl, frames):
    start = replace(STRAIGHT, focal_px=(262.2, 262.2), height_m=0.42, tilt_rad=STRAIGHT.tilt_rad - math.radians(1.0))
    assert_is_true(calibrate_forward(spl, frames, start), STRAIGHT)


@pytest.mark.slow
def test_lines_do_without_any_start(spl, frames):
    """Only this finds a search over tilts, focal lengths and heights that misses the true ones."""
    assert_is_true(calibrate_forward(spl, frames[:3]), STRAIGHT)


@pytest.mark.slow
def test_walls_serve_where_goals_have_no_posts():
    """Only this finds boards that draw a lens's fit to another scale."""
    field = load_field("ssl_2001")
    camera = replace(STRAIGHT, height_m=0.2, tilt_rad=math.radians(-12.0))
    places = (
        Pose2(0.3, 0.2, 1.1),
        Pose2(-0.5, -0.2, 2.3),
        Pose2(0.2, -0.3, -0.6),
        Pose2(-0.2, 0.1, -2.2),
        Pose2(0.6, 0.2, 2.9),
    )
    start = replace(camera, focal_px=(212.0, 212.0))
    assert_is_true(calibrate_forward(field, render(field, camera, places, 9, margin_m=0.4), start), camera)


@pytest.mark.parametrize(
    ("start", "ways"),
    [
        (STRAIGHT, "rough poses of the images (--poses) may do"),
        (
            KnownOfCamera(view_rad=1.2, height_m=0.45),
            "a start with its tilt_rad (--start), or rough poses of the images (--poses) may do",
        ),
    ],
)
def test_what_would_do_is_said_where_nothing_is_in_view(start, ways, spl):
    result = calibrate_forward(spl, [np.full((240, 320, 3), (50, 130, 45), np.uint8)], start)
    assert isinstance(result, NotCalibrated)
    assert not result
    reason = "no goal is found in any of the images, whatever the focal length may be; without a goal "
    assert result.reason == reason + ways


@pytest.mark.slow
def test_a_fisheye_is_found_from_its_rough_height_and_tilt():
    """Only this finds a fisheye's search and fit that end at another lens, or see past its rim."""
    field, known = load_field("msl_18x12"), KnownOfCamera("fisheye", height_m=0.7, tilt_rad=0.0)
    result = calibrate_forward(field, render(field, FISHEYE, IN_MIDDLE_SIZE, 5, margin_m=0.6), known)
    assert_is_true(result, FISHEYE)
    assert result.residual_px < 0.35
    assert len(result.frames) >= 6
    # floor by lens and mounting, where lines were seen
    pixels = np.array([(60.0, 300.0), (150.0, 280.0), (150.0, 340.0), (240.0, 270.0)])
    off_m = np.hypot(*(result.camera.pixel_to_floor(pixels) - FISHEYE.pixel_to_floor(pixels)).T)
    assert off_m.max() < 0.04
    inner, outer = result.camera.usable_radius_px
    assert inner == 0.0
    assert 0.9 * 190 < outer <= 190 + 1


@pytest.mark.slow
def test_a_lens_that_bends_lines_is_noticed_without_a_word(spl):
    """Only this finds a bent lens that is fitted as a straight one."""
    start = replace(STRAIGHT, focal_px=(216.0, 216.0))
    result = calibrate_forward(spl, render(spl, BENT, PLACES, 8, margin_m=0.6), start)
    assert_is_true(result, BENT)
    assert abs(result.camera.distortion[0] - BENT.distortion[0]) < 3 * result.std["k1"] + 0.02


LENSES = (FISHEYE, replace(FISHEYE, distortion=()), BENT, STRAIGHT)


@pytest.mark.parametrize("camera", LENSES)
@given(numbers=st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9))
def test_a_camera_becomes_a_vector_and_back(camera, numbers):
    parameters = ForwardParameters(camera)
    vector = parameters.vector(parameters.start) + np.array(numbers) * 0.01 * np.sign(parameters.start_std)
    vector[LINE_WIDTH] = 0.0
    assert parameters.vector(parameters.camera(vector)) == pytest.approx(vector)


@pytest.mark.parametrize("camera", LENSES)
def test_pixels_move_by_coefficients_as_the_camera_says(camera):
    parameters = ForwardParameters(camera)
    vector = parameters.vector(parameters.start)
    pixels = np.array([(40.0, 60.0), (150.0, 120.0), (250.0, 200.0), (150.0, 230.0)])
    rays = parameters.start.pixel_to_camera_ray(pixels)
    normal = np.array([(1.0, 0.0), (0.0, 1.0), (0.6, 0.8), (-0.8, 0.6)])
    step = 1e-3
    for place in range(parameters.coefficients):
        moved = vector.copy()
        moved[LENS + place] += step
        along = ((parameters.camera(moved).camera_ray_to_pixel(rays) - pixels) * normal).sum(axis=1)
        told = parameters.by_coefficients(parameters.start, pixels, normal)[:, place] * step
        assert told == pytest.approx(along, abs=1e-3)


def test_a_lens_that_is_known_has_no_coefficients():
    assert ForwardParameters(BENT, bends=False).coefficients == 0
    assert ForwardParameters(replace(FISHEYE, distortion=(), projection="equisolid")).coefficients == 0
    assert ForwardParameters(FISHEYE).start_std[CENTER][0] > ForwardParameters(BENT).start_std[CENTER][0]


def disc(radius_px, middle_px=(160.0, 118.0), size_px=(320, 240), level=120):
    u, v = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
    lit = np.hypot(u - middle_px[0], v - middle_px[1]) < radius_px
    return np.repeat(np.where(lit, level, 4).astype(np.uint8)[..., None], 3, axis=-1)


@given(st.floats(90.0, 180.0), st.floats(-6.0, 6.0), st.floats(-6.0, 6.0))
def test_the_circle_that_the_lens_fills_is_found(radius_px, aside_px, below_px):
    middle = (159.5 + aside_px, 119.5 + below_px)
    u, v, found = dark_rim([disc(radius_px, middle)])
    assert (u, v) == pytest.approx(middle, abs=1.0)
    assert found == pytest.approx(radius_px, abs=1.5)
    assert circle_of((u, v, found), (u + 3.0, v))[1] == pytest.approx(0.98 * found - 3.0, abs=0.5)


def test_no_circle_is_made_up():
    whole = np.full((240, 320, 3), 120, np.uint8)
    assert dark_rim([whole]) is None
    # a dark room, and a robot's part in a corner
    assert dark_rim([np.full((240, 320, 3), 3, np.uint8)]) is None
    part = whole.copy()
    part[180:, :120] = 5
    assert dark_rim([part]) is None
    # what is dark in one picture only is no rim
    assert dark_rim([disc(110.0), whole]) is None


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
@given(share=st.floats(0.0, 1.0), height_m=st.floats(0.16, 0.95), tilt_rad=st.floats(-0.7, 0.1))
def test_some_start_is_near_whatever_the_camera_is(model, share, height_m, tilt_rad):
    low, high = (42.0, 96.0) if model == "pinhole" else (75.0, 190.0)
    half = math.radians(low + share * (high - low)) / 2
    focal = 320.0 / (math.tan(half) if model == "pinhole" else half)
    starts = starts_of((640, 480), KnownOfCamera(model))
    assert isinstance(starts[0], FisheyeCamera) == (model == "fisheye")
    assert any(
        abs(math.log(one.focal_px[0] / focal)) < 0.07
        and abs(math.log(one.height_m / height_m)) < 0.17
        and abs(one.tilt_rad - tilt_rad) < 0.06
        for one in starts
    )


def test_what_is_known_is_not_tried():
    (only,) = starts_of((640, 480), KnownOfCamera("fisheye", math.radians(120.0), 0.5, -0.1))
    assert (only.height_m, only.tilt_rad) == (0.5, -0.1)
    assert only.focal_px[0] == pytest.approx(320.0 / math.radians(60.0))
    assert {one.tilt_rad for one in starts_of(BENT.size_px, BENT)} == {BENT.tilt_rad}
    assert len({one.tilt_rad for one in starts_of(BENT.size_px, replace(BENT, tilt_rad=None))}) > 5


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"model": "omni"}, "model must be one of pinhole, fisheye, got 'omni'"),
        ({"view_rad": 4.0}, "the view of a pinhole camera is less than 180 degrees, got 4.0"),
        ({"height_m": 450.0}, "height must be in metres, above 0 and at most 3, got 450.0"),
        ({"height_m": 0.0}, "height must be in metres, above 0 and at most 3, got 0.0"),
        ({"tilt_rad": -15.0}, "tilt must be in radians, between -pi/2 and pi/2, got -15.0"),
    ],
)
def test_what_cannot_be_is_refused(values, said):
    with pytest.raises(ArgumentError) as caught:
        KnownOfCamera(**values)
    assert str(caught.value) == said
