"""Range profiles: their cones, what they refuse, and the one that a camera's floor makes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.range_profile import RangeProfile, cones, floor_profile
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Ball, Box, Scene
from sim2d.rendering.sensor import Sensor


@given(st.integers(2, 200), st.floats(-4, 4))
def test_cones_all_around_leave_no_gap(count, start):
    bearing = start + np.arange(count) * (math.tau / count)
    lower, upper = cones(bearing)
    np.testing.assert_allclose(upper - lower, math.tau / count, rtol=1e-9)
    np.testing.assert_allclose(upper[:-1], lower[1:])
    assert upper[-1] - lower[0] == pytest.approx(math.tau)


def test_wide_gaps_belong_to_nobody():
    lower, upper = cones(np.array([0.0, 0.1, 0.2, 1.0, 1.1]))
    np.testing.assert_allclose(lower, [-0.05, 0.05, 0.15, 0.95, 1.05])
    np.testing.assert_allclose(upper, [0.05, 0.15, 0.25, 1.05, 1.15])


def test_profiles_are_read_only_copies():
    range_m = np.array([1.0, 2.0])
    profile = RangeProfile(np.array([0.0, 0.1]), range_m, np.array([True, False]), 0.1)
    range_m[0] = 9.0
    assert profile.range_m[0] == 1.0
    for array in (profile.bearing_rad, profile.range_m, profile.hit, profile.depth_m):
        assert not array.flags.writeable
    np.testing.assert_array_equal(profile.depth_m, [0.1, 0.1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], [], []), "at least one bearing"),
        (([0.0, 1.0], [1.0], [True, True]), "as long as each other"),
        (([1.0, 0.0], [1.0, 1.0], [True, True]), "ascend within one turn"),
        (([0.0, 7.0], [1.0, 1.0], [True, True]), "ascend within one turn"),
        (([0.0, math.nan], [1.0, 1.0], [True, True]), "ascend within one turn"),
        (([0.0, 1.0], [-1.0, 1.0], [True, True]), "must not be negative"),
        (([0.0, 1.0], [1.0, 1.0], [True, True], [0.1, math.nan]), "must not be negative"),
        (([0.0, 1.0], [1.0, 1.0], [True, True], [0.1, 0.1, 0.1]), "depth_m must be a number or as long"),
    ],
)
def test_impossible_profiles_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        RangeProfile(*arguments)


def test_a_cameras_floor_ends_at_things_and_at_the_ball():
    field, camera = load_field("ssl_2001"), sekimori_camera()
    vision = Vision(field, camera, directions=120, rings=40)
    pose = Pose2(-0.3, 0.1, 0.2)
    box, ball = Box(0.25, 0.1), Ball(-0.3, -0.3, field.ball_radius_m)
    light = MirrorRenderer(camera, 1).render(Scene(field, boxes=(box,), ball=ball), pose)
    view = vision.look(Sensor(noise_sigma=4.0, blur_px=0.7).expose(light, np.random.default_rng(3)))
    profile = floor_profile(view)
    range_m, depth_m = profile.range_m, np.asarray(profile.depth_m)

    def at(x, y):
        bearing = math.atan2(y - pose.y_m, x - pose.x_m) - pose.theta_rad
        return int(np.argmin(np.abs(profile.bearing_rad - bearing)))

    to_box, to_ball = at(0.25, 0.1), at(-0.3, -0.3)
    assert profile.hit[[to_box, to_ball]].all()
    assert range_m[to_box] - 0.03 <= 0.25 + 0.3 - 0.065 <= range_m[to_box] + depth_m[to_box] + 0.03
    assert view.ball is not None
    assert abs(range_m[to_ball] - 0.4) < 0.06
    # a robot may drive to the ball: free space for steering goes on
    assert view.free_space.range_m[to_ball] > 0.6
    assert (range_m <= view.free_space.range_m).all()
    bounds = vision.grid.ring_bounds_m
    np.testing.assert_allclose(range_m + depth_m, bounds[np.searchsorted(bounds, range_m) + profile.hit])
