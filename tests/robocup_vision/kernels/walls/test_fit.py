"""The compiled outline fit against plain NumPy twins and against the camera's own geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
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
    cost_of,
    inliers_of,
    position_std_m,
    predict_walls,
    room_for,
    settle,
    summarise_fit,
    tabulated,
    thinned,
    truncated_loss,
    turned_rate,
)
from robocup_vision.kernels.walls.hull import hull_moments, hull_radius, star_moments

FIELD = load_field("ssl_2001")
COUNT = 160
ANGLES = np.arange(COUNT) * math.tau / COUNT
COS, SIN = np.cos(ANGLES), np.sin(ANGLES)
FAR = np.array([8.0, 4.0, 2.0])
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


@settings(deadline=None, max_examples=40)
@given(places, cameras())
def test_predicted_walls_agree_with_geometry(pose, camera):
    q, wall, _ = predict(pose, camera)
    expected = predict_twin(pose, camera)
    # a corner may round to either side of a bearing; nothing else may differ
    assert (np.abs(q - expected) > 1e-9 * (1 + expected)).sum() <= 1
    np.testing.assert_array_equal(wall >= 0, q > 0)


@settings(deadline=None, max_examples=20)
@given(places, cameras())
def test_predicted_planes_are_those_of_walls_and_viewpoint(pose, camera):
    planes = predict(pose, camera).planes
    for wall, plane in zip(FIELD.walls, planes, strict=True):
        normal, _ = plane_twin(pose.array, camera, wall)
        if abs(normal[2]) < 1e-9:
            continue
        scale = camera.viewpoint_m[2] * normal[2]
        np.testing.assert_allclose(plane[:2] * scale, normal[:2], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(plane[2:] * scale, wall[2:] - wall[:2], rtol=1e-9, atol=1e-12)


def plane_twin(pose, camera, wall):
    """Return the normal (3,) of a wall's plane, camera frame, and its derivatives by x, y and theta, rows (3, 3)."""
    to_camera = camera.camera_to_robot.T
    c, s = math.cos(pose[2]), math.sin(pose[2])
    to_robot = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    on_robot = [to_robot @ (wall[i] - pose[0], wall[i + 1] - pose[1], 0.0) for i in (0, 2)]
    start, end = (to_camera @ (point - camera.viewpoint_m) for point in on_robot)
    by_theta = [to_camera @ np.cross(point, (0.0, 0.0, 1.0)) for point in on_robot]
    moved = [-to_camera @ to_robot[:, 0], -to_camera @ to_robot[:, 1]]
    turned = np.cross(by_theta[0], end - start) + np.cross(start, by_theta[1] - by_theta[0])
    return np.cross(start, end - start), np.stack([*(np.cross(m, end - start) for m in moved), turned])


def rates_twin(pose, camera, q, wall, bearings):
    """Return how the inverse range q (N,) at some bearings grows with x, y and theta, (N, 3)."""
    planes = [plane_twin(pose, camera, wall) for wall in FIELD.walls]
    normal, moved = (np.array(part) for part in zip(*planes, strict=True))
    height = camera.viewpoint_m[2]
    ray = np.stack([COS[bearings], SIN[bearings], -q * height], axis=1)
    return np.einsum("kpi,ki->kp", moved[wall], ray) / (height * normal[wall, 2])[:, None]


@settings(deadline=None, max_examples=20)
@given(places, cameras())
def test_the_twins_rates_are_those_of_predicted_walls(pose, camera):
    q, wall, _ = predict(pose, camera)
    for p in range(3):
        step = np.zeros(3)
        step[p] = 1e-6
        ahead, behind = (predict(pose.array + sign * step, camera) for sign in (1, -1))
        same = np.flatnonzero((wall >= 0) & (ahead[1] == wall) & (behind[1] == wall))
        rate = rates_twin(pose.array, camera, q[same], wall[same], same)[:, p]
        expected = (ahead[0] - behind[0])[same] / 2e-6
        np.testing.assert_allclose(rate, expected, rtol=1e-3, atol=1e-3 * (1 + np.abs(expected).max()))


@given(numbers(-3.1, 3.1), numbers(0.0, 3.0), numbers(-2.0, 2.0), numbers(-2.0, 2.0), numbers(0.1, 0.6))
def test_rates_of_turns_are_those_of_the_planes_normal(bearing, fall, along, aside, height):
    ray, normal = (math.cos(bearing), math.sin(bearing), -fall), (along, aside, 1.0 / height)
    expected = [-np.cross(axis, normal) @ ray for axis in np.eye(3)]
    found = turned_rate(ray[0], ray[1], fall, along, aside, 1.0 / height)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@given(numbers(0.0, 9.9))
