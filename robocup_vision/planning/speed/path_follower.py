"""Follows a path at a given speed. The planner of speeds simulates this controller's return to the path."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import path_following as kernel
from robocup_vision.motion_limits import MotionLimits


class PathFollower:
    """Commands velocities towards a point ahead on the path, and to rest at its end. It has no state.

    Parameters
    ----------
    limits : MotionLimits
        How the robot moves.
    ahead_s, ahead_m : float
        Distance of that point: so many seconds at the given speed, at least so many metres. With a nearer point the
        robot returns to the path sooner, but overshoots where the acceleration cannot follow.
    """

    def __init__(self, limits: MotionLimits, *, ahead_s: float = 0.25, ahead_m: float = 0.12) -> None:
        for name, value in (("ahead_s", ahead_s), ("ahead_m", ahead_m)):
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} must be positive, got {value!r}")
        self.limits = limits
        self._ahead_s, self._ahead_m = float(ahead_s), float(ahead_m)
        prepare("planning")

    def ahead(self, speed_mps: float) -> float:
        """Return how many metres ahead on the path it aims at this speed."""
        return max(self._ahead_m, self._ahead_s * speed_mps)

    def command(self, path_m: FloatArray, pose: Pose2, speed_mps: float) -> FloatArray:
        """Return the velocity (2,) to command, m/s, robot frame.

        Parameters
        ----------
        path_m : (P, 2) float64
            The path, field frame, P at least 2.
        pose : Pose2
            Estimated pose of the robot, field frame.
        speed_mps : float
            Largest speed.
        """
        path = checked_path(path_m)
        speed = min(max(speed_mps, 0.0), self.limits.speed_mps)
        place = (pose.x_m, pose.y_m)
        velocity = kernel.follow(path, place, speed, self.ahead(speed), self.limits.acceleration_mps2)
        return read_only(Pose2(0.0, 0.0, -pose.theta_rad).transform(velocity))


def checked_path(path_m: FloatArray | Sequence[Sequence[float]]) -> FloatArray:
    """Return the path as an array the kernels take, or refuse it."""
    path = np.array(path_m, dtype=np.float64, order="C")
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2 or not np.isfinite(path).all():
        raise ArgumentError(f"a path must be (P, 2), P at least 2, and finite, got {path.shape}")
    return path
