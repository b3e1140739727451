"""Frames that confirm nothing at first: followed in a second look, with the state of the follower that goes on."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from robocup_vision.estimates import EdgeState, PoseEstimate
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.second_look import SecondLook
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.vision import Vision

STD = np.array([0.05, 0.05, math.radians(2.0)])
BLUR_PX = 23


@pytest.fixture(scope="module")
def blurred_shot(spl_shot):
    """Show the penalty area while the robot turns: a frame of twice the size, blurred along its rows."""
    width, height = (2 * n for n in spl_shot.camera.size_px)
    frame = cv2.resize(spl_shot.frame, (width, height), interpolation=cv2.INTER_CUBIC)
    frame = cv2.blur(frame, (BLUR_PX, 9))
    camera = replace(
        spl_shot.camera,
        size_px=(width, height),
        focal_px=tuple(2 * f for f in spl_shot.camera.focal_px),
        center_px=tuple(2 * c + 0.5 for c in spl_shot.camera.center_px),
    )
    return replace(spl_shot, frame=frame, camera=camera)


def test_a_blurred_frame_is_followed_in_a_smaller_copy(blurred_shot):
    prior = PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0)
    whole = EdgeFollower(blurred_shot.field, blurred_shot.camera)
    before = whole.state
    assert not whole.follow(blurred_shot.frame, prior)
    follower = SecondLook(blurred_shot.field, blurred_shot.camera, EdgeSettings())
    answer = follower.follow(blurred_shot.frame, prior, 1 / 30, before)
    assert answer
    away, turn = answer.estimate.pose.error_to(blurred_shot.pose)
    assert away < 0.06
    assert turn < math.radians(1.5)
    camera = blurred_shot.camera
    assert answer.as_fitted(camera).tilt_rad - camera.tilt_rad == pytest.approx(-0.012, abs=0.006)
    # the nod found goes on in the follower of whole frames
    whole.state = follower.state
    assert whole.state.log_odds > 0.0
    assert whole.state.last_pose.error_to(answer.estimate.pose)[0] == pytest.approx(0.0, abs=1e-9)


def test_the_edges_are_told_in_pixels_of_the_whole_frame(blurred_shot):
    vision = Vision(blurred_shot.field, blurred_shot.camera)
    view = vision.look(blurred_shot.frame, prior=PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0))
    assert view.pose
    points = view.edge_points
    assert points.pixels[:, 0].max() > 0.6 * blurred_shot.camera.size_px[0]
    found = points.pixels[points.state == EdgeState.FOUND]
    rows, columns = found[:, 1].round().astype(int), found[:, 0].round().astype(int)
    inside = (columns >= 0) & (columns < 640) & (rows >= 0) & (rows < 480)
    # lines are brighter than the median of the picture, mostly
    light = blurred_shot.frame.astype(int)[..., 0]
    assert np.mean(light[rows[inside], columns[inside]] > np.median(light)) > 0.7


def test_a_small_frame_is_looked_at_in_its_own_size_only(fl_shot):
    prior = PoseEstimate(fl_shot.pose, np.diag(STD**2), 1.0, 0.0)
    before = EdgeFollower(fl_shot.field, fl_shot.camera).state
    answer = SecondLook(fl_shot.field, fl_shot.camera, EdgeSettings()).follow(fl_shot.frame, prior, 1 / 30, before)
    assert answer
    no_copy = EdgeSettings(copy_factors=(2, 3))
    assert not SecondLook(fl_shot.field, fl_shot.camera, no_copy).follow(fl_shot.frame, prior, 1 / 30, before)


def test_a_frame_without_a_field_confirms_nothing_in_a_second_look_either(blurred_shot):
    prior = PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0)
    before = EdgeFollower(blurred_shot.field, blurred_shot.camera).state
    noise = np.random.default_rng(2).integers(0, 256, blurred_shot.frame.shape).astype(np.uint8)
    follower = SecondLook(blurred_shot.field, blurred_shot.camera, EdgeSettings())
    assert not follower.follow(noise, prior, 1 / 30, before)
