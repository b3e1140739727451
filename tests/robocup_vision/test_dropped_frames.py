"""Frames that the camera did not give: the belief is predicted, the free floor carried on, nothing is raised."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from strategies import numbers

from field_models.errors import ArgumentError
from robocup_vision.avoidance.recent_free_space import carry_free_space
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.vision import Vision

STEP = Pose2(0.02, 0.0, 0.1)


@pytest.fixture(scope="module")
def memory_vision(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera, memory=Memory.of_everything(ssl_field))


def test_belief_is_predicted_and_free_space_carried_on(memory_vision, nominal_samples):
    vision = memory_vision
    vision.forget()
    first = vision.look(nominal_samples[0].frame, 0.0, Pose2(0, 0, 0))
    view = vision.look(None, 0.03, STEP)
    assert isinstance(view.pose, NotLocated)
    assert view.pose.reason == "no frame: the camera gave none this time"
    expected = first.belief.pose.pose.compose(STEP)
    assert sum(view.belief.pose.pose.error_to(expected)) < 1e-6
    assert view.belief.t_s == 0.03
    np.testing.assert_array_equal(view.free_space.range_m, carry_free_space(first.free_space, STEP).range_m)
    assert (view.balls, view.obstacles, view.warnings) == ((), (), ())
    assert vision.look(nominal_samples[0].frame, 0.06, Pose2(0, 0, 0)).pose


def test_the_free_space_of_long_ago_is_free_no_more(memory_vision, nominal_samples):
    vision = memory_vision
    vision.forget()
    seen = vision.look(nominal_samples[0].frame, 0.0, Pose2(0, 0, 0)).free_space
    kept = vision.look(None, 0.4, Pose2(0, 0, 0)).free_space
    np.testing.assert_array_equal(kept.range_m, seen.range_m)
    gone = vision.look(None, 0.6, Pose2(0, 0, 0)).free_space
    assert gone.range_m.max() < 0.2
    assert len(gone.range_m) == len(seen.range_m)


def test_without_times_frames_count(ssl_field, paper_camera, nominal_samples):
    vision = Vision(ssl_field, paper_camera)
    assert vision.look(None).free_space.range_m.max() < 0.2  # nothing has been seen yet
    seen = vision.look(nominal_samples[0].frame).free_space
    ranges = [vision.look(None).free_space.range_m for _ in range(20)]
    np.testing.assert_array_equal(ranges[0], seen.range_m)
    assert ranges[-1].max() < 0.2
    # the motion of a dropped frame is not lost: the next prior is the last pose moved by all of it
    assert vision.look(nominal_samples[0].frame, odometry=STEP).pose


def test_memory_needs_the_time_of_a_dropped_frame_too(memory_vision):
    with pytest.raises(ArgumentError, match="memory needs the time of a frame"):
        memory_vision.look(None)


def test_a_pinhole_camera_drops_frames_too(ssl_field):
    camera = PinholeCamera((160, 120), (150.0, 150.0), (79.5, 59.5), 0.3, pan_rad=0.0, tilt_rad=-0.4, roll_rad=0.0)
    vision = Vision(ssl_field, camera, method="field")
    frame = np.full((120, 160, 3), (50, 130, 45), dtype=np.uint8)
    seen = vision.look(frame).free_space
    view = vision.look(None, odometry=Pose2(0.0, 0.0, 0.2))
    assert not view.pose
    assert len(view.free_space.range_m) == len(seen.range_m)
    # what comes into view by the turn has not been seen
    assert view.free_space.range_m[-1] == 0.0
    assert view.free_space.range_m[0] > 0.0
    unknown = Vision("four_legged_2007", dataclasses.replace(camera, tilt_rad=None, pan_rad=None, roll_rad=None))
    assert len(unknown.look(None).free_space.range_m) == 0


@given(numbers(-0.3, 0.3), numbers(-0.1, 0.1))
def test_a_narrow_view_is_carried_by_what_it_saw(turn, forward):
    bearing = np.linspace(-0.5, 0.5, 21)
    wall = FreeSpace(bearing, 1.0 / np.cos(bearing))  # a wall across, 1 m ahead
    moved = carry_free_space(wall, Pose2(forward, 0.0, turn))
    known = moved.range_m > 0
    exact = (1.0 - forward) / np.cos(bearing + turn)
    assert (moved.range_m[known] <= exact[known] + 0.02).all()
    assert known.sum() >= 10
