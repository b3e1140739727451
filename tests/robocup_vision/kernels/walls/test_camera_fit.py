"""The fit of pose, centre and tilt: derivatives by differences, cameras that are off, and the covariance's evidence."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, numbers

from field_models import load_field
from robocup_vision.camera import OmniCamera
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.compiling.loops import plain
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.camera_fit import (
    PIVOT,
    CameraErrors,
    FitRules,
    Fitted,
    NormalEquations,
    fit_leaning,
    fit_outline,
    gather_equations,
    turned_scene,
)
from robocup_vision.kernels.walls.fit import FloorOutline, WallPrediction, WallScene, predict_walls

FIELD = load_field("ssl_2001")
COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
Q_STEP = 0.01
RADIUS_OF_Q = PAPER_MIRROR.radius_px(np.arange(1000) * Q_STEP)
SCALES = np.array([2.0, 1.0])
CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
TILTED = replace(CAMERA, tilt_rad=(0.02, -0.03), offset_m=(0.03, -0.02))
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


def turned(about_x, about_y):
    """Return the walls as a camera sees them that is turned about the pivot between foot and viewpoint, by matrices."""
    turn = camera_rotation(0.0, -about_y, about_x)
    seen_by = scene(TILTED)
    x, y, _ = turn @ (seen_by.offset_x, seen_by.offset_y, (1.0 - PIVOT) * seen_by.height)
    to_camera = np.ascontiguousarray(seen_by.robot_to_camera @ turn.T)
    return seen_by._replace(offset_x=x, offset_y=y, robot_to_camera=to_camera)


def equations_by_differences(unknowns, radius):
    """Return the normal equations by finite differences of what is predicted."""
    pose, center, tilt = unknowns[:3], unknowns[3:5], unknowns[5:]

    def predicted(x):
        q, wall, _ = predict(x[:3], turned(*x[5:]))
        return radius_at(q), wall

    at, wall = predicted(unknowns)
    beside = (ANGLES + 1e-6, ANGLES - 1e-6)
    ahead, before = (predict(pose, turned(*tilt)._replace(cos_b=np.cos(b), sin_b=np.sin(b))) for b in beside)
    by_bearing = (radius_at(ahead.q) - radius_at(before.q)) / 2e-6 / at
    oblique = 1 / np.hypot(1, by_bearing)
    columns = []
    for j in range(7):
        step = np.zeros(7)
        step[j] = 1e-6
        if j < 3 or j > 4:
            columns.append((predicted(unknowns + step)[0] - predicted(unknowns - step)[0]) / 2e-6 * oblique)
        elif j == 3:
            columns.append(oblique * (COS + by_bearing * SIN))
        else:
            columns.append(oblique * (SIN - by_bearing * COS))
    rows = np.stack(columns, axis=1)
    e = (radius - at) * oblique - rows[:, 3:5] @ center
    use = (wall >= 0) & (radius > 0)
    e, rows = e[use], rows[use]
    weight = 1 / (1 + np.where(e < 0, e, e / 3) ** 2) ** 2
    pulls = rows * (weight * e)[:, None]
    groups = pulls[: len(pulls) // 4 * 4].reshape(-1, 4, 7).sum(axis=1)
    return (rows.T * weight) @ rows, groups.T @ groups, pulls.sum(axis=0), (weight * e**2).sum(), weight.sum()


@given(places, seeds)
def test_normal_equations_agree_with_finite_differences(pose, seed):
    rng = np.random.default_rng(seed)
    unknowns = np.concatenate([pose.array, rng.normal(0, 0.4, 2), rng.normal(0, 0.004, 2)])
    radius = seen_outline(pose, (0.3, -0.2), (0.003, -0.002), rng, 0.2)
    radius[rng.random(COUNT) < 0.2] = np.nan
    seen_by = turned_scene(scene(TILTED), *unknowns[5:])
    for known, by_matrices in zip(seen_by, turned(*unknowns[5:]), strict=True):
        np.testing.assert_allclose(known, by_matrices, atol=1e-12)
    equations = NormalEquations(np.empty((7, 7)), np.empty((7, 7)), np.empty(7))
    prediction = predict(unknowns[:3], seen_by)
    outline = FloorOutline(radius, Q_STEP, RADIUS_OF_Q, SCALES, 1.0)
    squares, total = gather_equations(unknowns, seen_by, outline, prediction, equations)
    information, scatter, pull, *sums = equations_by_differences(unknowns, radius)
    # at a corner, and between cells of the table, a difference may see another wall or slope
    scale = np.sqrt(np.diag(information))
    both = np.outer(scale, scale)
    np.testing.assert_allclose(equations.information / both, information / both, atol=0.05)
    np.testing.assert_allclose(equations.pull / scale, pull / scale, atol=0.05 * np.sqrt(sums[0]) + 0.05)
    np.testing.assert_allclose(equations.scatter / both, scatter / both, atol=0.1 * max(sums[0], 1.0))
    np.testing.assert_allclose((squares, total), sums, rtol=0.05)


def fitted(start, radius, min_gain=MIN_GAIN, fit=fit_outline, scales=SCALES):
    """Return a fit from a start, its residuals, the predicted radii, and the covariance."""
    errors = CameraErrors(noise_px=0.15, center_std_px=0.5, turn_std_rad=0.01)
    rules = plain(FitRules(scene(), Q_STEP, RADIUS_OF_Q, 1.0, 1.5, 1.7, 0.008, errors, min_gain))
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
