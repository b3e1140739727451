"""The fit of pose, centre and tilt: derivatives by differences, cameras that are off, and how much evidence tells."""

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
from robocup_vision.kernels.walls.doubted_camera import (
    CameraDoubt,
    doubts_of_camera,
    fit_with_camera,
)
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    WallPrediction,
    WallScene,
    predict_walls,
    room_for,
    settle,
    thinned,
)

FIELD = load_field("ssl_2001")
COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
Q_STEP = 0.01
RADIUS_OF_Q = PAPER_MIRROR.radius_px(np.arange(1000) * Q_STEP)
SCALES = np.array([2.0, 1.0])
CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
DOUBT = CameraDoubt(noise_px=0.15, center_std_px=0.5, turn_std_rad=0.004, turns_body=False)
LEAN = CameraDoubt(noise_px=0.15, center_std_px=1e-6, turn_std_rad=0.01, turns_body=True)
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


def floor_of(radius):
    return FloorOutline(radius, Q_STEP, RADIUS_OF_Q, SCALES, 1.0)


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


def fit_pose(pose, radius):
    """Return the pose by a fit that takes the file for true."""
    return fitted(pose.array, radius)[0]


def fitted(start, radius):
    """Return the pose fitted from a start, and what is predicted from there."""
    found, fine = start.copy(), Comparison(scene(), floor_of(radius), room_for(scene()))
    settle(found, fine, thinned(fine))
    return found, fine


def fit_all(start, radius):
    unknowns, covariance = np.concatenate([start, np.zeros(4)]), np.empty((7, 7))
    residual, predicted = np.empty((2, COUNT))
    summary = fit_with_camera(
        unknowns, scene(), floor_of(radius), DOUBT, 1.5, 1.7, 0.008, residual, predicted, covariance
    )
    # a cost is that of its residuals, as `cost_of` counts
    known = residual[np.isfinite(residual)]
    inlying = known[np.abs(known) < 1.5]
    assert summary.inlier_ratio == len(inlying) / len(known)
    assert summary.rms_px == pytest.approx(np.sqrt(np.mean(inlying**2)))
    assert summary.along_m == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[1]))
    assert summary.cost == pytest.approx(
        np.minimum((known / 2) ** 2, np.where(known < 0, 1, 2)).sum() / np.sum(radius > 0)
    )
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-9)
    return unknowns, predicted, covariance[:3, :3]


def test_a_camera_that_is_off_is_doubted_and_its_pose_mended():
    rng = np.random.default_rng(8)
    errors, nees, doubts = [], [], []
    for _ in range(30):
        pose = Pose2(*rng.uniform((-1.2, -0.6, -3.1), (1.2, 0.6, 3.1)).tolist())
        angle = rng.uniform(0, math.tau)
        center, tilt = 0.7 * np.array([math.cos(angle), math.sin(angle)]), rng.normal(0, 0.003, 2)
        radius = seen_outline(pose, center, tilt, rng, 0.1)
        start = fit_pose(pose, radius)
        unknowns, predicted, covariance = fit_all(start, radius)
        doubts.append(doubts_of_camera(start, scene(), floor_of(radius), LEAN, DOUBT)[1])
        errors.append([math.hypot(*(x[:2] - pose.array[:2])) for x in (start, unknowns)])
        off = unknowns[:3] - pose.array
        nees.append(off @ np.linalg.solve(covariance, off))
        # walls are predicted where they are seen, not where the file puts them
        assert np.median(np.abs(predicted - radius)) < 0.2
    before, after = np.median(errors, axis=0)
    assert after < 0.5 * before
    assert np.mean(np.array(doubts) > 24) > 0.9
    # of three dimensions: 2.4 in the median
    assert 0.5 < np.median(nees) < 7.0


@pytest.mark.parametrize("seed", range(20))
def test_a_true_camera_is_not_doubted(seed):
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform((-1.2, -0.6, -3.1), (1.2, 0.6, 3.1)).tolist())
    radius = seen_outline(pose, (0.0, 0.0), (0.0, 0.0), rng, 0.15)
    # noise of the bearings alone explains so much once in ten thousand outlines
    assert max(doubts_of_camera(fit_pose(pose, radius), scene(), floor_of(radius), LEAN, DOUBT)) < 24


def test_an_outline_that_shows_nothing_doubts_nothing():
    nothing = floor_of(np.full(COUNT, np.nan))
    assert doubts_of_camera(np.zeros(3), scene(), nothing, LEAN, DOUBT) == (0.0, 0.0)
    outside = np.array([9.0, 9.0, 0.0])
    unknowns = np.concatenate([outside, np.zeros(4)])
    fit_with_camera(unknowns, scene(), nothing, DOUBT, 1.5, 1.7, 0.008, *np.empty((2, COUNT)), np.empty((7, 7)))
    np.testing.assert_allclose(unknowns[:3], outside)


@given(places, seeds)
def test_bearings_that_are_hidden_never_narrow_the_covariance(pose, seed):
    radius = radius_at(predict(pose.array, scene()).q)
    every = fit_all(pose.array, radius)[2]
    radius[np.random.default_rng(seed).random(COUNT) < 0.4] = np.nan
    fewer = fit_all(pose.array, radius)[2]
    assert np.linalg.eigvalsh(fewer - every).min() > -1e-3 * np.trace(every)
