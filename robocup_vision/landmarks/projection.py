"""Landmarks as a robot's camera sees them, and how their images move with the pose and with the landmark.

The paper's state (X, Z, theta) on the floor is a `Pose2` here: its Z (ahead) is the robot's x, its X (right) is -y, its
Y (down) is -z, and theta grows counter-clockwise. Landmarks are in the field frame, metres, z up from the floor.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.camera.projection import project_ideal


def world_to_camera(camera: PinholeCamera, theta_rad: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) from the field frame into the camera frame at headings (...)."""
    theta = np.asarray(theta_rad, dtype=np.float64)
    c, s, zero, one = np.cos(theta), np.sin(theta), np.zeros_like(theta), np.ones_like(theta)
    turn = np.stack([np.stack([c, s, zero], -1), np.stack([-s, c, zero], -1), np.stack([zero, zero, one], -1)], -2)
    return np.asarray(camera.camera_to_robot.T @ turn)


def to_camera(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Points (N, 3) of the field frame in the camera frame of a robot at pose (3,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points_m[:, 0] - pose[0], points_m[:, 1] - pose[1]
    robot = np.stack([c * dx + s * dy, c * dy - s * dx, points_m[:, 2]], axis=-1)
    return np.asarray((robot - camera.viewpoint_m) @ camera.camera_to_robot)


def to_world(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Points (N, 3) of the camera frame in the field frame: the inverse of `to_camera`."""
    robot = points_m @ camera.camera_to_robot.T + camera.viewpoint_m
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = robot[:, 0], robot[:, 1]
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y, robot[:, 2]], axis=-1)


def project(camera: PinholeCamera, points_m: FloatArray) -> FloatArray:
    """Ideal pixels (N, 2) of points (N, 3) in the camera frame; NaN behind the camera. Eq. 15."""
    return project_ideal(camera.focal_px, camera.center_px, points_m)


def point_by_pose(camera: PinholeCamera, pose: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return derivatives (N, 3, 3) of points in the camera frame by the pose, for points (N, 3) of the field frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = points_m[:, 0] - pose[0], points_m[:, 1] - pose[1]
    robot = np.zeros((len(points_m), 3, 3))
    robot[:, 0, 0], robot[:, 0, 1], robot[:, 0, 2] = -c, -s, c * dy - s * dx
    robot[:, 1, 0], robot[:, 1, 1], robot[:, 1, 2] = s, -c, -c * dx - s * dy
    return np.asarray(camera.camera_to_robot.T @ robot)
