"""Pose fits recover exact poses, agree with each other, and shrug off outliers; derivatives against differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from robocup_vision.camera import PinholeCamera
from robocup_vision.kernels.landmarks.fit import LandmarkPixels, fit_pose
from robocup_vision.landmarks.landmark_map import pinhole_view
from robocup_vision.landmarks.mapping.refinement import Observations, refine
from robocup_vision.landmarks.mapping.run_files import TrinocularRig
from robocup_vision.landmarks.mapping.stereo import place
from robocup_vision.landmarks.pose_fit import (
    CHI2_2DOF,
    fit_stereo,
    point_by_pose,
    project,
    to_camera,
    to_world,
    world_to_camera,
)

CAMERA = PinholeCamera(
    (320, 240), (277.0, 270.0), (159.5, 119.5), 0.6, offset_m=(0.05, -0.03), pan_rad=0.2, tilt_rad=0.1, roll_rad=0.02
)
POSES = st.tuples(numbers(-3, 3), numbers(-3, 3), numbers(-3, 3)).map(np.array)


def scene(pose, seed, count=30):
    """Landmarks in view of a pose, their covariances, and where they are seen exactly."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 6, count)
    points = np.stack([depth, depth * rng.uniform(-0.5, 0.5, count), depth * rng.uniform(-0.4, 0.4, count)], axis=-1)
    landmarks = to_world(CAMERA, pose, points)
    factor = rng.normal(0, 0.004, (count, 3, 3))
    covariance = factor @ factor.transpose(0, 2, 1) + 1e-6 * np.eye(3)
    return landmarks, covariance, project(CAMERA, points), points


@given(POSES, st.integers(0, 10**6))
def test_projection_inverts_and_derives(pose, seed):
    landmarks, _, pixels, points = scene(pose, seed)
    np.testing.assert_allclose(to_camera(CAMERA, pose, landmarks), points, atol=1e-9)
    robot = np.column_stack([landmarks[:, :2] - pose[:2], landmarks[:, 2]])
    c, s = math.cos(pose[2]), math.sin(pose[2])
    robot[:, :2] = robot[:, :2] @ np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(pixels, CAMERA.point_to_pixel(robot), atol=1e-6)
    np.testing.assert_allclose(
        world_to_camera(CAMERA, pose[2]) @ (landmarks[0] - landmarks[1]), points[0] - points[1], atol=1e-9
    )
    by_pose = point_by_pose(CAMERA, pose, landmarks)
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        difference = (to_camera(CAMERA, pose + step, landmarks) - to_camera(CAMERA, pose - step, landmarks)) / 2e-6
        np.testing.assert_allclose(by_pose[:, :, k], difference, rtol=1e-4, atol=1e-6)


@given(POSES, st.integers(0, 10**6))
def test_exact_points_give_the_exact_pose(pose, seed):
    landmarks, covariance, _, points = scene(pose, seed)
    start = pose + np.array([0.06, -0.05, 0.04])
    spread = np.tile(np.eye(3) * 1e-4, (len(points), 1, 1))
    fit = fit_stereo(CAMERA, start, landmarks, covariance, points, spread)
    np.testing.assert_allclose(fit.pose, pose, atol=1e-5)
    assert fit.inliers.all()


def test_stereo_placement_and_its_covariance():
    rig = TrinocularRig(CAMERA)
    point = np.array([[3.0, 0.4, -0.3]])
    (u, v), (fx, fy) = project(CAMERA, point)[0], CAMERA.focal_px
    measured = np.array([[u, v, u + fx * rig.baseline_m / 3, v + fy * rig.baseline_m / 3]])
    placed, covariance = place(rig, measured, np.array([0.3]))
    np.testing.assert_allclose(placed, point, atol=1e-9)
    rng = np.random.default_rng(0)
    noisy = measured + rng.normal(0, 0.3, (20000, 4))
    drawn, _ = place(rig, noisy, np.full(20000, 0.3))
    np.testing.assert_allclose(np.cov(drawn.T), covariance[0], rtol=0.15, atol=2e-6)
    # the other two cameras see it there
    for camera, expected in ((rig.left, (measured[0, 2], v)), (rig.top, (u, measured[0, 3]))):
        robot = point @ CAMERA.camera_to_robot.T + CAMERA.viewpoint_m
        np.testing.assert_allclose(camera.point_to_pixel(robot)[0], expected, atol=1e-6)


