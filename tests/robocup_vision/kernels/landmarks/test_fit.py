"""The compiled pose fit and choice of landmarks against plain NumPy; outliers and landmarks behind the camera."""

import math

import numpy as np
import pytest
from landmark_twins import pixel_by_point

from robocup_vision.camera import PinholeCamera
from robocup_vision.kernels.landmarks.fit import LandmarkPixels, fit_pose, most_informative
from robocup_vision.landmarks.index import pinhole_view
from robocup_vision.landmarks.pose_fit import (
    CHI2_2DOF,
    point_by_pose,
    project,
    to_camera,
    to_world,
    world_to_camera,
)

CAMERA = PinholeCamera(
    (320, 240), (277.0, 270.0), (159.5, 119.5), 0.6, offset_m=(0.05, -0.03), pan_rad=0.2, tilt_rad=0.1, roll_rad=0.02
)
VIEW = pinhole_view(CAMERA)
WIDTHS = np.array([30.0, 15.0, 8.0, 5.0, 3.5, 3.5, 3.5, 3.5])


def scene(pose, seed, count=30):
    """Landmarks in view of a pose, their covariances, and where they are seen exactly."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 6, count)
    points = np.stack([depth, depth * rng.uniform(-0.5, 0.5, count), depth * rng.uniform(-0.4, 0.4, count)], axis=-1)
    factor = rng.normal(0, 0.004, (count, 3, 3))
    covariance = factor @ factor.transpose(0, 2, 1) + 1e-6 * np.eye(3)
    return to_world(CAMERA, pose, points), covariance, project(CAMERA, points)


def compiled(start, landmarks, covariance, pixels, std):
    pose, squared = np.empty(3), np.empty(len(landmarks))
    matches = LandmarkPixels(landmarks, covariance, pixels, std)
    normal = fit_pose(VIEW, start, matches, WIDTHS, CHI2_2DOF, pose, squared)
    return pose, np.linalg.inv(normal), squared


def plain_linearise(pose, landmarks, covariance, std):
    """Pixels (N, 2), their derivatives by the pose (N, 2, 3) and inverse covariances (N, 2, 2)."""
    points = to_camera(CAMERA, pose, landmarks)
    by_point = pixel_by_point(CAMERA, points)
    by_world = by_point @ world_to_camera(CAMERA, pose[2])
    spread = by_world @ covariance @ by_world.transpose(0, 2, 1) + (std**2)[:, None, None] * np.eye(2)
    return project(CAMERA, points), by_point @ point_by_pose(CAMERA, pose, landmarks), np.linalg.inv(spread)


def test_outliers_are_distinguished():
    pose = np.array([0.3, -0.4, 0.5])
    landmarks, covariance, pixels = scene(pose, 5)
    std = np.full(len(pixels), 0.3)
    pixels[:8] += np.random.default_rng(1).uniform(10, 30, (8, 2))
    found, _, squared = compiled(pose + np.array([0.03, 0.0, 0.02]), landmarks, covariance, pixels, std)
    np.testing.assert_allclose(found, pose, atol=2e-3)
    assert (squared[:8] > CHI2_2DOF).all()
    assert (squared[8:] < CHI2_2DOF).all()


def test_a_landmark_behind_the_camera_counts_for_nothing():
    pose = np.zeros(3)
    landmarks, covariance, pixels = scene(pose, 6)
    landmarks[0] = (-3.0, 0.0, 0.5)
    start = pose + np.array([0.02, 0.01, 0.01])
    found, _, squared = compiled(start, landmarks, covariance, pixels, np.full(len(pixels), 0.3))
    np.testing.assert_allclose(found, pose, atol=1e-4)
    assert squared[0] == np.inf


@pytest.mark.parametrize("seed", [9, 10, 11])
def test_the_most_informative_are_chosen_as_a_plain_greedy_loop_does(seed):
    pose = np.zeros(3)
    landmarks, covariance, _ = scene(pose, seed, count=80)
    landmarks[3] = (-3.0, 0.0, 0.5)
    rng = np.random.default_rng(seed)
    std, success = rng.uniform(0.2, 0.6, 80), rng.uniform(0.2, 0.9, 80)
    known = np.diag([100.0, 100.0, 1.0 / math.radians(5.0) ** 2])
    chosen = most_informative(VIEW, pose, landmarks, covariance, std, success, known, 10)

    _, jacobian, weight = plain_linearise(pose, landmarks, covariance, std)
    added = success[:, None, None] * (jacobian.transpose(0, 2, 1) @ weight @ jacobian)
    expected, total = [], known
    for _ in range(10):
        gain = np.linalg.slogdet(total + added)[1]
        gain[[3, *expected]] = -math.inf
        expected.append(int(np.argmax(gain)))
        total = total + added[expected[-1]]
    assert chosen.tolist() == expected
