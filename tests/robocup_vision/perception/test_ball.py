"""The ball: found where it was rendered, not where there is none, never under the mask."""

import dataclasses
import math

import cv2
import numpy as np
import pytest

from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls import colored
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.projection import BallFrame
from robocup_vision.perception.color_table import build_color_table, learn_colors
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import Ball, Box, Scene
from sim2d.rendering.sensor import Sensor

POSE = Pose2(0.2, -0.1, 0.8)


def frame_with(camera, field, ball=None, boxes=(), pose=POSE):
    light = MirrorRenderer(camera, 2).render(Scene(field, ball=ball, boxes=boxes), pose)
    return Sensor(noise_sigma=6.0, blur_px=0.7).expose(light, np.random.default_rng(3))


def ball_at(field, range_m, bearing, pose=POSE):
    x, y = pose.transform([range_m * math.cos(bearing), range_m * math.sin(bearing)])
    return Ball(float(x), float(y), field.ball_radius_m)


@pytest.fixture(scope="module")
def vision(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera)


@pytest.mark.parametrize(("range_m", "bearing"), [(0.2, 0.0), (0.35, 2.0), (0.5, -1.1), (0.5, math.pi), (0.8, 3.0)])
def test_a_ball_is_found_where_it_lies(vision, ssl_field, paper_camera, range_m, bearing):
    vision.forget()
    ball = vision.look(frame_with(paper_camera, ssl_field, ball_at(ssl_field, range_m, bearing))).ball
    assert ball is not None
    off = np.array([ball.x_m - range_m * math.cos(bearing), ball.y_m - range_m * math.sin(bearing)])
    assert np.hypot(*off) < 0.02
    assert (np.linalg.eigvalsh(ball.covariance) > 0).all()
    assert not ball.covariance.flags.writeable
    pixel = paper_camera.point_to_pixel([ball.x_m, ball.y_m, ssl_field.ball_radius_m])
    np.testing.assert_allclose((ball.u_px, ball.v_px), pixel, atol=1e-6)


@pytest.mark.parametrize(
    "changes",
    [{"mirrored": True, "heading_rad": 1.0}, {"offset_m": (0.05, 0.03)}, {"tilt_rad": (0.03, -0.02)}],
    ids=["mirrored", "offset", "tilt"],
)
def test_other_cameras_find_it_too(ssl_field, changes):
    camera = dataclasses.replace(sekimori_camera(), **changes)
    frame = frame_with(camera, ssl_field, ball_at(ssl_field, 0.4, 2.5))
    ball = Vision(ssl_field, camera).look(frame).ball
    assert ball is not None
    assert math.hypot(ball.x_m - 0.4 * math.cos(2.5), ball.y_m - 0.4 * math.sin(2.5)) < 0.02


@pytest.mark.parametrize("bearing", [0.0, 0.9, 2.4, -1.7])
@pytest.mark.parametrize("pressed", [False, True], ids=["alone", "before another robot"])
def test_a_ball_that_touches_the_robot_is_found_and_blocks_nothing(vision, ssl_field, paper_camera, bearing, pressed):
    # before it is the robot itself, and behind it may be another one
    held_m = 0.09 + ssl_field.ball_radius_m
    x, y = POSE.transform([(held_m + 0.1) * math.cos(bearing), (held_m + 0.1) * math.sin(bearing)])
    boxes = (Box(float(x), float(y), POSE.theta_rad + bearing),) if pressed else ()
    vision.forget()
    seen = vision.look(frame_with(paper_camera, ssl_field, ball_at(ssl_field, held_m, bearing), boxes))
    assert seen.ball is not None
    assert math.hypot(seen.ball.x_m - held_m * math.cos(bearing), seen.ball.y_m - held_m * math.sin(bearing)) < 0.01
    ahead = int(np.argmin(np.abs(np.remainder(seen.free_space.bearing_rad - bearing + math.pi, math.tau) - math.pi)))
    assert seen.free_space.range_m[ahead] > (held_m if pressed else 0.3)


def test_no_ball_is_seen_among_red_and_orange_boxes(vision, ssl_field, paper_camera):
    condition = dataclasses.replace(CONDITIONS["nominal"], ball_rate=0.0, obstacles=(6, 8))
    for one in sample(ssl_field, paper_camera, condition, seed=9, count=12, supersample=2):
        vision.forget()
        assert vision.look(one.frame).ball is None
    boxes = tuple(
        Box(0.2 + 0.4 * math.cos(b), -0.1 + 0.4 * math.sin(b), b, color_bgr=(30, 110, 235)) for b in (0, 2, 4)
    )
    vision.forget()
    assert vision.look(frame_with(paper_camera, ssl_field, boxes=boxes)).ball is None


