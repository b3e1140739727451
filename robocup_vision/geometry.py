"""Poses, angles and their covariances in the plane (ROS REP-103: x forward, y left, angles counter-clockwise)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray

_HALF_TURN_SIGNS = np.array([[1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])


def wrap_angle(angle_rad: float) -> float:
    """Return an equivalent angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped <= -math.pi else wrapped


def in_degrees(angle: float) -> str:
    """Return the end of a message about an angle that is too large, with its value in radians if it was in degrees."""
    return f"; {angle:g} degrees are {math.radians(angle):.4f} rad"


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose in the plane; also the transform from the moving frame into the reference frame.

    Parameters
    ----------
    x_m, y_m : float
        Position of the moving frame's origin in the reference frame, metres.
    theta_rad : float
        Direction of the moving frame's x axis in the reference frame, radians, wrapped into (-pi, pi].

    Raises
    ------
    ArgumentError
        If `theta_rad` is not a finite number.
    """

    x_m: float
    y_m: float
    theta_rad: float

    def __post_init__(self) -> None:
        try:
            wrapped = wrap_angle(self.theta_rad)
        except (TypeError, ValueError, OverflowError):
            raise ArgumentError(f"theta_rad must be a finite number, got {self.theta_rad!r}") from None
        object.__setattr__(self, "theta_rad", wrapped)

    @property
    def array(self) -> FloatArray:
        """(3,) float64: x_m, y_m, theta_rad."""
        return np.array([self.x_m, self.y_m, self.theta_rad])

    def compose(self, other: Pose2) -> Pose2:
        """Return `self * other`: the pose in the reference frame of `other`, which is given in this pose's frame."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose2(
            self.x_m + c * other.x_m - s * other.y_m,
            self.y_m + s * other.x_m + c * other.y_m,
            self.theta_rad + other.theta_rad,
        )

    def inverse(self) -> Pose2:
        """Return the inverse transform: the pose of the reference frame in the moving frame."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose2(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, -self.theta_rad)

    def transform(self, points_m: npt.ArrayLike) -> FloatArray:
        """Map points (..., 2), metres, from the moving frame into the reference frame."""
        points = np.asarray(points_m, dtype=np.float64)
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return np.asarray(points @ np.array([[c, s], [-s, c]]) + (self.x_m, self.y_m))

    def half_turn(self) -> Pose2:
        """Return the pose turned by pi about the field's centre; on a point-symmetric field both look the same."""
        return Pose2(-self.x_m, -self.y_m, self.theta_rad + math.pi)

    def error_to(self, truth: Pose2, *, symmetric: bool = False) -> tuple[float, float]:
        """Return (position error in metres, absolute heading error in radians).

        Parameters
        ----------
        truth : Pose2
            The pose to compare with.
        symmetric : bool
            Whether the error counts modulo a half turn about the field's centre. The pose with the smaller sum of both
            errors (metres plus radians) counts, because near the centre only the heading distinguishes the two.
        """
        if symmetric:
            return min(self.error_to(truth), self.half_turn().error_to(truth), key=lambda e: e[0] + e[1])
        return (
            math.hypot(self.x_m - truth.x_m, self.y_m - truth.y_m),
            abs(wrap_angle(self.theta_rad - truth.theta_rad)),
        )


def compose_covariance(first: Pose2, first_cov: FloatArray, second: Pose2, second_cov: FloatArray) -> FloatArray:
    """Covariance (3, 3) of `first.compose(second)` for independent poses, to first order.

    Parameters
    ----------
    first, second : Pose2
        The poses that are composed.
    first_cov, second_cov : (3, 3) float64
        Their covariances in (x_m, y_m, theta_rad); `second_cov` in `first`'s frame.
    """
    c, s = math.cos(first.theta_rad), math.sin(first.theta_rad)
    by_first = np.array(
        [[1.0, 0.0, -s * second.x_m - c * second.y_m], [0.0, 1.0, c * second.x_m - s * second.y_m], [0.0, 0.0, 1.0]]
    )
    by_second = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(by_first @ first_cov @ by_first.T + by_second @ second_cov @ by_second.T)


def turned_covariance(covariance: FloatArray, theta_rad: float) -> FloatArray:
    """Covariance (2, 2) of a place after a rotation by an angle."""
    c, s = math.cos(theta_rad), math.sin(theta_rad)
    turn = np.array([[c, -s], [s, c]])
    return np.asarray(turn @ covariance @ turn.T)


def half_turn_covariance(covariance: FloatArray) -> FloatArray:
    """Covariance (3, 3) of `pose.half_turn()`: x and y change sign, and so do their products with theta."""
    return np.asarray(covariance * _HALF_TURN_SIGNS)
