"""Which poses of a search are places of their own, and which are one place found several times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.algebra.distinct import pick_distinct


@dataclass(frozen=True, slots=True)
class Apart:
    """How far two poses are from each other at least, if they are two."""

    m: float  #: poses of one place are nearer to each other than this
    rad: float = math.inf  #: and differ in heading by less than this
    twins: bool = False  #: whether a pose and its half turn about the field's centre are one

    def first(self, poses: FloatArray, most: int) -> list[int]:
        """Return the indices of the first distinct ones of some poses (N, 3), at most this number."""
        picked = np.empty(min(most, len(poses)), dtype=np.int64)
        count = pick_distinct(np.ascontiguousarray(poses), self.m, self.rad, self.twins, picked)
        return [int(index) for index in picked[:count]]

    def is_one(self, pose: Pose2, other: Pose2) -> bool:
        """Whether two poses are one."""
        return self._are_near(pose, other) or (self.twins and self._are_near(pose.half_turn(), other))

    def _are_near(self, pose: Pose2, other: Pose2) -> bool:
        distance_m, angle_rad = pose.error_to(other)
        return distance_m < self.m and angle_rad < self.rad
