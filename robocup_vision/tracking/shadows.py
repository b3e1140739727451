"""Computes what detections hide from the robot: an object without a detection may be there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Shadows:
    """What hides what from the robot.

    Parameters
    ----------
    eye_m : (2,) float64
        The robot.
    places_m : (M, 2) float64
        Things in view, taken for discs.
    radius_m : float
        Theirs, and that of what they hide.
    """

    eye_m: FloatArray
    places_m: FloatArray
    radius_m: float

    def visible_ratio(self, points_m: FloatArray) -> FloatArray:
        """Return the visible fraction (...) float64 of the width of a disc at each of the points (..., 2)."""
        near, at, half_near = self._polar(self.places_m)
        distance, bearing, half = (v[..., None] for v in self._polar(points_m))
        apart = np.abs(np.remainder(bearing - at + math.pi, math.tau) - math.pi)
        covered = np.clip((half + half_near - apart) / (2 * half), 0.0, 1.0)
        covered = np.where(distance > near + self.radius_m, covered, 0.0).sum(axis=-1)
        return np.asarray(1.0 - np.minimum(covered, 1.0))

    def _polar(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        away = points_m - self.eye_m
        distance = np.maximum(np.hypot(away[..., 0], away[..., 1]), self.radius_m)
        return distance, np.arctan2(away[..., 1], away[..., 0]), np.arcsin(self.radius_m / distance)