def test_most_balls_in_the_open_are_found(vision, nominal_samples):
    found = []
    for one in nominal_samples:
        vision.forget()
        ball = vision.look(one.frame).ball
        if one.scene.ball is None:
            assert ball is None
            continue
        x, y = one.pose.inverse().transform([one.scene.ball.x_m, one.scene.ball.y_m])
        found.append(ball is not None and math.hypot(ball.x_m - x, ball.y_m - y) < 0.05)
    assert len(found) >= 3
    assert np.mean(found) > 0.7


def test_a_ball_under_the_mask_is_not_seen(ssl_field, paper_camera):
    frame = frame_with(paper_camera, ssl_field, ball_at(ssl_field, 0.4, 2.5))
    seen = Vision(ssl_field, paper_camera).look(frame).ball
    mask = np.zeros((220, 256), dtype=np.uint8)
    cv2.circle(mask, (round(seen.u_px), round(seen.v_px)), 12, 255, -1)
    assert Vision(ssl_field, paper_camera, mask=mask).look(frame).ball is None


def test_the_ball_blocks_nothing(vision, ssl_field, paper_camera):
    vision.forget()
    bare = vision.look(frame_with(paper_camera, ssl_field)).free_space
    vision.forget()
    with_ball = vision.look(frame_with(paper_camera, ssl_field, ball_at(ssl_field, 0.4, 2.5))).free_space
    rings = np.searchsorted(vision.grid.ring_bounds_m, [bare.range_m, with_ball.range_m])
    assert np.abs(rings[0] - rings[1]).max() <= 2


def test_a_white_ball_is_not_looked_for(ssl_field, paper_camera):
    white = dataclasses.replace(ssl_field, ball_color="white")
    frame = frame_with(paper_camera, ssl_field, ball_at(ssl_field, 0.4, 2.5))
    assert Vision(white, paper_camera).look(frame).ball is None


def test_a_camera_without_a_height_still_finds_it(ssl_field, paper_camera):
    from robocup_vision.camera import Table

    radius = np.linspace(26.0, 112.0, 200)
    table = Table(radius, 1 / paper_camera.floor_range.inverse_range_per_m(radius))
    camera = dataclasses.replace(paper_camera, floor_range=table)
    assert camera.height_m is None
    frame = frame_with(paper_camera, ssl_field, ball_at(ssl_field, 0.4, 2.5))
    ball = Vision(ssl_field, camera).look(frame).ball
    assert ball is not None
    assert math.hypot(ball.x_m, ball.y_m) == pytest.approx(0.4, rel=0.15)
    # the usual height of a mirror stands for its own
    off = np.array([ball.x_m - 0.4 * math.cos(2.5), ball.y_m - 0.4 * math.sin(2.5)])
    assert off @ np.linalg.solve(ball.covariance, off) < 9.0
    known = Vision(ssl_field, paper_camera).look(frame).ball
    assert np.linalg.det(ball.covariance) > np.linalg.det(known.covariance)


def test_a_doubtful_ball_is_found_only_near_where_one_was(ssl_field, paper_camera, monkeypatch):
    view = PolarView(paper_camera)
    bare = frame_with(paper_camera, ssl_field)
    table = build_color_table(learn_colors(cv2.blur(view.sample(bare), (3, 3)), view.valid, ssl_field))
    start, near, far = (
        frame_with(paper_camera, ssl_field, ball_at(ssl_field, 0.5, bearing)) for bearing in (0.0, 0.25, 2.5)
    )
    # less carpet in view makes every ball more doubtful
    sure_floor, doubtful_floor = 3.5, 1.5

    def found(finder, frame, near_floor_nats):
        return finder.find(BallFrame(frame, paper_camera, table=table, near_floor_nats=near_floor_nats))

    def nats(frame, near_floor_nats):
        return found(BallFinder(ssl_field, paper_camera), frame, near_floor_nats)[0].log_likelihood_ratio

    doubtful = max(nats(frame, doubtful_floor) for frame in (near, far))
    needed = (doubtful + nats(start, sure_floor)) / 2
    assert needed > doubtful
    monkeypatch.setattr(colored, "_MIN_LOG_LIKELIHOOD_RATIO", needed)
    finder = BallFinder(ssl_field, paper_camera)
    assert not found(finder, near, doubtful_floor)
    for frame, is_found in ((near, True), (far, False)):
        finder.forget()
        assert found(finder, start, sure_floor)
        assert bool(found(finder, frame, doubtful_floor)) is is_found
