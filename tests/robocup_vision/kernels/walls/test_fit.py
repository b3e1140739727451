"""The outline fit: what the camera's geometry predicts, and poses that outlines are made from."""

import math

import numpy as np
import pytest
from hypothesis import given
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
    agreement,
    compare_outline,
    empty_prediction,
    predict_walls,
    settle,
    thinned,
    truncated_loss,
)
from robocup_vision.kernels.walls.hull import hull_moments, hull_radius, star_moments

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


@given(places, cameras())
def test_the_half_turn_of_a_pose_sees_the_same_walls(pose, camera):
    here, there = predict(pose, camera).q, predict(pose.half_turn(), camera).q
    # a corner may round to either side of a bearing
    assert (np.abs(here - there) > 1e-9 * (1 + here)).sum() <= 1


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


@given(numbers(-20.0, 20.0), numbers(0.1, 5.0))
def test_floor_beyond_a_wall_weighs_and_costs_more_than_an_obstacle_before_it(e, scale):
    width = scale if e < 0 else 3 * scale
    assert agreement(e, 1 / scale) == pytest.approx((1 + (e / width) ** 2) ** -2)
    assert truncated_loss(e, 0.5 / scale) == pytest.approx(min(1 if e < 0 else 2, (e / (2 * scale)) ** 2))
    assert agreement(abs(e), 1 / scale) >= agreement(-abs(e), 1 / scale)
    assert truncated_loss(abs(e), 0.5 / scale) >= truncated_loss(-abs(e), 0.5 / scale)
