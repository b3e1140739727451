"""Plans the speed along a path among known obstacles, and follows a path.

Miura (2004), section 6.2: the speed is the greatest at which the next viewpoint is still safe. A look takes a fixed
time, so the speed determines the distance between viewpoints and the error that has accumulated at each. The planner
simulates the return of `PathFollower` to the path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.checks import as_positive, require_not_negative
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import path_following as kernel
from robocup_vision.motion_limits import MotionLimits


class PathFollower:
    """Commands velocities towards a point ahead on the path, and stops at its end. It has no state.

    Parameters
    ----------
    ahead_s, ahead_m : float
        Distance of that point: the way at the given speed in `ahead_s`, but at least `ahead_m`. With a nearer point the
        robot returns to the path sooner, but overshoots if the acceleration limit is too low.
    """

    def __init__(self, limits: MotionLimits, *, ahead_s: float = 0.25, ahead_m: float = 0.12) -> None:
        self.limits = limits
        self._ahead_s, self._ahead_m = as_positive("ahead_s", ahead_s), as_positive("ahead_m", ahead_m)
        prepare("planning")

    def ahead(self, speed_mps: float) -> float:
        """Return the distance ahead on the path, metres, at which the follower aims at this speed."""
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
    """Return the path as an array for the kernels; raise ArgumentError if it is invalid."""
    path = np.array(path_m, dtype=np.float64, order="C")
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2 or not np.isfinite(path).all():
        raise ArgumentError(f"a path must be (P, 2), P at least 2, and finite, got {path.shape}")
    return path


@dataclass(frozen=True, slots=True)
class SpeedPlan:
    """A safe speed."""

    speed_mps: float  #: largest safe speed; 0: there is none
    safe: bool  #: whether there is a safe speed. If not, the robot stops, and looks again or takes another way.
    clearance_m: float  #: clearance at that speed in the worst case considered; negative if no speed is safe
    reason: str  #: the reason, as text


@dataclass(frozen=True, slots=True, eq=False)
class PoseNoise:
    """The growth of the pose's error between looks, and its size after a look."""

    #: standard deviation of odometry as a fraction of the distance, along and across it
    along: float
    aside: float
    #: (3, 3) float64: covariance of a pose (x_m, y_m, theta_rad) right after a look, including the errors that all
    #: looks have in common (calibration, map)
    look_covariance: FloatArray

    def __post_init__(self) -> None:
        require_not_negative(self, "along", "aside")
        covariance = read_only(self.look_covariance)
        if covariance.shape != (3, 3):
            raise ArgumentError(f"look_covariance must be (3, 3), got {covariance.shape}")
        object.__setattr__(self, "look_covariance", covariance)


_SIGMAS = 3.0  # errors up to this number of standard deviations are considered
# ratio of successive speeds that are tried, and their number; a robot slower than the last one gains nothing by driving
_SLOWER_RATIO = 0.85
_SPEEDS = 20


class SpeedPlanner:
    """Plans speeds along paths among discs; one object serves all paths.

    Parameters
    ----------
    robot_radius_m : float
        Radius of the robot plus the clearance that it keeps.
    look_period_s, period_s : float
        Time between two looks, and between two commands.
    """

    def __init__(
        self,
        follower: PathFollower,
        robot_radius_m: float,
        noise: PoseNoise,
        look_period_s: float,
        period_s: float = 1 / 30,
    ) -> None:
        self.follower, self.noise = follower, noise
        self.robot_radius_m = as_positive("robot_radius_m", robot_radius_m)
        self.look_period_s = as_positive("look_period_s", look_period_s)
        self.period_s = as_positive("period_s", period_s)
        top = follower.limits.speed_mps
        self._speeds = [top * _SLOWER_RATIO**k for k in range(_SPEEDS)]

    def plan(
        self,
        path_m: FloatArray,
        pose: Pose2,
        covariance: FloatArray,
        velocity_mps: Sequence[float],
        discs: Sequence[Disc],
        pending_mps: Sequence[float] | None = None,
        until_look_s: float | None = None,
    ) -> SpeedPlan:
        """Return the largest safe speed from here. Call it at each look, or at each command.

        Parameters
        ----------
        path_m : (P, 2) float64
            The path, field frame.
        pose, covariance : Pose2, (3, 3) float64
            Estimated pose of the robot, and its covariance.
        velocity_mps : (2,)
            Velocity of the robot, field frame.
        discs : sequence of Disc
            Obstacles, field frame, as standing.
        pending_mps : (2,), optional
            The command that the robot obeys until the next one takes effect, field frame; default: the velocity.
        until_look_s : float, optional
            Time until the next look; default: a whole period.
        """
        path = checked_path(path_m)
        pose_covariance = np.array(covariance, dtype=np.float64)
        if pose_covariance.shape != (3, 3):
            raise ArgumentError(f"covariance must be (3, 3), got {pose_covariance.shape}")
        velocity = (float(velocity_mps[0]), float(velocity_mps[1]))
        pending = velocity if pending_mps is None else (float(pending_mps[0]), float(pending_mps[1]))
        table = np.array(
            [
                (
                    d.x_m,
                    d.y_m,
                    d.radius_m + self.robot_radius_m,
                    d.covariance[0, 0],
                    d.covariance[0, 1],
                    d.covariance[1, 1],
                )
                for d in discs
            ],
            dtype=np.float64,
        ).reshape(-1, 6)
        until_look = self.look_period_s if until_look_s is None else float(until_look_s)
        limits = self.follower.limits
        start = kernel.Start((pose.x_m, pose.y_m), velocity, pending, pose_covariance)
        clearance, nearest = -math.inf, -1
        for speed in self._speeds:
            way = kernel.Following(
                speed, self.follower.ahead(speed), limits.acceleration_mps2, limits.dead_time_s, self.period_s,
                until_look, (self.noise.along, self.noise.aside),
            )  # fmt: skip
            clearance, which = kernel.min_clearance(path, start, way, table, _SIGMAS)
            if clearance >= 0.0:
                if speed == self._speeds[0]:
                    return SpeedPlan(speed, True, clearance, f"full speed: {_room(clearance, discs, which)}")
                slow = f"slow, {speed:.2f} m/s: {_around(discs, nearest)}, sigma {_sigma(pose_covariance):.2f} m"
                return SpeedPlan(speed, True, clearance, slow)
            nearest = which
        sigma = _sigma(pose_covariance)
        return SpeedPlan(0.0, False, clearance, f"no safe speed: {_around(discs, nearest)}, sigma {sigma:.2f} m")


def _sigma(covariance: FloatArray) -> float:
    return float(math.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))


def _around(discs: Sequence[Disc], which: int) -> str:
    """Describe the narrow place: the gap between a disc and its nearest neighbour, or the disc alone."""
    first = discs[which]
    gaps = [
        math.hypot(d.x_m - first.x_m, d.y_m - first.y_m) - d.radius_m - first.radius_m
        for k, d in enumerate(discs)
        if k != which
    ]
    if gaps and min(gaps) < 1.0:
        return f"gap {min(gaps):.2f} m"
    return f"opponent at ({first.x_m:.2f}, {first.y_m:.2f})"


def _room(clearance: float, discs: Sequence[Disc], which: int) -> str:
    return "nothing near" if which < 0 or not discs else f"{clearance:.2f} m to spare"