def test_refinement_undoes_what_was_disturbed():
    rng = np.random.default_rng(4)
    rig = TrinocularRig(CAMERA)
    poses = np.column_stack([np.linspace(0, 0.5, 6), np.zeros(6), np.linspace(0, 0.2, 6)])
    landmarks, *_ = scene(poses[2], 8, count=60)
    (fx, fy), rows = CAMERA.focal_px, []
    for k, pose in enumerate(poses):
        points = to_camera(CAMERA, pose, landmarks)
        pixels, depth = project(CAMERA, points), points[:, 0]
        shift = np.column_stack(
            [pixels[:, 0] + fx * rig.baseline_m / depth, pixels[:, 1] + fy * rig.baseline_m / depth]
        )
        rows += [(k, i, *pixels[i], *shift[i]) for i in np.flatnonzero(depth > 0.3)]
    table = np.array(rows)
    observations = Observations(
        table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2:], np.full(len(table), 0.3)
    )
    fixed = np.arange(6) == 0
    start = poses + ~fixed[:, None] * rng.normal(0, 0.01, poses.shape)
    refined = refine(rig, start, landmarks + rng.normal(0, 0.02, landmarks.shape), observations, fixed, iterations=15)
    np.testing.assert_allclose(refined.poses, poses, atol=1e-5)
    np.testing.assert_allclose(refined.landmarks_m, landmarks, atol=1e-3)
    assert (refined.pose_covariances[0] == 0).all()
    assert (np.linalg.eigvalsh(refined.pose_covariances[1:]) > 0).all()
    assert refined.noise.max() < 1  # nothing is left over
    # with noise, what is left over is what was put in
    noisy = Observations(
        observations.frame,
        observations.landmark,
        observations.measured_px + rng.normal(0, 0.3, (len(table), 4)),
        observations.std_px,
    )
    assert np.median(refine(rig, poses, landmarks, noisy, fixed, iterations=5).noise) == pytest.approx(1.0, abs=0.1)


VIEW = pinhole_view(CAMERA)
WIDTHS = np.array([30.0, 15.0, 8.0, 5.0, 3.5, 3.5, 3.5, 3.5])


def compiled(start, landmarks, covariance, pixels, std):
    pose, squared = np.empty(3), np.empty(len(landmarks))
    matches = LandmarkPixels(landmarks, covariance, pixels, std)
    normal = fit_pose(VIEW, start, matches, WIDTHS, CHI2_2DOF, pose, squared)
    return pose, np.linalg.inv(normal), squared


def test_the_covariance_is_as_large_as_the_errors():
    rng, pose, nees = np.random.default_rng(2), np.array([0.3, -0.4, 0.5]), []
    landmarks, covariance, pixels, _ = scene(pose, 7)
    errors = np.linalg.cholesky(covariance)
    for _ in range(60):
        drawn = landmarks + (errors @ rng.normal(size=(len(landmarks), 3, 1)))[..., 0]
        seen = pixels + rng.normal(0.0, 0.5, pixels.shape)
        found, told, _ = compiled(pose, drawn, covariance, seen, np.full(len(pixels), 0.5))
        nees.append((found - pose) @ np.linalg.solve(told, found - pose))
    assert 2.0 < np.mean(nees) < 4.5


def test_outliers_are_distinguished():
    pose = np.array([0.3, -0.4, 0.5])
    landmarks, covariance, pixels, _ = scene(pose, 5)
    std = np.full(len(pixels), 0.3)
    pixels[:8] += np.random.default_rng(1).uniform(10, 30, (8, 2))
    found, _, squared = compiled(pose + np.array([0.03, 0.0, 0.02]), landmarks, covariance, pixels, std)
    np.testing.assert_allclose(found, pose, atol=2e-3)
    assert (squared[:8] > CHI2_2DOF).all()
    assert (squared[8:] < CHI2_2DOF).all()


def test_a_landmark_behind_the_camera_counts_for_nothing():
    pose = np.zeros(3)
    landmarks, covariance, pixels, _ = scene(pose, 6)
    landmarks[0] = (-3.0, 0.0, 0.5)
    start = pose + np.array([0.02, 0.01, 0.01])
    found, _, squared = compiled(start, landmarks, covariance, pixels, np.full(len(pixels), 0.3))
    np.testing.assert_allclose(found, pose, atol=1e-4)
    assert squared[0] == np.inf
