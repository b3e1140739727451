"""A prior refined by the few lines a low forward camera sees, whose tilt and roll are not quite what its file says."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.nearby import NearbySettings, locate_nearby
from robocup_vision.perception.line_points import LinePoints

FIELD = load_field("ssl_division_b")
MAP = LineMap(FIELD)
CAMERA = PinholeCamera((640, 480), (640.0, 640.0), (319.5, 239.5), 0.17, offset_m=(0.09, 0.0), tilt_rad=-0.29)
PRIOR_STD = np.array([0.1, 0.1, math.radians(5)])


def seen_points(pose, held, rng, noise_px=0.5, speckles=40):
    """Line points up to 4 m away as the camera is held, believed to be held as its file says."""
    floor = pose.inverse().transform(FIELD.line_points(0.01))
    floor = floor[(floor[:, 0] > 0.2) & (np.hypot(*floor.T) < 4.0)]
    pixels = held.floor_to_pixel(floor)
    width, height = CAMERA.size_px
    pixels = pixels[((pixels > 0) & (pixels < (width - 1, height - 1))).all(axis=1)]
    pixels = pixels + rng.normal(0, noise_px, pixels.shape)
    stray = rng.uniform((0, 60), (width, height), (speckles, 2))
    return LinePoints.from_pixels(CAMERA, np.vstack([pixels, stray]))


def swaying(rng):
    tilt, roll = rng.normal(0, NearbySettings().sway_std_rad, 2)
    return CAMERA.with_orientation(None, CAMERA.tilt_rad + tilt, roll)


def off_by(estimate, truth):
    off = estimate.pose.array - truth.array
    off[2] = wrap_angle(off[2])
    return off


def drawn(rng):
    """Draw a pose, the camera as it is held and a prior about the pose; with what comes of it."""
    truth = Pose2(rng.uniform(-4, 4), rng.uniform(-2.7, 2.7), rng.uniform(-math.pi, math.pi))
    held = swaying(rng)
    start = Pose2(*(truth.array + rng.normal(0, PRIOR_STD)))
    prior = PoseEstimate(start, np.diag(PRIOR_STD**2), 1.0, 0.0)
    return truth, held, prior, *locate_nearby(seen_points(truth, held, rng), MAP, prior, CAMERA)


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_it_never_ends_worse_than_the_prior_by_more_than_it_owns_to(seed):
    truth, _, prior, estimate, _ = drawn(np.random.default_rng(seed))
    if estimate:
        before, after = np.abs(off_by(prior, truth)), np.abs(off_by(estimate, truth))
        assert np.all(after <= before + 4 * estimate.std)


@pytest.mark.slow
def test_it_helps_and_says_how_well_it_knows():
    rng = np.random.default_rng(7)
    before, after, nees = [], [], []
    for _ in range(40):
        truth, _, prior, estimate, _ = drawn(rng)
        if estimate:
            off = off_by(estimate, truth)
            before.append(np.abs(off_by(prior, truth)))
            after.append(np.abs(off))
            nees.append(off @ np.linalg.solve(estimate.covariance, off))
    assert len(after) >= 30
    assert np.all(np.mean(after, axis=0) < 0.8 * np.mean(before, axis=0))
    assert np.median(nees) < 6.0
    assert np.mean(np.array(nees) < 16.3) > 0.9


def test_the_tilt_is_found_where_the_lines_tell_it():
    rng = np.random.default_rng(3)
    truth = Pose2(2.6, 0.3, 0.2)  # before the penalty area: lines along and across
    held = CAMERA.with_orientation(None, CAMERA.tilt_rad + 0.015, -0.01)
    points = seen_points(truth, held, rng)
    tight = PoseEstimate(truth, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0)
    estimate, camera = locate_nearby(points, MAP, tight, CAMERA)
    assert estimate
    assert camera.tilt_rad == pytest.approx(held.tilt_rad, abs=0.003)
    assert camera.roll_rad == pytest.approx(held.roll_rad, abs=0.004)
    # a camera that is known to be held as its file says takes the same picture for another place
    stiff = dataclasses.replace(CAMERA, roll_std_rad=0.0)
    wrong, kept = locate_nearby(points, MAP, tight, stiff)
    assert kept.tilt_rad == pytest.approx(CAMERA.tilt_rad, abs=1e-4)
    assert not wrong or wrong.pose.error_to(truth)[0] > estimate.pose.error_to(truth)[0]


def test_lines_that_are_not_there_or_do_not_fit_locate_nothing():
    rng = np.random.default_rng(1)
    truth = Pose2(2.6, 0.3, 0.2)
    prior = PoseEstimate(truth, np.diag(PRIOR_STD**2), 1.0, 0.0)
    nothing, camera = locate_nearby(LinePoints.from_pixels(CAMERA, np.empty((0, 2))), MAP, prior, CAMERA)
    assert isinstance(nothing, NotLocated)
    assert nothing.reason.startswith("only 0 line points")
    assert camera is CAMERA
    clutter = rng.uniform((0, 60), (639, 479), (3000, 2))
    speckled, _ = locate_nearby(LinePoints.from_pixels(CAMERA, clutter), MAP, prior, CAMERA)
    assert isinstance(speckled, NotLocated)
    assert "agree" in speckled.reason
