"""Poses found without a prior where nobody knows the camera's tilt: by the lines of one frame."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from field_models import load_field
from robocup_vision import NotLocated, Vision
from robocup_vision.geometry import Pose2
from robocup_vision.localization.model_edges.finder import TiltedPose
from robocup_vision.localization.model_edges.tilt_finder import TiltFinder
from sim2d.rendering.goal.scenes import nao_camera
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room, Scene
from sim2d.rendering.sensor import Sensor

FIELD = load_field("spl_2020")
CAMERA = nao_camera()
# across the centre circle with one post at the border; the penalty area; a whole goal behind the circle, looking up
PLACES = [(Pose2(-1.4, -1.2, 0.75), -0.17), (Pose2(1.4, 1.0, -0.2), -0.35), (Pose2(2.6, 0.2, -3.1), 0.03)]


@lru_cache
def frame_at(pose, tilt_rad, seed=4, field=FIELD, roll_rad=0.02):
    held = replace(CAMERA, pan_rad=0.0, tilt_rad=tilt_rad, roll_rad=roll_rad, height_m=0.44)
    light = render_pinhole(held, Scene(field, room=Room(seed=seed), carpet_margin_m=0.2), pose, supersample=2)
    return Sensor(noise_sigma=3.0, blur_px=0.6).expose(light, np.random.default_rng(seed))


def in_sun_and_shade(frame):
    """Bleach the right half of a frame, as glare does, and darken the left."""
    bleached = frame.astype(float)
    bleached[:, 320:] = 90.0 + bleached[:, 320:] * 0.75
    bleached[:, :320] *= 0.6
    return np.clip(bleached, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def finder():
    return TiltFinder(FIELD, CAMERA)


def nearest(candidates, pose):
    """Error of the nearest of some poses, each of which stands for its half turn, too."""
    return min(one.error_to(pose, symmetric=True) for one in candidates)


@pytest.mark.parametrize(("pose", "tilt_rad"), PLACES)
@pytest.mark.parametrize("light", [np.asarray, pytest.param(in_sun_and_shade, marks=pytest.mark.slow)])
def test_place_and_tilt_are_found_by_the_lines(finder, pose, tilt_rad, light):
    """Sun and shade alone find a search that needs a carpet of one tone."""
    answer = finder.find(light(frame_at(pose, tilt_rad)))
    assert answer
    off_m, off_rad = nearest(answer.estimate.candidates, pose)
    assert off_m < 0.03
    assert off_rad < 0.01
    oriented = answer.as_fitted(answer.file_camera)
    assert oriented.tilt_rad == pytest.approx(tilt_rad, abs=0.01)
    assert oriented.height_m == pytest.approx(0.44, abs=0.015)


def test_a_frame_without_lines_is_not_located(finder):
    bare = replace(FIELD, lines=np.empty((0, 4)), arcs=np.empty((0, 5)))
    assert isinstance(finder.find(frame_at(*PLACES[0], field=bare)), NotLocated)
    assert isinstance(finder.find(np.zeros((480, 640, 3), dtype=np.uint8)), NotLocated)


def test_vision_finds_half_a_goal_s_picture_and_starts_with_the_half_that_a_prior_names():
    pose, tilt_rad = PLACES[0]
    vision = Vision(FIELD, CAMERA)
    frame = frame_at(pose, tilt_rad)
    for prior in (pose, pose.half_turn()):
        vision.forget()
        view = vision.look(frame, prior=prior)
        assert view.pose
        assert view.pose.pose.error_to(prior)[0] < 0.03
        assert view.camera.tilt_rad == pytest.approx(tilt_rad, abs=0.01)


def test_a_held_pose_keeps_its_tilt_in_a_half_turn():
    held = TiltedPose(1.0, 2.0, 0.5, -0.2, 0.1)
    assert held.half_turn() == TiltedPose(-1.0, -2.0, 0.5 + math.pi, -0.2, 0.1)
    assert held.half_turn().error_to(Pose2(1.0, 2.0, 0.5).half_turn()) == pytest.approx((0.0, 0.0))


def test_bright_stripes_beyond_the_field_move_no_pose(finder):
    pose, tilt_rad = Pose2(-1.4, 0.0, 0.6), -0.2
    y = FIELD.width_m / 2 + 0.45
    striped = replace(FIELD, lines=np.vstack([FIELD.lines, [[-4.5, y, 4.5, y]]]))
    frame = frame_at(pose, tilt_rad, field=striped)
    answer = finder.find(frame)
    assert answer
    assert nearest(answer.estimate.candidates, pose)[0] < 0.03
