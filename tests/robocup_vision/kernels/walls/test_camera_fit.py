"""The fit of pose, centre and tilt: cameras that are off, and how much evidence the covariance holds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, numbers

from field_models import load_field
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.camera_fit import (
    CameraErrors,
    FitRules,
    Fitted,
    fit_leaning,
    fit_outline,
)
from robocup_vision.kernels.walls.fit import WallPrediction, WallScene, predict_walls

FIELD = load_field("ssl_2001")
COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
Q_STEP = 0.01
RADIUS_OF_Q = PAPER_MIRROR.radius_px(np.arange(1000) * Q_STEP)
SCALES = np.array([2.0, 1.0])
CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
MIN_GAIN = 18.5
seeds = st.integers(0, 2**32 - 1)
places = st.builds(Pose2, numbers(-1.2, 1.2), numbers(-0.6, 0.6), numbers(-3.1, 3.1))


def scene(camera=CAMERA):
    x, y, height = camera.viewpoint_m
    to_camera = np.ascontiguousarray(camera.camera_to_robot.T)
    return WallScene(FIELD.walls, float(x), float(y), float(height), to_camera, COS, SIN)


def leaning(about_x, about_y):
    return scene(replace(CAMERA, tilt_rad=(about_x, about_y)))


def predict(pose, seen_by):
    out = WallPrediction(np.empty(COUNT), np.empty(COUNT, dtype=np.int64), np.empty((len(FIELD.walls), 4)))
    predict_walls(pose, seen_by, out)
    return out


def radius_at(q):
    return np.interp(q, np.arange(1000) * Q_STEP, RADIUS_OF_Q)


def seen_outline(pose, center, tilt, rng=None, noise_px=0.0):
    """Radius about the file's centre of the walls' feet, as a camera sees them that is off its file."""
    fine = np.arange(8 * COUNT) * math.tau / (8 * COUNT)
    seen_by = leaning(*tilt)._replace(cos_b=np.cos(fine), sin_b=np.sin(fine))
    out = WallPrediction(np.empty(8 * COUNT), np.empty(8 * COUNT, dtype=np.int64), np.empty((len(FIELD.walls), 4)))
    predict_walls(pose.array, seen_by, out)
    r = radius_at(out.q)
    u, v = r * np.cos(fine) + center[0], r * np.sin(fine) + center[1]
    around = np.unwrap(np.arctan2(v, u))
    around, size = np.tile(around, 3), np.tile(np.hypot(u, v), 3)
    around += np.repeat([-math.tau, 0.0, math.tau], 8 * COUNT)
    order = np.argsort(around)
    radius = np.interp(ANGLES, around[order], size[order])
    return radius if rng is None else radius + rng.normal(0, noise_px, COUNT)


def fitted(start, radius, min_gain=MIN_GAIN, fit=fit_outline, scales=SCALES):
    """Return a fit from a start, its residuals, the predicted radii, and the covariance."""
    errors = CameraErrors(noise_px=0.15, center_std_px=0.5, turn_std_rad=0.01)
    rules = FitRules(scene(), Q_STEP, RADIUS_OF_Q, 1.0, 1.5, 1.7, 0.008, errors, min_gain)
    lines, covariance = np.empty((2, COUNT)), np.empty((3, 3))
    found = Fitted(*fit(tuple(start), radius, scales, rules, lines, covariance))
    return found, *lines, covariance


@pytest.mark.parametrize(("fit", "min_gain"), [(fit_outline, math.inf), (fit_outline, 0.0), (fit_leaning, math.inf)])
@given(places, seeds)
def test_a_fit_says_how_well_its_residuals_agree(fit, min_gain, pose, seed):
    radius = seen_outline(pose, (0.3, -0.2), (0.003, -0.002), np.random.default_rng(seed), 0.2)
    found, residual, _, covariance = fitted(pose.array, radius, min_gain, fit)
    known = residual[np.isfinite(residual)]
    inlying = known[np.abs(known) < 1.5]
    assert found.bearings == np.sum(radius > 0)
    assert found.inlier_ratio == len(inlying) / len(known)
    assert found.rms_px == pytest.approx(np.sqrt(np.mean(inlying**2)))
    assert found.along_m == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[1]))
    truncated = np.minimum((known / 2) ** 2, np.where(known < 0, 1, 2))
    assert found.cost == pytest.approx(truncated.sum() / np.sum(radius > 0))
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-9)


def test_the_pose_by_a_camera_that_is_off_is_corrected():
    rng = np.random.default_rng(8)
    errors, nees = [], []
    for _ in range(30):
        pose = Pose2(*rng.uniform((-1.2, -0.6, -3.1), (1.2, 0.6, 3.1)).tolist())
        angle = rng.uniform(0, math.tau)
        center, tilt = 0.7 * np.array([math.cos(angle), math.sin(angle)]), rng.normal(0, 0.003, 2)
        radius = seen_outline(pose, center, tilt, rng, 0.1)
        trusting = fitted(pose.array, radius, math.inf)[0]
        found, _, predicted, covariance = fitted(pose.array, radius)
        errors.append([math.dist(one.pose[:2], pose.array[:2]) for one in (trusting, found)])
        off = found.pose - pose.array
        nees.append(off @ np.linalg.solve(covariance, off))
        # walls are predicted where they are seen, not where the file puts them
        assert np.median(np.abs(predicted - radius)) < 0.2
    before, after = np.median(errors, axis=0)
    assert after < 0.5 * before
    # of three dimensions: 2.4 in the median
    assert 0.5 < np.median(nees) < 7.0


@pytest.mark.parametrize("seed", range(20))
def test_a_true_camera_is_not_corrected(seed):
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform((-1.2, -0.6, -3.1), (1.2, 0.6, 3.1)).tolist())
    radius = seen_outline(pose, (0.0, 0.0), (0.0, 0.0), rng, 0.15)
    # noise of the bearings alone gains so much once in a thousand outlines
    assert fitted(pose.array, radius)[0] == fitted(pose.array, radius, math.inf)[0]


def test_an_outline_that_shows_nothing_determines_nothing():
    outside, nothing = (9.0, 9.0, 0.0), np.full(COUNT, np.nan)
    for fit in (fit_outline, fit_leaning):
        found = fitted(outside, nothing, 0.0, fit)[0]
        assert found.pose == pytest.approx(outside)
        assert (found.bearings, found.inlier_ratio) == (0, 0.0)
        assert found.along_m > 10.0


def test_a_direction_that_no_wall_fixes_has_a_large_deviation():
    pose = Pose2(0.0, 0.0, 0.0)
    radius = radius_at(predict(pose.array, scene()).q)
    radius[np.abs(SIN) < 0.9] = np.nan
    assert np.isfinite(radius).sum() > 20
    for fit in (fit_outline, fit_leaning):
        found, _, _, covariance = fitted(pose.array, radius, math.inf, fit)
        assert found.along_m > 10.0
        assert covariance[1, 1] < 1.0


@given(places, seeds)
def test_bearings_that_are_hidden_never_narrow_the_covariance(pose, seed):
    radius = radius_at(predict(pose.array, scene()).q)
    every = fitted(pose.array, radius, fit=fit_leaning)[3]
    radius[np.random.default_rng(seed).random(COUNT) < 0.4] = np.nan
    fewer = fitted(pose.array, radius, fit=fit_leaning)[3]
    assert np.linalg.eigvalsh(fewer - every).min() > -1e-3 * np.trace(every)
