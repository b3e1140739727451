"""What a view works out when it is asked for."""

from dataclasses import replace

import numpy as np
import pytest

from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.view import View

CAMERA = PinholeCamera((64, 48), (46.0, 46.0), (31.5, 23.5), 0.2)
ESTIMATE = PoseEstimate(Pose2(1.0, 0.2, 0.3), np.eye(3), 1.0, 0.0)


def view_with(measurement):
    none = np.empty(0)
    marks = np.empty((0, 0), dtype=np.uint8)
    free_space = FreeSpace(none, np.empty(0))
    pose = NotLocated("nothing to see")
    return View(pose, free_space, (), {}, np.empty(0), marks, np.empty(0), None, CAMERA, None, measurement=measurement)


def test_a_measurement_is_worked_out_once_and_only_when_asked_for():
    calls = []

    def measured():
        calls.append(1)
        return ESTIMATE

    view = view_with(measured)
    assert not calls
    assert view.measurement is view.measurement is ESTIMATE
    assert replace(view, t_s=1.0).measurement is ESTIMATE
    assert len(calls) == 1


@pytest.mark.parametrize("given", [None, ESTIMATE])
def test_a_measurement_may_be_handed_over_as_it_is(given):
    assert view_with(given).measurement is given
    assert View.measurement is None
