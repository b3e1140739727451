"""White balls with dark patches are found on carpet, by their size where the tilt is not known, and nothing else is."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from ball_patches import is_patch

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.projection import BallFrame
from robocup_vision.vision import Vision

FIELD = load_field("spl_2020")
HELD = PinholeCamera(
    (480, 360), (462.0, 462.0), (239.5, 179.5), 0.46, pan_rad=0.0, tilt_rad=-0.2, roll_rad=0.0, height_std_m=0.01
)
FREE = dataclasses.replace(HELD, pan_rad=None, tilt_rad=None, roll_rad=None)


def picture(places, patches=True, seed=0):
    """Carpet below the horizon, and balls drawn on it as spheres far away look."""
    rng = np.random.default_rng(seed)
    width, height = HELD.size_px
    v, u = np.mgrid[:height, :width].astype(float)
    frame = np.full((height, width, 3), (55.0, 130.0, 70.0))
    frame[np.isnan(HELD.pixel_to_floor(np.stack([u, v], axis=-1))[..., 0])] = (120, 110, 115)
    for x, y in places:
        ray = np.array([x, y, FIELD.ball_radius_m - HELD.height_m])
        away = float(np.linalg.norm(ray))
        center = HELD.ray_to_pixel(ray / away)
        radius = HELD.focal_px[0] * FIELD.ball_radius_m / away
        right, up = (u - center[0]) / radius, (center[1] - v) / radius
        inside = right**2 + up**2 < 1
        toward = np.sqrt(np.maximum(1 - right**2 - up**2, 0))
        dark = is_patch(tuple(n.astype(np.float32) for n in (right, up, toward)), tuple(rng.uniform(-3, 3, 3)))
        frame[inside] = 190 + 30 * up[inside, None]
        if patches:
            frame[inside & dark] = 25
    frame = cv2.GaussianBlur(frame, (0, 0), 0.7) + rng.normal(0, 4, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def finder():
    return BallFinder(FIELD, HELD)


@pytest.mark.parametrize("place", [(0.8, 0.1), (1.5, -0.4), (2.6, 0.6)])
@pytest.mark.parametrize("camera", [HELD, FREE], ids=["tilt known", "tilt unknown"])
def test_a_ball_is_found_and_placed_within_what_it_owns_to(finder, place, camera):
    (ball,) = finder.find(BallFrame(picture([place]), camera))
    off = np.array([ball.x_m, ball.y_m]) - place
    assert off @ np.linalg.solve(ball.covariance, off) < 16
    assert math.hypot(*off) < (0.06 if camera is HELD else 0.2) * math.hypot(*place)


@pytest.mark.parametrize("distortion", [(-0.25, 0.08, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0)])
@pytest.mark.parametrize("place", [(0.9, 0.4), (1.2, -0.5), (2.1, 0.0)])
def test_a_ball_seen_through_a_lens_is_as_large_as_it_is(place, distortion):
    lens = dataclasses.replace(HELD, distortion=distortion)
    width, height = HELD.size_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    ideal = HELD.camera_ray_to_pixel(lens.pixel_to_camera_ray(pixels)).astype(np.float32)
    frame = cv2.remap(picture([place]), ideal[..., 0], ideal[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    free = dataclasses.replace(lens, pan_rad=None, tilt_rad=None, roll_rad=None)
    for camera, most in ((lens, 0.03), (free, 0.2)):
        (ball,) = BallFinder(FIELD, lens).find(BallFrame(np.asarray(frame, dtype=np.uint8), camera))
        assert math.dist((ball.x_m, ball.y_m), place) < most * math.hypot(*place)


def test_all_balls_are_found_and_bear_each_other_out(finder):
    places = [(0.9, 0.2), (1.4, -0.3), (2.2, 0.5)]
    balls = finder.find(BallFrame(picture(places), FREE))
    assert len(balls) == 3
    for place in places:
        offs = [(np.array([ball.x_m, ball.y_m]) - place, ball) for ball in balls]
        assert min(off @ np.linalg.solve(ball.covariance, off) for off, ball in offs) < 16
        assert min(math.hypot(*off) for off, _ in offs) < 0.2 * math.hypot(*place)
    ratios = [ball.log_likelihood_ratio for ball in balls]
    assert ratios == sorted(ratios, reverse=True)
    alone = finder.find(BallFrame(picture(places[:1]), FREE))[0]
    assert max(ratios) > alone.log_likelihood_ratio


@pytest.mark.parametrize(
    "frame", [picture([]), picture([(1.0, 0.1)], patches=False), np.full((360, 480, 3), 90, np.uint8)]
)
@pytest.mark.parametrize("camera", [HELD, FREE], ids=["tilt known", "tilt unknown"])
def test_carpet_a_plain_white_ball_and_a_grey_picture_show_none(finder, frame, camera):
    assert finder.find(BallFrame(frame, camera)) == ()


def test_leaves_of_many_plants_are_no_carpet(finder):
    frame = picture([(1.0, 0.1)])
    assert finder.find(BallFrame(frame, HELD))
    leaves = np.repeat(np.repeat(np.random.default_rng(2).uniform(0.25, 1.1, (24, 32)), 15, axis=0), 15, axis=1)
    is_green = (frame[..., 1] > 1.2 * frame[..., 2]) & (frame[..., 1] > 1.2 * frame[..., 0])
    frame[..., 2] = np.where(is_green, np.minimum(frame[..., 1] * 0.85 * leaves, 255), frame[..., 2])
    assert finder.find(BallFrame(frame, HELD)) == ()


def test_a_ball_of_another_size_than_its_place_asks_for_is_none(finder):
    tilted = HELD.with_orientation(0.0, -0.45, 0.0)
    assert finder.find(BallFrame(picture([(2.6, 0.6)]), tilted)) == ()


def test_masked_pixels_show_no_ball():
    mask = np.zeros((360, 480), np.uint8)
    frame = picture([(1.0, 0.1)])
    (ball,) = BallFinder(FIELD, HELD, mask).find(BallFrame(frame, HELD))
    cv2.circle(mask, (round(ball.u_px), round(ball.v_px)), 30, 255, -1)
    assert BallFinder(FIELD, HELD, mask).find(BallFrame(frame, HELD)) == ()


@pytest.mark.parametrize("method", ["goal", "field"])
def test_a_view_has_them_with_or_without_a_pose(method):
    vision = Vision(FIELD, FREE if method == "goal" else HELD, method=method)
    view = vision.look(picture([(1.2, -0.2)]))
    assert not view.pose
    assert (view.polar is None) == (method == "goal")
    assert view.ball is not None
    assert math.hypot(view.ball.x_m - 1.2, view.ball.y_m + 0.2) < 0.2
    assert vision.look(picture([])).balls == ()


@pytest.mark.parametrize("place", [(0.8, 0.1), (1.5, -0.4), (3.0, 0.6)])
@pytest.mark.parametrize("off_rad", [-0.026, 0.026])
def test_a_ball_is_found_where_the_body_nods_by_two_standard_deviations(finder, place, off_rad):
    nodding = dataclasses.replace(HELD, tilt_rad=HELD.tilt_rad + off_rad)
    (ball,) = finder.find(BallFrame(picture([place]), nodding))
    seen = HELD.ray_to_pixel(np.array([*place, FIELD.ball_radius_m - HELD.height_m]))
    assert math.hypot(ball.u_px - seen[0], ball.v_px - seen[1]) < 4


def test_a_camera_that_looks_up_sees_no_ball(finder):
    assert finder.find(BallFrame(picture([(1.5, 0.0)]), dataclasses.replace(HELD, tilt_rad=1.0))) == ()
