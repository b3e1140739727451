"""The compiled pose fit among outliers and landmarks behind the camera."""

import numpy as np

from robocup_vision.camera import PinholeCamera
from robocup_vision.kernels.landmarks.fit import LandmarkPixels, fit_pose
from robocup_vision.landmarks.landmark_map import pinhole_view
from robocup_vision.landmarks.pose_fit import CHI2_2DOF, project, to_world

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


def test_the_covariance_is_as_large_as_the_errors():
    rng, pose, nees = np.random.default_rng(2), np.array([0.3, -0.4, 0.5]), []
    landmarks, covariance, pixels = scene(pose, 7)
    errors = np.linalg.cholesky(covariance)
    for _ in range(60):
        drawn = landmarks + (errors @ rng.normal(size=(len(landmarks), 3, 1)))[..., 0]
        seen = pixels + rng.normal(0.0, 0.5, pixels.shape)
        found, told, _ = compiled(pose, drawn, covariance, seen, np.full(len(pixels), 0.5))
        nees.append((found - pose) @ np.linalg.solve(told, found - pose))
    assert 2.0 < np.mean(nees) < 4.5


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
