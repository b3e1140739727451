"""Balls that a known pose puts beyond the walls are none, but for those that may lie before them."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.vision import Vision


@pytest.fixture(scope="module")
def pipeline():
    camera = PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.2, tilt_rad=-0.3)
    return Vision(load_field("ssl_2001"), camera, method="floor")._pipeline


@pytest.mark.parametrize(
    ("beyond_m", "along_std_m", "is_kept"),
    [(-0.2, 0.01, True), (0.2, 0.1, False), (0.2, 0.3, True), (1.0, 0.9, False), (1.0, 1.1, True)],
)
def test_a_ball_stays_where_it_would_be_on_the_floor_one_standard_deviation_nearer(
    pipeline, beyond_m, along_std_m, is_kept
):
    # towards the wall at the left
    wall_m = pipeline.field.width_m / 2
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    covariance = along_std_m**2 * np.outer(along, along) + 1e-4 * np.outer(across, across)
    robot = Pose2(0.0, 0.0, np.pi / 2 - np.arctan2(0.6, 0.8))
    x, y = (wall_m + beyond_m) * along
    ball = Ball(x, y, covariance, 100.0, 50.0)
    assert bool(pipeline._on_floor((ball,), robot)) == is_kept
