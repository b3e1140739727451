"""Keeps poses on the floor: walls and boards stop a robot, whatever its wheels report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.hypothesis import PoseMode

# a point is moved so far past the floor's edge, inwards
_INSIDE_M = 1e-6


class FloorBound:
    """Moves modes that stand beyond the walls back to the nearest floor.

    Parameters
    ----------
    field : Field
        Where it is a "carpet" that goes on, nothing is bounded.
    """

    def __init__(self, field: Field) -> None:
        self._field = field if field.is_bounded else None
        first = field.floor_polygon
        self._first, self._edge = first, np.roll(first, -1, axis=0) - first

    def nearest(self, x_m: float, y_m: float) -> FloatArray | None:
        """Return the nearest place (2,) on the floor, None if this one is."""
        field = self._field
        if field is None or field.is_on_floor(x_m, y_m):
            return None
        point = np.array([x_m, y_m])
        along = ((point - self._first) * self._edge).sum(axis=1) / (self._edge**2).sum(axis=1)
        feet = self._first + np.clip(along, 0.0, 1.0)[:, None] * self._edge
        foot = feet[int(np.argmin(np.hypot(*(feet - point).T)))]
        # inwards from a side or a corner, whichever way the floor is there
        for angle in np.arange(8) * (np.pi / 4):
            inside = foot + _INSIDE_M * np.array([np.cos(angle), np.sin(angle)])
            if field.is_on_floor(*inside.tolist()):
                return np.asarray(inside)
        return np.asarray(foot)

    def keep(self, mode: PoseMode) -> PoseMode:
        """Return the mode on the floor, as uncertain as it was wrong."""
        place = self.nearest(mode.pose.x_m, mode.pose.y_m)
        if place is None:
            return mode
        off = place - (mode.pose.x_m, mode.pose.y_m)
        covariance = mode.covariance.copy()
        covariance[:2, :2] += np.outer(off, off)
        pose = Pose2(float(place[0]), float(place[1]), mode.pose.theta_rad)
        return replace(mode, pose=pose, covariance=covariance)