def test_a_tabulated_radius_is_interpolated(q):
    radius, slope = tabulated(FloorOutline(np.empty(0), Q_STEP, RADIUS_OF_Q, np.ones(1), 1.0), q)
    assert radius == pytest.approx(np.interp(q, np.arange(1000) * Q_STEP, RADIUS_OF_Q))
    # as the loop does it: where q is a multiple of the step, a division may end in the other cell
    cell = int(q * (1.0 / Q_STEP))
    assert slope == pytest.approx((RADIUS_OF_Q[cell + 1] - RADIUS_OF_Q[cell]) / Q_STEP)


def fit_twin(start, camera, radius, scales, unit_px):
    pose = start.copy()
    for turn in range(len(scales) + 1):
        scale = scales[min(turn, len(scales) - 1)]
        stride = 2 if turn < len(scales) and scale > 2.5 * unit_px else 1
        use = np.arange(COUNT)[::stride]
        use = use[radius[use] > 0]
        q, wall, planes = predict(pose, camera)
        met = use[wall[use] >= 0]
        plane = planes[wall[met]]
        place = np.minimum(q[met] / Q_STEP, len(RADIUS_OF_Q) - 2 + 0.999)
        cell = place.astype(int)
        slope = (RADIUS_OF_Q[cell + 1] - RADIUS_OF_Q[cell]) / Q_STEP
        predicted = RADIUS_OF_Q[cell] + (q[met] - cell * Q_STEP) * slope
        turn_rate = slope * (plane[:, 1] * COS[met] - plane[:, 0] * SIN[met]) / predicted
        oblique = 1 / np.hypot(1, turn_rate)
        e = (radius[met] - predicted) * oblique
        jacobian = (slope * oblique)[:, None] * rates_twin(pose, camera, q[met], wall[met], met)
        ratio = np.where(e < 0, e / scale, e / (3 * scale))
        weight = 1 / (1 + ratio**2) ** 2
        loss = (e / (2 * unit_px)) ** 2
        cost = np.minimum(np.where(e < 0, 1.0, 2.0), loss).sum() + (len(use) - len(met))
        information, pull = (jacobian.T * weight) @ jacobian, jacobian.T @ (weight * e)
        if turn == len(scales):
            return cost / max(len(use), 1), pose, q, wall
        step = np.linalg.solve(information + 1e-6 * np.eye(3), pull)
        pose = pose + step * min(1.0, 0.5 / max(np.hypot(*step[:2]), 1e-9), 0.5 / max(abs(step[2]), 1e-9))
    raise AssertionError


CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
TILTED = replace(CAMERA, tilt_rad=(0.02, -0.03), offset_m=(0.03, -0.02))


def outline(pose, rng, noise_px=0.2, hidden=0.2, camera=CAMERA):
    q, wall, _ = predict(pose, camera)
    radius = PAPER_MIRROR.radius_px(q) + rng.normal(0, noise_px, COUNT)
    radius[(wall < 0) | (rng.random(COUNT) < hidden)] = np.nan
    return radius


def fit(start, radius, scales, camera=CAMERA):
    scene, pose = geometry(camera), start.copy()
    fine = Comparison(scene, FloorOutline(radius, Q_STEP, RADIUS_OF_Q, scales, 1.0), room_for(scene))
    settle(pose, fine, thinned(fine))
    return cost_of(fine), pose, fine.prediction


@settings(deadline=None, max_examples=25)
@given(places, seeds, st.sampled_from([CAMERA, TILTED]))
def test_fit_agrees_with_numpy(pose, seed, camera):
    rng = np.random.default_rng(seed)
    radius, scales = outline(pose, rng, camera=camera), np.array([8.0, 5.0, 3.0, 2.0, 1.0])
    start = pose.array + rng.normal(0, (0.05, 0.05, 0.05))
    cost, found, prediction = fit(start, radius, scales, camera)
    expected_cost, expected, q, wall = fit_twin(start, camera, radius, scales, 1.0)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert cost == pytest.approx(expected_cost, abs=1e-5)
    np.testing.assert_allclose(prediction.q, q, atol=1e-5)
    np.testing.assert_array_equal(prediction.wall < 0, wall < 0)


