"""The three cameras that a map is made with: equal, parallel, in an L."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera


@dataclass(frozen=True, eq=False)
class TrinocularRig:
    """Three equal cameras in an L: the right one is the reference, one is to its left and one above it.

    Parameters
    ----------
    right : PinholeCamera
        The reference, as mounted on the robot; its tilt must be known.
    baseline_m : float
        From it to each of the others, along its own image axes.
    """

    right: PinholeCamera
    baseline_m: float = 0.0996

    def __post_init__(self) -> None:
        if not self.baseline_m > 0:
            raise ArgumentError(f"baseline_m must be positive, got {self.baseline_m}")
        if not self.right.known_orientation:
            raise ArgumentError("the rig's camera needs a known tilt_rad")

    @cached_property
    def left(self) -> PinholeCamera:
        """The left camera."""
        return self._moved(np.array([0.0, self.baseline_m, 0.0]))

    @cached_property
    def top(self) -> PinholeCamera:
        """The upper camera."""
        return self._moved(np.array([0.0, 0.0, self.baseline_m]))

    def _moved(self, by_m: FloatArray) -> PinholeCamera:
        x, y, z = self.right.viewpoint_m + self.right.camera_to_robot @ by_m
        return replace(self.right, offset_m=(float(x), float(y)), height_m=float(z))
