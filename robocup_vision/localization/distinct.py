"""Tests whether poses belong to the same place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.algebra.distinct import pick_distinct

# chi-square with 3 degrees of freedom, 99.9 %
_MAX_SAME_DISTANCE2 = 16.27


def pose_offset(pose: Pose2, reference: Pose2) -> FloatArray:
    """Return the difference of two poses, (3,) float64, with the angle within half a turn."""
    return np.array(
        [pose.x_m - reference.x_m, pose.y_m - reference.y_m, wrap_angle(pose.theta_rad - reference.theta_rad)]
    )


def squared_distance(pose: Pose2, other: Pose2, covariance: FloatArray) -> float:
    """Return the squared Mahalanobis distance of two poses, given the covariance (3, 3) of their difference."""
    offset = pose_offset(pose, other)
    return float(offset @ np.linalg.solve(covariance, offset))


def may_be_one(pose: Pose2, other: Pose2, covariance: FloatArray) -> bool:
    """Whether two poses may belong to one place, given the covariance (3, 3) of their difference."""
    return squared_distance(pose, other, covariance) <= _MAX_SAME_DISTANCE2


@dataclass(frozen=True, slots=True)
class Apart:
    """Least distance of two poses that count as different."""

    m: float  #: equal poses are closer than this, metres
    rad: float = math.inf  #: headings of equal poses differ by less than this, radians
    twins: bool = False  #: whether a pose and its half turn about the field's centre count as one

    def first(self, poses: FloatArray, most: int) -> list[int]:
        """Return the indices of the first distinct poses (N, 3), at most `most`."""
        picked = np.empty(min(most, len(poses)), dtype=np.int64)
        count = pick_distinct(np.ascontiguousarray(poses), self.m, self.rad, self.twins, picked)
        return [int(index) for index in picked[:count]]

    def is_one(self, pose: Pose2, other: Pose2) -> bool:
        """Whether two poses are one."""
        return self._are_near(pose, other) or (self.twins and self._are_near(pose.half_turn(), other))

    def _are_near(self, pose: Pose2, other: Pose2) -> bool:
        distance_m, angle_rad = pose.error_to(other)
        return distance_m < self.m and angle_rad < self.rad
