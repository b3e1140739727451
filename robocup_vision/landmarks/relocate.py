"""Locates a camera without a prior: matches its features with the whole map, and solves the perspective problem."""

from __future__ import annotations

import math
from functools import cached_property

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.landmarks.features import MAX_DISTANCE, Features
from robocup_vision.landmarks.landmark_map import LandmarkMap

_KD_TREES = 1  # cv2.FlannBasedMatcher's name for randomised k-d trees
_MAX_FEATURES = 400  # greatest number of a frame's features that are matched, those of the highest contrast
_NEIGHBOURS = 4  # number of nearest views of a feature, among which a rival of another landmark is searched
_MAX_RATIO = 0.8  # greatest ratio of the distances to the nearest and the nearest other landmark (Lowe's ratio test)
# least number of matching features, and of those that agree on one place; fewer may agree by chance
_MIN_AGREE = 8
_REPROJECTION_PX = 3.0  # greatest residual of an inlier, pixels of an image 320 wide
# bounds of the solved camera's height error, and of the robot's lean, which the solver does not know to be upright
_MAX_HEIGHT_ERROR_M = 0.3
_MAX_LEAN_RAD = math.radians(12.0)


class Relocator:
    """Finds a robot on a map without a prior.

    Parameters
    ----------
    landmarks : LandmarkMap
        The map; its index is built when first needed.
    camera : PinholeCamera
        Must have a known tilt.
    """

    def __init__(self, landmarks: LandmarkMap, camera: PinholeCamera) -> None:
        self._landmarks = landmarks
        self._camera = camera

    @cached_property
    def _matcher(self) -> cv2.FlannBasedMatcher:
        cv2.setRNGSeed(1)  # the trees are random; a fixed seed makes them reproducible
        matcher = cv2.FlannBasedMatcher({"algorithm": _KD_TREES, "trees": 4}, {"checks": 96})
        matcher.add([np.ascontiguousarray(self._landmarks.view_unit)])
        matcher.train()
        return matcher

    def prepare(self) -> None:
        """Build the index of descriptors now instead of at the first frame that needs it."""
        _ = self._matcher

    def relocate(self, features: Features) -> FloatArray | NotLocated:
        """Return the robot's approximate pose (3,), as start of a fit, or the reason why there is none."""
        strongest = np.argsort(-features.contrast, kind="stable")[:_MAX_FEATURES]
        rows, landmarks = self._matches(features.take(strongest))
        if len(rows) < _MIN_AGREE:
            return NotLocated(f"only {len(rows)} features match landmarks of the map")
        camera = self._camera
        (fx, fy), (cu, cv) = camera.focal_px, camera.center_px
        matrix = np.array([[fx, 0.0, cu], [0.0, fy, cv], [0.0, 0.0, 1.0]])
        cv2.setRNGSeed(1)
        scale = camera.size_px[0] / 320
        solved, turn, shift, inliers = cv2.solvePnPRansac(
            self._landmarks.positions_m[landmarks].copy(),
            features.pixels[strongest[rows]],
            matrix,
            None,
            iterationsCount=300,
            reprojectionError=_REPROJECTION_PX * scale,
            confidence=0.999,
            flags=cv2.SOLVEPNP_SQPNP,
        )
        agree = 0 if not solved or inliers is None else len(inliers)
        if agree < _MIN_AGREE:
            return NotLocated(f"only {agree} of {len(rows)} features that match landmarks agree on one place")
        return self._on_floor(np.asarray(turn, dtype=np.float64), np.asarray(shift, dtype=np.float64))

    def _matches(self, features: Features) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], ...]:
        """Return indices of features and landmarks that pass the ratio test against the nearest other landmark."""
        rows, landmarks = [], []
        found = self._matcher.knnMatch(np.ascontiguousarray(features.descriptors), k=_NEIGHBOURS)
        for row, neighbours in enumerate(found):
            if not neighbours or neighbours[0].distance > MAX_DISTANCE:
                continue
            first = self._landmarks.view_landmark[neighbours[0].trainIdx]
            rivals = [n.distance for n in neighbours if self._landmarks.view_landmark[n.trainIdx] != first]
            if neighbours[0].distance <= _MAX_RATIO * min(rivals, default=math.inf):
                rows.append(row)
                landmarks.append(first)
        return np.array(rows, dtype=np.int64), np.array(landmarks, dtype=np.int64)

    def _on_floor(self, turn: FloatArray, shift: FloatArray) -> FloatArray | NotLocated:
        """Return the robot's pose (3,) for the solver's camera, whose axes are right, down, ahead."""
        camera = self._camera
        rotation = cv2.Rodrigues(turn)[0]
        eye = (-rotation.T @ shift).ravel()
        # from our camera axes (ahead, left, up) into the solver's
        axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
        in_field = rotation.T @ axes @ camera.camera_to_robot.T  # robot frame to field frame
        lean = math.acos(min(max(float(in_field[2, 2]), -1.0), 1.0))
        if abs(eye[2] - camera.height_m) > _MAX_HEIGHT_ERROR_M or lean > _MAX_LEAN_RAD:
            return NotLocated("the features agree on a place where the robot cannot stand")
        theta = math.atan2(in_field[1, 0] - in_field[0, 1], in_field[0, 0] + in_field[1, 1])
        c, s = math.cos(theta), math.sin(theta)
        dx, dy = camera.offset_m
        return np.array([eye[0] - c * dx + s * dy, eye[1] - s * dx - c * dy, theta])
