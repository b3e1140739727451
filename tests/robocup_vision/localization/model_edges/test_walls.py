"""A pinhole camera among walls: where the floor ends, and the pose that it tells."""

import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.vision import Vision
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Box, Scene
from sim2d.rendering.sensor import Sensor

STD = np.array([0.1, 0.1, math.radians(5)])
INTO_A_CORNER, ALONG_THE_FIELD = Pose2(0.4, 0.1, 0.6), Pose2(-0.9, 0.0, 0.0)


@pytest.fixture(scope="module")
def field():
    return load_field("ssl_2001")


@pytest.fixture(scope="module")
def camera():
    return PinholeCamera((320, 240), (220.0, 220.0), (159.5, 119.5), 0.2, offset_m=(0.09, 0.0), tilt_rad=-0.35)


@pytest.fixture(scope="module")
def vision(field, camera):
    return Vision(field, camera, method="floor")


def rendered(camera, field, pose, *boxes):
    light = render_pinhole(camera, Scene(field, boxes=boxes), pose, supersample=2)
    return Sensor().expose(light, np.random.default_rng(1))


def prior_at(pose):
    return PoseEstimate(pose, np.diag(STD**2), 1.0, 0.0)


@pytest.mark.slow
def test_priors_are_refined_where_the_walls_are(field, camera, vision):
    """Only this finds a pose by walls that is no better than its prior, or surer than it is right."""
    rng = np.random.default_rng(11)
    before, after, distances = [], [], []
    for truth in (INTO_A_CORNER, ALONG_THE_FIELD, Pose2(-0.3, -0.3, 2.4), Pose2(0.0, 0.2, -1.2)):
        frame = rendered(camera, field, truth)
        for _ in range(3):
            start = Pose2(*(truth.array + rng.normal(0.0, STD)).tolist())
            vision.forget()
            view = vision.look(frame, prior=prior_at(start))
            assert view.pose
            off = view.pose.pose.array - truth.array
            distances.append(off @ np.linalg.solve(view.pose.covariance, off))
            before.append(start.error_to(truth))
            after.append(view.pose.pose.error_to(truth))
    assert (np.mean(after, axis=0) < 0.5 * np.mean(before, axis=0)).all()
    # 3 degrees of freedom, 99.9 %
    assert max(distances) < 16.3


def test_a_box_before_the_wall_does_not_draw_the_pose(field, camera, vision):
    frame = rendered(camera, field, INTO_A_CORNER, Box(0.75, 0.3, 0.1, 0.1, 0.2, 0.3))
    vision.forget()
    view = vision.look(frame, prior=prior_at(Pose2(0.46, 0.04, 0.63)))
    assert view.pose
    distance, turn = view.pose.pose.error_to(INTO_A_CORNER)
    assert distance < 0.05
    assert turn < math.radians(2)


def test_without_a_prior_the_answer_is_right_or_none(field, camera, vision):
    vision.forget()
    view = vision.look(rendered(camera, field, INTO_A_CORNER))
    if view.pose:
        assert min(pose.error_to(INTO_A_CORNER)[0] for pose in view.pose.candidates) < 0.05
    # the next frame of a robot that was located goes on from there
    assert vision.look(rendered(camera, field, INTO_A_CORNER), prior=INTO_A_CORNER).pose
    assert vision.look(rendered(camera, field, INTO_A_CORNER), odometry=Pose2(0.0, 0.0, 0.0)).pose


def test_a_prior_from_elsewhere_is_contradicted(field, camera, vision):
    vision.forget()
    view = vision.look(rendered(camera, field, ALONG_THE_FIELD), prior=prior_at(Pose2(1.0, 0.5, 2.0)))
    assert isinstance(view.pose, NotLocated)
    assert "places on edges" in view.pose.reason


def test_no_floor_gives_no_pose(field, camera, vision):
    vision.forget()
    assert not vision.look(np.zeros((240, 320, 3), dtype=np.uint8), prior=prior_at(INTO_A_CORNER)).pose
    upwards = Vision(field, dataclasses.replace(camera, tilt_rad=0.8), method="floor")
    assert not upwards.look(rendered(camera, field, INTO_A_CORNER)).pose


def test_masked_pixels_make_no_edge(field, camera):
    mask = np.zeros((240, 320), dtype=np.uint8)
    mask[:, 220:] = 1
    vision = Vision(field, camera, method="floor", mask=mask)
    frame = rendered(camera, field, INTO_A_CORNER)
    changed = frame.copy()
    changed[mask > 0] = 255
    one = vision.look(frame, prior=prior_at(INTO_A_CORNER))
    vision.forget()
    other = vision.look(changed, prior=prior_at(INTO_A_CORNER))
    assert one.pose
    assert one.pose.pose == other.pose.pose


def test_what_does_not_bound_or_tilt_is_refused(field, camera):
    with pytest.raises(ArgumentError, match="not bounded"):
        Vision(load_field("spl_2020"), camera, method="floor")
    with pytest.raises(ArgumentError, match="method 'floor' needs a camera whose tilt_rad is known"):
        Vision(field, camera.with_orientation(None, None, None), method="floor")
