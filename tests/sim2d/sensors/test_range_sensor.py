"""The range sensor: it sees what is higher than its plane, noisily, and misses an echo now and then."""

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Ball, Box, Robot, Scene
from sim2d.sensors.range_sensor import RangeSensor

FIELD = load_field("ssl_2001")
EXACT = {"noise_std_m": 0.0, "dropout_rate": 0.0}
POSE = Pose2(-0.2, 0.1, 0.5)


def scan(scene, seed=0, **options):
    return RangeSensor(**options).scan(scene, POSE, np.random.default_rng(seed))


def test_without_noise_it_measures_what_stands_higher_than_its_plane():
    scene = Scene(
        FIELD, boxes=(Box(0.3, 0.1, height_m=0.13), Box(-0.6, 0.1, height_m=0.06)), robots=(Robot(0, -0.4, 0.09),)
    )
    profile = scan(scene, **EXACT)
    high = Scene(FIELD, boxes=scene.boxes[:1], robots=scene.robots)
    np.testing.assert_allclose(profile.range_m, high.free_range_m(POSE, profile.bearing_rad))
    assert profile.hit.all()
    assert (profile.range_m > scene.free_range_m(POSE, profile.bearing_rad) + 0.05).any()


def test_a_plane_over_the_walls_meets_nothing():
    profile = scan(Scene(FIELD), height_m=0.3, reach_m=2.0, **EXACT)
    assert not profile.hit.any()
    assert (profile.range_m == 2.0).all()


@pytest.mark.parametrize(("height_m", "is_met"), [(0.01, True), (0.03, True), (0.05, False)])
def test_a_ball_is_met_where_the_plane_cuts_it(height_m, is_met):
    ball = Ball(0.2, 0.3, 0.0215)
    bare, with_ball = (scan(Scene(FIELD, ball=b), height_m=height_m, beams=720, **EXACT) for b in (None, ball))
    nearer = with_ball.range_m < bare.range_m - 0.01
    assert nearer.any() == is_met
    if is_met:
        cut = math.sqrt(0.0215**2 - (height_m - 0.0215) ** 2)
        away = math.hypot(0.2 - POSE.x_m, 0.3 - POSE.y_m)
        assert with_ball.range_m[nearer].min() == pytest.approx(away - cut, abs=2e-4)


def test_noise_and_missing_echoes_are_as_asked_for():
    scene = Scene(FIELD)
    exact = scan(scene, beams=4000, **EXACT)
    noisy = scan(scene, beams=4000, noise_std_m=0.02, dropout_rate=0.1)
    assert 1 - noisy.hit.mean() == pytest.approx(0.1, abs=0.02)
    assert (noisy.range_m[~noisy.hit] == 3.0).all()
    error = (noisy.range_m - exact.range_m)[noisy.hit]
    assert error.std() == pytest.approx(0.02, rel=0.1)
    assert abs(error.mean()) < 0.002
    again = scan(scene, beams=4000, noise_std_m=0.02, dropout_rate=0.1)
    np.testing.assert_array_equal(again.range_m, noisy.range_m)