@settings(deadline=None, max_examples=40)
@given(places, seeds)
def test_fit_finds_the_pose_an_outline_was_made_from(pose, seed):
    rng = np.random.default_rng(seed)
    start = pose.array + rng.normal(0, (0.02, 0.02, 0.03))
    _, found, _ = fit(start, outline(pose, rng, 0.05), np.array([8.0, 5.0, 3.0, 2.0, 1.0, 1.0]))
    distance, angle = Pose2(*found).error_to(pose)
    assert distance < 0.005
    assert angle < 0.01


def test_far_from_its_end_a_fit_takes_every_second_bearing_where_these_go_evenly_around():
    scene = geometry(CAMERA)
    outline_px = FloorOutline(outline(Pose2(0.1, 0.2, 0.3), np.random.default_rng(1)), Q_STEP, RADIUS_OF_Q, FAR, 1.0)
    fine = Comparison(scene, outline_px, room_for(scene))
    thin = thinned(fine)
    np.testing.assert_array_equal(thin.scene.cos_b, COS[::2])
    np.testing.assert_array_equal(thin.scene.sin_b, SIN[::2])
    np.testing.assert_array_equal(thin.outline.radius, outline_px.radius[::2])
    near = thinned(fine._replace(outline=outline_px._replace(scales=np.array([2.0, 1.0]))))
    odd = thinned(fine._replace(scene=scene._replace(cos_b=COS[:-1].copy(), sin_b=SIN[:-1].copy())))
    assert (len(near.scene.cos_b), len(odd.scene.cos_b)) == (COUNT, COUNT - 1)


def test_a_fit_from_nowhere_still_says_how_bad_it_is():
    radius = outline(Pose2(0.0, 0.0, 0.0), np.random.default_rng(2))
    nan = fit(np.full(3, np.nan), radius, np.array([2.0, 1.0]))
    assert nan[0] == 1.0  # no wall is met: every bearing counts in full
    assert (nan[2].wall < 0).all()
    nothing = fit(np.zeros(3), np.full(COUNT, np.nan), np.array([2.0, 1.0]))
    assert nothing[0] == 0.0
    np.testing.assert_array_equal(nothing[1], np.zeros(3))


@settings(deadline=None, max_examples=40)
@given(seeds)
def test_summary_agrees_with_numpy(seed):
    rng = np.random.default_rng(seed)
    residual = rng.normal(0, 1.5, 60)
    residual[rng.random(60) < 0.3] = np.nan
    rows = rng.normal(0, 10, (2, 8, 3))
    information, scatter = (r.T @ r for r in rows)
    out = np.empty((3, 3))
    ratio, rms, along = summarise_fit(residual, 1.5, information, scatter, 1.5, 0.008, out)
    seen = residual[np.isfinite(residual)]
    fits = seen[np.abs(seen) < 1.5]
    assert ratio == pytest.approx(len(fits) / len(seen))
    assert rms == pytest.approx(math.sqrt(np.mean(fits**2)))
    inverse = np.linalg.inv(information)
    expected = inverse @ (1.5 * scatter + 0.008 * information) @ inverse
    np.testing.assert_allclose(out, expected, rtol=1e-6, atol=1e-9 * expected.max())
    assert along == pytest.approx(math.sqrt(np.linalg.eigvalsh(expected[:2, :2])[1]))


def test_a_direction_that_nothing_fixes_has_an_infinite_deviation():
    information = np.diag([100.0, 0.0, 50.0])
    ratio, rms, along = summarise_fit(np.full(5, np.nan), 1.5, information, information, 1.5, 0.008, np.empty((3, 3)))
    assert (ratio, rms) == (0.0, 0.0)
    assert along == math.inf


@settings(deadline=None, max_examples=20)
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


@given(seeds)
def test_inliers_and_position_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    residual = rng.normal(0, 2, 50)
    residual[rng.random(50) < 0.3] = np.nan
    known = residual[np.isfinite(residual)]
    inlying = known[np.abs(known) < 1.5]
    ratio, rms = inliers_of(residual, 1.5)
    assert ratio == pytest.approx(len(inlying) / max(len(known), 1))
    assert rms == pytest.approx(math.sqrt((inlying**2).sum() / max(len(inlying), 1)))
    root = rng.normal(size=(7, 7))
    assert position_std_m(root @ root.T) == pytest.approx(np.sqrt(np.linalg.eigvalsh((root @ root.T)[:2, :2])[1]))
