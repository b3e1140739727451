"""The map made from a short run: poses near the truth, landmarks where the hall has surfaces, drift accounted for."""

import numpy as np
import pytest

from field_models.errors import ArgumentError, FrameError
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.mapping.stereo_mapper import StereoMapper
from sim2d.rendering.hall.runs import HALL_RIG


def test_poses_are_within_millimetres(short_run):
    assert all(step.pose for step in short_run.steps)
    for pose, frame in zip(short_run.mapper.poses, short_run.frames, strict=True):
        error_m, error_rad = pose.error_to(frame.pose)
        assert error_m < 0.006
        assert error_rad < 0.003


def test_most_stereo_points_are_known_landmarks(short_run):
    for step in short_run.steps[1:]:
        assert step.matched > 0.4 * step.stereo_points > 40


def test_landmarks_lie_within_the_hall(short_run):
    positions = short_run.landmarks.positions_m
    inside = (np.abs(positions[:, :2]) < (4.6, 3.6)).all(axis=1) & (positions[:, 2] > -0.1) & (positions[:, 2] < 3.1)
    assert inside.mean() > 0.97
    assert len(positions) > 150


def test_drift_grows_from_nothing(short_run):
    std = np.sqrt(np.trace(short_run.landmarks.trajectory_cov[:, :2, :2], axis1=1, axis2=2))
    assert std[0] == 0
    assert 0 < std[1] < std[-1] < 0.02


def test_every_landmark_was_seen_twice_and_has_a_view(short_run):
    landmarks = short_run.landmarks
    assert (landmarks.seen >= 2).all()
    assert set(landmarks.view_landmark.tolist()) == set(range(len(landmarks)))


def test_a_moment_that_shows_something_else_is_left_out(short_run):
    mapper = StereoMapper(HALL_RIG, short_run.frames[0].pose)
    mapper.add(*short_run.frames[0].images)
    grey = np.full((240, 320, 3), 90, dtype=np.uint8)
    step = mapper.add(grey, grey, grey, odometry=Pose2(0.07, 0.0, 0.0))
    assert isinstance(step.pose, NotLocated)
    assert len(mapper.poses) == 1
    # the odometry of the moment left out is not lost
    back = mapper.add(*short_run.frames[2].images, odometry=Pose2(0.07, 0.0, 0.08))
    assert back.pose.pose.error_to(short_run.frames[2].pose)[0] < 0.01


def test_a_single_moment_makes_no_map(short_run):
    mapper = StereoMapper(HALL_RIG, Pose2(0.0, 0.0, 0.0))
    mapper.add(*short_run.frames[0].images)
    with pytest.raises(ArgumentError, match="no landmark was seen twice"):
        mapper.finish()


def test_wrong_frames_are_refused(short_run):
    mapper = StereoMapper(HALL_RIG, Pose2(0.0, 0.0, 0.0))
    with pytest.raises(FrameError, match=r"\(240, 320, 3\)"):
        mapper.add(*(np.zeros((120, 160, 3), dtype=np.uint8),) * 3)
