"""Order of a frame's channels: RGB frames as good as BGR ones where it is said, and told where it is not."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera, load_camera
from robocup_vision.estimates import SwappedChannels
from robocup_vision.geometry import Pose2
from robocup_vision.pipeline.frames import to_bgr
from robocup_vision.vision import Vision
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import Ball, Scene
from sim2d.sensors.match_camera import MATCH_SENSOR

SAMPLES = Path(__file__).resolve().parents[2] / "images" / "omni_ssl_2001"


@pytest.fixture(scope="module")
def sample_frames():
    return [cv2.imread(str(path), cv2.IMREAD_COLOR) for path in sorted((SAMPLES / "images").iterdir())]


@pytest.fixture(scope="module")
def visions():
    field, camera = load_field("ssl_2001"), load_camera(SAMPLES / "camera.toml")
    return {channels: Vision(field, camera, channels=channels) for channels in ("bgr", "rgb")}


def look_alone(vision, frame):
    vision.forget()
    return vision.look(frame)


def test_rgb_frames_give_the_very_view_of_bgr_frames(visions, sample_frames):
    for frame in sample_frames[:5]:
        one = look_alone(visions["bgr"], frame)
        # reversed views, as libraries hand them out, and plain arrays
        for swapped in (frame[..., ::-1], np.ascontiguousarray(frame[..., ::-1])):
            other = look_alone(visions["rgb"], swapped)
            assert other.pose.candidates == one.pose.candidates
            np.testing.assert_array_equal(other.marks, one.marks)
            assert [ball.u_px for ball in other.balls] == [ball.u_px for ball in one.balls]
            assert not other.warnings


def test_swapped_channels_are_told_and_never_give_half_a_turn(visions, sample_frames):
    assert len(sample_frames) == 20
    for frame in sample_frames:
        right = look_alone(visions["bgr"], frame)
        assert right.pose
        assert not right.warnings
        for channels, given in (("bgr", frame[..., ::-1]), ("rgb", frame)):
            view = look_alone(visions[channels], given)
            assert isinstance(view.pose, SwappedChannels)
            assert view.warnings == (view.pose.reason,)
            assert "red and blue swapped" in view.pose.reason


def test_the_warning_comes_once_until_all_is_forgotten(visions, sample_frames):
    vision, swapped = visions["bgr"], sample_frames[0][..., ::-1]
    vision.forget()
    assert [len(vision.look(swapped).warnings) for _ in range(3)] == [1, 0, 0]
    vision.forget()
    assert len(vision.look(swapped).warnings) == 1


def test_no_prior_makes_swapped_channels_decide(visions, sample_frames):
    vision, frame = visions["bgr"], sample_frames[0]
    pose = look_alone(vision, frame).pose.pose
    vision.forget()
    assert not vision.look(frame[..., ::-1], prior=pose.half_turn()).pose


@pytest.mark.slow
@pytest.mark.parametrize("condition", ["nominal", "crowd", "bad_day"])
def test_right_frames_never_warn_and_swapped_ones_never_mislead(ssl_field, paper_camera, condition):
    """Only this finds a false alarm about swapped channels, or a wrong pose by them, in hard light and crowds."""
    vision = Vision(ssl_field, paper_camera)
    for one in sample(ssl_field, paper_camera, CONDITIONS[condition], seed=18, count=8, supersample=2):
        assert not look_alone(vision, one.frame).warnings
        swapped = look_alone(vision, one.frame[..., ::-1])
        if swapped.pose and len(swapped.pose.candidates) == 1:
            assert swapped.pose.pose.error_to(one.pose)[0] < 0.1


def test_goals_that_are_each_others_swapped_colour_decide_as_ever(ssl_field, paper_camera):
    """Yellow with red and blue swapped is cyan: such goals cannot tell."""
    goals = tuple(
        dataclasses.replace(goal, color=color) for goal, color in zip(ssl_field.goals, ("yellow", "cyan"), strict=True)
    )
    field = dataclasses.replace(ssl_field, goals=goals)
    one = next(iter(sample(field, paper_camera, CONDITIONS["nominal"], seed=4, count=1, supersample=2)))
    view = Vision(field, paper_camera).look(one.frame)
    assert not view.warnings
    assert len(view.pose.candidates) == 1
    assert view.pose.pose.error_to(one.pose)[0] < 0.02


def test_an_order_that_is_none_is_refused():
    with pytest.raises(ArgumentError, match=r"channels must be 'bgr' or 'rgb', got 'RGB'"):
        Vision(load_field("ssl_2001"), load_camera(SAMPLES / "camera.toml"), channels="RGB")


def test_a_plain_bgr_frame_is_not_copied(sample_frames):
    frame = sample_frames[0]
    assert to_bgr(frame, "bgr") is frame
    np.testing.assert_array_equal(to_bgr(frame, "rgb"), frame[..., ::-1])


GOALS = Path(__file__).resolve().parents[2] / "images" / "goal_four_legged"
# of the sample pictures, some with a ball on the field, in three places
WITH_BALL = (3, 23, 24)


@pytest.fixture(scope="module")
def goal_frames():
    paths = sorted((GOALS / "images").iterdir())
    return [cv2.imread(str(paths[n]), cv2.IMREAD_COLOR) for n in WITH_BALL]


@pytest.fixture(scope="module")
def goal_vision():
    return Vision(load_field("four_legged_2007"), load_camera(GOALS / "camera.toml"))


def test_a_goal_alone_never_decides_against_a_ball_of_swapped_color(goal_vision, goal_frames):
    """Yellow with red and blue swapped is cyan: the goal would turn the pose by half a turn."""
    for frame in goal_frames:
        right = look_alone(goal_vision, frame)
        assert len(right.pose.candidates) == 1
        assert goal_vision.swapped_channels_nats < -1
        view = look_alone(goal_vision, frame[..., ::-1])
        assert goal_vision.swapped_channels_nats > 1
        assert len(view.pose.candidates) == 2
        assert min(view.pose.candidates, key=lambda pose: pose.error_to(right.pose.pose)[0]) != view.pose.pose


def test_swapped_channels_of_a_forward_camera_are_told_by_the_ball(goal_vision, goal_frames):
    goal_vision.forget()
    views = [goal_vision.look(frame[..., ::-1]) for frame in goal_frames]
    assert [len(view.warnings) for view in views] == [0, 0, 1]
    assert isinstance(views[-1].pose, SwappedChannels)
    assert views[-1].warnings == (views[-1].pose.reason,)
    assert "the ball looks as with red and blue swapped" in views[-1].pose.reason
    goal_vision.forget()
    assert not any(goal_vision.look(frame).warnings for frame in goal_frames)


def test_goals_of_two_colors_tell_swapped_channels_to_a_forward_camera(ssl_field):
    """Blue and yellow panels: with red and blue swapped, the goal does not decide on the half."""
    size = (208, 160)
    camera = PinholeCamera(size, (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.21, roll_rad=0.0)
    pose = Pose2(0.1, 0.0, 0.05)
    light = render_pinhole(camera, Scene(ssl_field), pose, supersample=2)
    frame = MATCH_SENSOR.expose(light, np.random.default_rng(3))
    vision = Vision(ssl_field, camera)
    view = vision.look(frame, prior=pose)
    assert view.pose
    assert not view.warnings
    assert vision.swapped_channels_nats < 0
    vision.forget()
    view = vision.look(frame[..., ::-1], prior=pose)
    assert isinstance(view.pose, SwappedChannels)
    assert "goals look" in view.pose.reason
    assert view.measurement is None
    assert view.warnings == (view.pose.reason,)


def test_suspected_channels_leave_the_half_open_and_change_no_earlier_view():
    """A ball of swapped colour before the goal: with red and blue swapped, yellow is another team's cyan."""
    field, pose = load_field("four_legged_2007"), Pose2(0.8, 0.2, 0.05)
    camera = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.21, roll_rad=0.0)
    light = render_pinhole(camera, Scene(field, ball=Ball(1.5, 0.3, field.ball_radius_m)), pose, supersample=2)
    frame = MATCH_SENSOR.expose(light, np.random.default_rng(3))
    vision = Vision(field, camera)
    right = vision.look(frame, prior=pose)
    vision.forget()
    suspected = vision.look(frame[..., ::-1], prior=pose)
    assert not suspected.warnings
    # a measurement is worked out when it is asked for: the right frame's only now
    for view, halves in ((right, 1), (suspected, 2)):
        for estimate in (view.pose, view.measurement):
            assert len(estimate.candidates) == halves
            assert estimate.pose.error_to(pose)[0] < 0.05
    for estimate in (suspected.pose, suspected.measurement):
        assert estimate.candidates[1].error_to(pose.half_turn())[0] < 0.05
