"""Balls of any look are found in a fisheye and on carpet where their size belongs, and nothing else is."""

import math
from importlib.resources import files

import cv2
import numpy as np
import pytest
from ball_patches import is_patch

from field_models import load_field
from robocup_vision.camera import FisheyeCamera
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.learned import MIN_NATS, SWEEP_S
from robocup_vision.perception.balls.network import BallPlaces
from robocup_vision.perception.balls.projection import BallFrame, PinholeBallProjection
from robocup_vision.vision import Vision

FIELD = load_field("msl_18x12")
HELD = FisheyeCamera(
    (480, 360), (200.0, 200.0), (239.5, 179.5), 0.77, pan_rad=0.0, tilt_rad=-0.3, roll_rad=0.02, height_std_m=0.01
)
YELLOW, DARK, WHITE = (40, 190, 215), (25, 25, 25), (215, 215, 215)


def picture(places, color=YELLOW, patches=DARK, seed=0, camera=HELD):
    """Carpet below the horizon, and balls on it, by each pixel's ray."""
    rng = np.random.default_rng(seed)
    width, height = camera.size_px
    rays = camera.pixel_to_ray(np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1))
    frame = np.where(rays[..., 2:] < 0, (55.0, 130.0, 70.0), (120.0, 110.0, 115.0))
    for x, y in places:
        radius = FIELD.ball_radius_m
        center = np.array([x, y, radius - camera.height_m])
        along = rays @ center
        inside = along**2 > center @ center - radius**2
        inside &= along > 0
        near = along - np.sqrt(np.maximum(along**2 - center @ center + radius**2, 0.0))
        normal = (rays * near[..., None] - center) / radius
        dark = is_patch(tuple(n.astype(np.float32) for n in normal[inside].T), tuple(rng.uniform(-3, 3, 3)))
        frame[inside] = np.where(dark[:, None], patches, color) * (0.8 + 0.2 * normal[inside][:, 2:])
    frame = cv2.GaussianBlur(frame, (0, 0), 0.6) + rng.normal(0, 4, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


@pytest.fixture
def finder():
    return BallFinder(FIELD, HELD)


@pytest.mark.parametrize("place", [(0.8, 0.1), (1.5, -0.9), (3.0, 1.5), (4.5, 0.3)])
@pytest.mark.parametrize("color", [YELLOW, (30, 110, 230), WHITE])
@pytest.mark.parametrize("patches", [None, DARK], ids=["plain", "patches"])
def test_a_ball_is_found_and_placed_within_what_it_owns_to(finder, place, color, patches):
    (ball,) = finder.find(BallFrame(picture([place], color, patches or color), HELD))
    off = np.array([ball.x_m, ball.y_m]) - place
    assert off @ np.linalg.solve(ball.covariance, off) < 16
    assert math.hypot(*off) < 0.08 * math.hypot(*place)
    assert ball.log_likelihood_ratio >= MIN_NATS


def test_several_balls_are_told_the_surest_first(finder):
    places = [(0.9, 0.2), (1.6, -0.8), (2.6, 1.0)]
    balls = finder.find(BallFrame(picture(places, YELLOW, YELLOW), HELD))
    assert len(balls) == 3
    for place in places:
        assert min(math.dist((ball.x_m, ball.y_m), place) for ball in balls) < 0.2
    ratios = [ball.log_likelihood_ratio for ball in balls]
    assert ratios == sorted(ratios, reverse=True)


@pytest.mark.parametrize(
    "frame", [picture([]), np.full((360, 480, 3), 90, np.uint8), np.zeros((360, 480, 3), np.uint8)]
)
def test_carpet_and_plain_pictures_show_none(finder, frame):
    assert finder.find(BallFrame(frame, HELD)) == ()


def test_a_ball_of_another_size_than_its_place_asks_for_is_none(finder):
    frame = picture([(3.0, 0.6)], YELLOW, YELLOW)
    assert finder.find(BallFrame(frame, HELD))
    tilted = HELD.with_orientation(0.0, -1.0, 0.02)
    assert BallFinder(FIELD, tilted).find(BallFrame(frame, tilted)) == ()


def test_masked_pixels_show_no_ball():
    mask = np.zeros((360, 480), np.uint8)
    frame = picture([(1.0, 0.1)])
    (ball,) = BallFinder(FIELD, HELD, mask).find(BallFrame(frame, HELD))
    cv2.circle(mask, (round(ball.u_px), round(ball.v_px)), 40, 255, -1)
    assert BallFinder(FIELD, HELD, mask).find(BallFrame(frame, HELD)) == ()


def test_a_ball_that_the_pictures_rim_cuts_is_found(finder):
    frame = picture([(1.5, 0.0)], YELLOW, YELLOW)
    (whole,) = finder.find(BallFrame(frame, HELD))
    finder.forget()
    cut = np.roll(frame, 20 - round(whole.u_px), axis=1)
    found = finder.find(BallFrame(cut, HELD))
    assert any(math.dist((ball.u_px, ball.v_px), (20.0, whole.v_px)) < 5 for ball in found)


def test_a_ball_is_seen_in_every_look_of_a_video_and_soon_after_a_jump(finder):
    period_s = 1 / 30
    for look, place in enumerate(((1.0, 0.0), (1.0, 0.05), (1.02, 0.1))):
        (ball,) = finder.find(BallFrame(picture([place], YELLOW, YELLOW), HELD, t_s=look * period_s))
        assert math.dist((ball.x_m, ball.y_m), place) < 0.1
    jumped = picture([(1.6, -0.6)], YELLOW, YELLOW)
    found = [
        finder.find(BallFrame(jumped, HELD, t_s=look * period_s))
        for look in range(3, 4 + math.ceil(SWEEP_S / period_s))
    ]
    ((ball,),) = found[-1:]
    assert math.dist((ball.x_m, ball.y_m), (1.6, -0.6)) < 0.1


@pytest.mark.parametrize(
    ("place", "first_s"), [((0.8, 0.1), 0.0), ((1.5, -0.9), 0.1), ((3.0, 1.5), 0.3), ((4.5, 0.3), 0.0)]
)
def test_a_ball_that_comes_into_view_is_told_within_a_sweep(finder, place, first_s):
    empty, shown = picture([]), picture([place], YELLOW, YELLOW)
    period_s = 0.05
    for look in range(round(first_s / period_s) + 1):
        assert finder.find(BallFrame(empty, HELD, t_s=look * period_s)) == ()
    looks = math.ceil(SWEEP_S / period_s)
    told = [finder.find(BallFrame(shown, HELD, t_s=first_s + (1 + look) * period_s)) for look in range(looks)]
    assert told[-1]
    assert told == sorted(told, key=len)


@pytest.mark.parametrize("times_s", [(None, None), (0.0, 1.0), (0.0, 0.0), (5.0, 1.0), (None, 0.1)])
def test_frames_that_are_no_video_are_searched_whole(finder, times_s):
    before, now = times_s
    assert finder.find(BallFrame(picture([]), HELD, t_s=before)) == ()
    for place in ((0.8, 0.1), (4.5, 0.3)):
        finder.forget()
        finder.find(BallFrame(picture([]), HELD, t_s=before))
        assert finder.find(BallFrame(picture([place], YELLOW, YELLOW), HELD, t_s=now))


@pytest.mark.parametrize("looks", [1, 3, 30])
def test_parts_of_a_sweep_are_the_whole_frame_once(looks):
    strips = BallPlaces(PinholeBallProjection(HELD, FIELD.ball_radius_m).sizes, None).strips
    begin, shown = 0.25, []
    for _ in range(looks):
        end = begin + 1 / looks
        part = strips.some(begin, end, ())
        if part is not None:
            shown += map(tuple, part.places_px)
        begin = end % 1.0
    assert sorted(shown) == sorted(map(tuple, strips.places_px))


def test_a_camera_that_looks_up_sees_no_ball():
    up = HELD.with_orientation(0.0, 1.5, 0.0)
    assert BallFinder(FIELD, up).find(BallFrame(picture([(1.5, 0.0)]), up)) == ()


@pytest.mark.slow
def test_a_view_has_them_without_a_pose():
    """Only this finds balls that `Vision` drops where it knows no pose."""
    # loops compile; a ball of another hue than the field file names is a ball, too
    vision = Vision(FIELD, HELD)
    view = vision.look(picture([(1.2, -0.2)], WHITE, DARK))
    assert not view.pose
    assert view.ball is not None
    assert math.hypot(view.ball.x_m - 1.2, view.ball.y_m + 0.2) < 0.2
    assert vision.look(picture([])).balls == ()


def test_the_networks_are_small():
    folder = files("robocup_vision.perception.balls")
    assert sum(len((folder / name).read_bytes()) for name in ("places.onnx", "ball.onnx")) <= 150_000
