"""Poses fitted to an outline, the outline's hull and moments, and sums of the search."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, cameras, numbers

from field_models import load_field
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    WallPrediction,
    WallScene,
    compare_outline,
    empty_prediction,
    predict_walls,
    settle,
    thinned,
)
from robocup_vision.kernels.walls.hull import hull_moments, hull_radius, star_moments
from robocup_vision.kernels.walls.search import MAX_DIFFERENCE, sum_differences
from robocup_vision.localization.outline_search import BANK_BEARINGS


def test_no_sum_of_differences_is_too_large_for_two_bytes():
    count = BANK_BEARINGS
    out = np.empty((1, count), dtype=np.int16)
    sum_differences(np.zeros((1, 2 * count), dtype=np.int16), np.full(count, 2**15 - 1, dtype=np.int16), out)
    assert (out == count * int(MAX_DIFFERENCE)).all()


FIELD = load_field("ssl_2001")
COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
Q_STEP = 0.01
RADIUS_OF_Q = PAPER_MIRROR.radius_px(np.arange(1000) * Q_STEP)
seeds = st.integers(0, 2**32 - 1)
places = st.builds(Pose2, numbers(-1.25, 1.25), numbers(-0.65, 0.65), numbers(-3.1, 3.1))


def geometry(camera):
    x, y, height = camera.viewpoint_m
    to_camera = np.ascontiguousarray(camera.camera_to_robot.T)
    return WallScene(FIELD.walls, float(x), float(y), float(height), to_camera, COS, SIN)


def predict(pose, camera):
    out = WallPrediction(np.empty(COUNT), np.empty(COUNT, dtype=np.int64), np.empty((len(FIELD.walls), 4)))
    predict_walls(pose.array if isinstance(pose, Pose2) else pose, geometry(camera), out)
    return out


def predict_twin(pose, camera):
    """Where each bearing's upright half plane cuts each wall's foot, in three dimensions; the nearest counts."""
    best = np.zeros(COUNT)
    for x0, y0, x1, y1 in FIELD.walls:
        robot = pose.inverse().transform([[x0, y0], [x1, y1]])
        ends = (np.column_stack([robot, [0.0, 0.0]]) - camera.viewpoint_m) @ camera.camera_to_robot
        aside = COS[:, None] * ends[:, 1] - SIN[:, None] * ends[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = aside[:, 0] / (aside[:, 0] - aside[:, 1])
            foot = ends[0] + t[:, None] * (ends[1] - ends[0])
            along = COS * foot[:, 0] + SIN * foot[:, 1]
            q = np.where((t >= 0) & (t <= 1) & (along > 0), -foot[:, 2] / (along * camera.viewpoint_m[2]), 0.0)
        best = np.maximum(best, q)
    return best


@given(places, cameras())
def test_predicted_walls_agree_with_geometry(pose, camera):
    q, wall, _ = predict(pose, camera)
    expected = predict_twin(pose, camera)
    # a corner may round to either side of a bearing; nothing else may differ
    assert (np.abs(q - expected) > 1e-9 * (1 + expected)).sum() <= 1
    np.testing.assert_array_equal(wall >= 0, q > 0)


CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)


def outline(pose, rng, noise_px=0.2, hidden=0.2, camera=CAMERA):
    q, wall, _ = predict(pose, camera)
    radius = PAPER_MIRROR.radius_px(q) + rng.normal(0, noise_px, COUNT)
    radius[(wall < 0) | (rng.random(COUNT) < hidden)] = np.nan
    return radius


def fit(start, radius, scales, camera=CAMERA):
    scene, pose = geometry(camera), start.copy()
    fine = Comparison(scene, FloorOutline(radius, Q_STEP, RADIUS_OF_Q, scales, 1.0), empty_prediction(scene))
    settle(pose, fine, thinned(fine))
    cost, _ = compare_outline(scene, fine.outline, fine.prediction, (0.0, 0.0), *np.empty((2, COUNT)))
    return cost, pose, fine.prediction


@given(places, seeds)
def test_fit_finds_the_pose_an_outline_was_made_from(pose, seed):
    rng = np.random.default_rng(seed)
    start = pose.array + rng.normal(0, (0.02, 0.02, 0.03))
    _, found, _ = fit(start, outline(pose, rng, 0.05), np.array([8.0, 5.0, 3.0, 2.0, 1.0, 1.0]))
    distance, angle = Pose2(*found).error_to(pose)
    assert distance < 0.005
    assert angle < 0.01


def test_a_fit_from_nowhere_still_says_how_bad_it_is():
    radius = outline(Pose2(0.0, 0.0, 0.0), np.random.default_rng(2))
    nan = fit(np.full(3, np.nan), radius, np.array([2.0, 1.0]))
    assert nan[0] == 1.0  # no wall is met: every bearing counts in full
    assert (nan[2].wall < 0).all()
    nothing = fit(np.zeros(3), np.full(COUNT, np.nan), np.array([2.0, 1.0]))
    assert nothing[0] == 0.0
    np.testing.assert_array_equal(nothing[1], np.zeros(3))


@given(places, seeds)
def test_hull_moments_are_those_of_the_hull_on_the_floor(pose, seed):
    radius = outline(pose, np.random.default_rng(seed))
    first, step = 26.0, 0.25
    q = PAPER_MIRROR.inverse_range_per_m(first + step * np.arange(345))
    hull = np.empty(COUNT)
    known = hull_radius(COS, SIN, radius, hull)
    expected = star_moments(COS, SIN, 1.0 / np.interp(hull, first + step * np.arange(345), q))
    found = hull_moments(COS, SIN, radius, first, step, q)
    assert found[0] == known
    np.testing.assert_allclose(found[1:], expected, rtol=1e-3, atol=1e-3)
    assert hull_moments(COS, SIN, np.full(COUNT, np.nan), first, step, q) == (0, 0.0, 0.0, 0.0)


def hull_twin(angles, radius):
    """Farthest crossing of each ray with a segment between any two points: the hull, if the origin lies inside it."""
    known = radius > 0
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)[known] * radius[known, None]
    first, second = (points[i] for i in np.triu_indices(len(points), 1))
    out = np.zeros(len(angles))
    for k, (c, s) in enumerate(zip(np.cos(angles), np.sin(angles), strict=True)):
        a, b = (c * p[:, 1] - s * p[:, 0] for p in (first, second))
        crosses = (np.minimum(a, b) <= 1e-9) & (np.maximum(a, b) >= -1e-9) & (np.abs(a - b) > 1e-9)
        along = (first @ (c, s))[crosses], (second @ (c, s))[crosses]
        t = a[crosses] / (a - b)[crosses]
        out[k] = (along[0] + t * (along[1] - along[0])).max()
    return out


@given(seeds)
def test_hull_agrees_with_its_twin(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(8, 60))
    angles = np.arange(count) * math.tau / count
    radius = rng.uniform(20.0, 110.0, count)
    radius[rng.random(count) < 0.4] = np.nan
    known = np.flatnonzero(radius > 0)
    assume(len(known) >= 3)
    assume(np.diff(np.append(known, known[0] + count)).max() < count / 2)  # otherwise the origin lies outside
    out = np.empty(count)
    assert hull_radius(np.cos(angles), np.sin(angles), radius, out) == len(known)
    np.testing.assert_allclose(out, hull_twin(angles, radius), rtol=1e-9)
    assert (out[known] >= radius[known] - 1e-9).all()


@given(seeds)
def test_hull_of_a_one_sided_outline_is_finite(seed):
    rng = np.random.default_rng(seed)
    radius = np.full(COUNT, np.nan)
    first, length = rng.integers(0, COUNT), rng.integers(3, COUNT)
    radius[(first + np.arange(length)) % COUNT] = rng.uniform(20.0, 110.0, length)
    out = np.full(COUNT, np.nan)
    assert hull_radius(COS, SIN, radius, out) == length
    assert np.isfinite(out).all()


def test_too_few_points_have_no_hull():
    radius = np.full(COUNT, np.nan)
    radius[:2] = 50.0
    assert hull_radius(COS, SIN, radius, np.empty(COUNT)) == 2


def moments_twin(corners):
    """Sum over the triangles to the origin, by the three mid-point rule, which is exact for quadratic functions."""
    following = np.roll(corners, -1, axis=0)
    area = (corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]) / 2
    middles = np.stack([corners / 2, following / 2, (corners + following) / 2])
    total = area.sum()
    mean = (area[None, :, None] * middles / 3).sum(axis=(0, 1)) / total
    second = np.einsum("k,tki,tkj->ij", area / 3, middles, middles) / total - np.outer(mean, mean)
    return mean, second


@given(seeds)
def test_star_moments_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(0.2, 2.0, COUNT)
    mean, second = moments_twin(np.stack([COS, SIN], axis=1) * range_m[:, None])
    x, y, axis = star_moments(COS, SIN, range_m)
    np.testing.assert_allclose((x, y), mean, atol=1e-12)
    direction = np.array([math.cos(axis), math.sin(axis)])
    assert direction @ second @ direction == pytest.approx(np.linalg.eigvalsh(second)[1])
