"""The hue of things that stand on the floor: of their paint; none of what is grey, black or the floor's own."""

import math
from dataclasses import replace

import cv2
import numpy as np

from field_models import load_field
from robocup_vision.camera import PinholeCamera, Table
from robocup_vision.geometry import Pose2
from robocup_vision.perception.hues import STEP_PX, hues_of, thumbnail_of
from robocup_vision.vision import Vision
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Robot, Scene
from sim2d.rendering.sensor import Sensor

FIELD = load_field("ssl_division_b")
CAMERA = PinholeCamera(
    (640, 480), (600.0, 600.0), (319.5, 239.5), 0.25, pan_rad=0.0, tilt_rad=-0.25, roll_rad=0.0, tilt_std_rad=0.005
)
POSE = Pose2(-1.0, 0.3, 0.2)
PAINTS = {"red": (40, 40, 200), "blue": (190, 80, 35), "magenta": (190, 50, 200), "yellow": (40, 200, 220)}


def hue_of_paint(name):
    """As OpenCV has it, radians."""
    return 2 * math.radians(int(cv2.cvtColor(np.uint8([[PAINTS[name]]]), cv2.COLOR_BGR2HSV)[0, 0, 0]))


def seen_robots(colors_bgr, places):
    """Return what is seen of robots of some colours at places in the robot's frame."""
    robots = [
        Robot(*POSE.transform(place).tolist(), FIELD.robot_radius_m, color_bgr=color, marker_bgr=color)
        for color, place in zip(colors_bgr, places, strict=True)
    ]
    light = render_pinhole(CAMERA, Scene(FIELD, robots=tuple(robots)), POSE, supersample=2)
    frame = Sensor(noise_sigma=4.0, blur_px=0.7).expose(light, np.random.default_rng(0))
    view = Vision(FIELD, CAMERA).look(frame)
    # the frame may be the driver's buffer: what is asked for later does not depend on it
    frame[:] = 0
    found = [min(view.obstacles, key=lambda one: math.dist((one.x_m, one.y_m), place)) for place in places]
    assert all(math.dist((one.x_m, one.y_m), place) < 0.2 for one, place in zip(found, places, strict=True))
    return found


def test_painted_robots_have_the_hue_of_their_paint():
    robots = seen_robots(PAINTS.values(), [(1.2, y) for y in (-0.45, -0.15, 0.15, 0.45)])
    for name, robot in zip(PAINTS, robots, strict=True):
        assert robot.hue_rad is not None
        assert abs(math.remainder(robot.hue_rad - hue_of_paint(name), math.tau)) < 0.15
        assert 0.0 <= robot.hue_rad < math.tau


def test_what_is_black_grey_or_white_has_no_hue():
    robots = seen_robots([(tone, tone, tone) for tone in (30, 120, 200)], [(1.0, y) for y in (-0.35, 0.0, 0.35)])
    assert [robot.hue_rad for robot in robots] == [None, None, None]


def test_a_range_is_as_good_as_it_says():
    places = [(0.6, 0.15), (1.0, -0.15), (1.6, 0.05)]
    for (x, y), robot in zip(places, seen_robots([(60, 60, 60)] * 3, places), strict=True):
        # the middle of a disc's near side, seen whole, lies so far before its centre
        away_m = math.hypot(x, y)
        true_m = away_m - math.pi / 4 * FIELD.robot_radius_m
        assert 0.0 < robot.range_std_m < 0.1 * away_m
        assert abs(robot.range_m - true_m) < 3.5 * robot.range_std_m + 0.005


def test_a_mirror_camera_tells_hues_where_its_height_is_known(ssl_field, paper_camera):
    pose = Pose2(-0.5, 0.0, 0.3)
    robot = Robot(0.1, 0.05, FIELD.robot_radius_m, color_bgr=PAINTS["magenta"], marker_bgr=PAINTS["magenta"])
    light = MirrorRenderer(paper_camera, 2).render(Scene(ssl_field, robots=(robot,)), pose)
    frame = Sensor(noise_sigma=4.0, blur_px=0.7).expose(light, np.random.default_rng(0))
    place = pose.inverse().transform((robot.x_m, robot.y_m))
    obstacles = Vision(ssl_field, paper_camera).look(frame).obstacles
    found = min(obstacles, key=lambda one: math.dist((one.x_m, one.y_m), place))
    assert found.hue_rad is not None
    assert abs(math.remainder(found.hue_rad - hue_of_paint("magenta"), math.tau)) < 0.25
    radius_px = np.linspace(*paper_camera.usable_radius_px, 40)
    table = Table(radius_px, 1.0 / paper_camera.floor_range.inverse_range_per_m(radius_px))
    seen = Vision(ssl_field, replace(paper_camera, floor_range=table)).look(frame).obstacles
    assert seen
    assert all(one.hue_rad is None for one in seen)


def test_a_thing_whose_foot_is_not_in_view_has_no_hue():
    blue = np.full((480, 640, 3), PAINTS["blue"], dtype=np.uint8)
    thumbnail = thumbnail_of(blue)
    assert thumbnail.shape == (480 // STEP_PX, 640 // STEP_PX, 3)
    places = np.array([(1.0, 0.0), (0.1, 0.0), (-1.0, 0.0)])
    # all of the picture is of the floor's hue, or nothing of the thing is in it
    assert hues_of(thumbnail, CAMERA, places, np.full(3, 0.18), 0.09) == (None, None, None)
