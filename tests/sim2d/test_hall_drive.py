"""A drive by landmarks alone: it ends where the map's run ends, and does not go on where nothing is to be seen."""

from itertools import pairwise

import numpy as np
import pytest

from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.landmarks.vision import LandmarkVision
from sim2d.hall_drive import PERIOD_S, SPEED_MPS, drive
from sim2d.rendering.hall.bustle import Bustle
from sim2d.rendering.hall.hall import HallLight
from sim2d.rendering.hall.runs import HALL_CAMERA, HALL_SENSOR

# a run through a hall is drawn and mapped
pytestmark = pytest.mark.slow


def test_a_robot_arrives_by_landmarks_alone(short_run):
    """Only this finds a drive by landmarks that leaves its path, or ends elsewhere."""
    path = short_run.mapper.poses[:4]
    start = path[0].compose(Pose2(0.0, 0.03, 0.02))
    vision = LandmarkVision(short_run.landmarks, HALL_CAMERA)
    bustle = Bustle((), HallLight(level=0.8))
    rng = np.random.default_rng(3)
    steps = list(drive(vision, short_run.hall, bustle, path, start, HALL_SENSOR, rng, limit_s=10.0))
    assert steps[0].truth == start
    assert steps[0].off_path_m == pytest.approx(0.03, abs=0.005)
    assert max(step.pose.pose.error_to(step.truth)[0] for step in steps) < 0.02
    assert steps[-1].truth.error_to(short_run.frames[3].pose)[0] < 0.05
    assert [step.t_s for step in steps] == pytest.approx([k * PERIOD_S for k in range(len(steps))])
    moved = [a.truth.error_to(b.truth)[0] for a, b in pairwise(steps)]
    assert 0.5 < max(moved) / (SPEED_MPS * PERIOD_S) < 1.6


def test_a_robot_that_sees_nothing_stands_still(short_run):
    """Only this finds a drive that goes on blindly."""
    path = short_run.mapper.poses
    vision = LandmarkVision(short_run.landmarks, HALL_CAMERA)
    dark = Bustle((), HallLight(level=0.0))
    rng = np.random.default_rng(3)
    steps = list(drive(vision, short_run.hall, dark, path, path[0], HALL_SENSOR, rng, limit_s=1.2))
    assert len(steps) == 3
    assert all(isinstance(step.pose, NotLocated) for step in steps)
    assert {step.truth for step in steps} == {path[0]}
