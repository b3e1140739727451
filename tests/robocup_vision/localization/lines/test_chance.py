"""Line points that a pose explains no better than chance does say nothing for it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.chance import nats_beyond_chance
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.nearby import NearbySettings, locate_nearby
from robocup_vision.perception.line_points import LinePoints

FIELD = load_field("ssl_division_b")
MAP = LineMap(FIELD)
CAMERA = PinholeCamera((640, 480), (640.0, 640.0), (319.5, 239.5), 0.17, offset_m=(0.09, 0.0), tilt_rad=-0.29)
INLIER_PX = NearbySettings().fit.inlier_px
ENOUGH = NearbySettings().min_nats_beyond_chance


def line_pixels(pose):
    """Pixels of the field's lines, as many to a metre."""
    pixels = CAMERA.floor_to_pixel(pose.inverse().transform(FIELD.line_points(0.01)))
    width, height = CAMERA.size_px
    return pixels[((pixels > 0) & (pixels < (width - 1, height - 1))).all(axis=1)]


def thrown(rng, count):
    """Pixels anywhere on the floor in view."""
    return rng.uniform((0, 70), CAMERA.size_px, (count, 2))


poses = st.builds(Pose2, st.floats(-4, 4), st.floats(-2.5, 2.5), st.floats(-math.pi, math.pi))


@settings(deadline=None, max_examples=20)
@given(poses, st.integers(0, 2**32 - 1))
def test_points_thrown_anywhere_say_nothing(pose, seed):
    pixels = thrown(np.random.default_rng(seed), 800)
    assert nats_beyond_chance(pixels, pose, CAMERA, MAP, INLIER_PX) < 0.1 * ENOUGH


@pytest.mark.parametrize("clutter", [0, 1, 3])
def test_lines_say_much_among_several_times_as_many_other_points(clutter):
    pose = Pose2(1.0, 0.5, 0.4)
    lines = line_pixels(pose)
    rng = np.random.default_rng(3)
    pixels = np.vstack([lines, thrown(rng, clutter * len(lines))])
    nats = nats_beyond_chance(pixels, pose, CAMERA, MAP, INLIER_PX)
    assert nats > ENOUGH
    assert nats > 3 * nats_beyond_chance(pixels, Pose2(1.0, 0.5, 1.0), CAMERA, MAP, INLIER_PX)


def test_points_off_the_floor_of_the_field_do_not_count():
    pose = Pose2(3.2, 0.0, 0.0)
    outside = CAMERA.floor_to_pixel(
        pose.inverse().transform(np.random.default_rng(0).uniform((5.4, -1), (7, 1), (99, 2)))
    )
    assert np.isfinite(outside).all()
    lines = line_pixels(pose)
    alone, among = (
        nats_beyond_chance(pixels, pose, CAMERA, MAP, INLIER_PX) for pixels in (lines, np.vstack([lines, outside]))
    )
    assert among == alone > ENOUGH


@pytest.mark.parametrize("pixels", [np.empty((0, 2)), np.array([[320.0, 2.0]])])
def test_a_picture_without_points_on_the_floor_says_nothing(pixels):
    assert nats_beyond_chance(pixels, Pose2(0.0, 0.0, 0.0), CAMERA, MAP, INLIER_PX) == 0.0


@pytest.mark.parametrize(("speckles", "is_located"), [(40, True), (2000, False)])
def test_a_stretch_of_line_confirms_a_prior_unless_the_picture_is_full_of_such_points(speckles, is_located):
    truth = Pose2(1.0, 0.5, 0.4)
    rng = np.random.default_rng(11)
    lines = line_pixels(truth)
    # a stretch near one line, as the edge of a roof may lie; the other points keep away from the lines near the prior
    stretch = lines[np.argsort(np.hypot(*(lines - lines[0]).T))[:60]]
    stray = thrown(rng, speckles)
    apart = np.hypot(*(stray[:, None] - lines[None, ::4]).transpose(2, 0, 1)).min(axis=1)
    points = LinePoints.from_pixels(CAMERA, np.vstack([stretch, stray[apart > 60]]))
    prior = PoseEstimate(truth, np.diag([0.05, 0.05, 0.03]) ** 2, 1.0, 0.0)
    estimate, camera = locate_nearby(points, MAP, prior, CAMERA)
    assert bool(estimate) is is_located
    if not is_located:
        assert isinstance(estimate, NotLocated)
        assert "chance explains" in estimate.reason
        assert camera is CAMERA
