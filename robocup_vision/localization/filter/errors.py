"""Error models of odometry and of frames, for the pose filter.

Errors of successive frames are correlated, because a place, a wrong calibration or a shadow affects them alike. Errors
of odometry are correlated, too: briefly where wheels slip, permanently where wheels or carpet differ from the
calibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Errors of odometry: slip in proportion to the motion, gain errors, and pushes that no wheel measures.

    Slip is a first-order Gauss-Markov process in time and part of the state, so that frames correct it. Its default is
    slightly above that of good wheels, so that odometry with a permanent error of a fifth (worn wheels, another carpet)
    is still tracked with a correct covariance. Gain errors are permanent: once frames have corrected them, all later
    odometry is better. They are meant for legged or uncalibrated odometry.

    Parameters
    ----------
    slip_ratio : float
        Standard deviation of the slip, as a fraction of the velocity and of the turning rate; and of the rotation for
        each metre driven, radians.
    slip_s : float
        Correlation time of slip, seconds.
    gain_std : float
        Standard deviation of the gain errors of way and rotation, as fractions; 0: calibrated.
    gain_s : float
        Correlation time of gain errors, seconds; carpet and wear change during a half.
    push_m, push_rad : float
        Standard deviation of position and heading for the root of a second, also at rest.
    shove_per_s : float
        Rate at which wheels spin or the robot is shoved, so that odometry is wrong for a moment. At the default rate a
        nearby outlier must last longer than `spell_s` of the frames to be taken for one.
    kidnap_per_s : float
        Rate at which the robot is carried elsewhere.

    Raises
    ------
    ArgumentError
        If one is negative, zero where it must not be, or not finite.
    """

    slip_ratio: float = 0.07
    slip_s: float = 0.2
    gain_std: float = 0.0
    gain_s: float = 300.0
    push_m: float = 0.002
    push_rad: float = 0.005
    shove_per_s: float = 0.05
    kidnap_per_s: float = 0.005

    def __post_init__(self) -> None:
        for name in ("slip_ratio", "slip_s", "gain_s", "shove_per_s", "kidnap_per_s"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} of the odometry must be positive, got {value!r}")
        for name in ("gain_std", "push_m", "push_rad"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ArgumentError(f"{name} of the odometry must not be negative, got {value!r}")

    def slip(self, motion: Pose2) -> FloatArray:
        """Return (3, 3) float64: standard deviations of a constant slip over a motion, in the robot's frame."""
        way, turn = math.hypot(motion.x_m, motion.y_m), motion.theta_rad
        return self.slip_ratio * np.diag([way, way, math.hypot(way, turn)])

    def gain(self, motion: Pose2) -> FloatArray:
        """Return (3, 2) float64: standard deviations of a motion due to gain errors of way and rotation."""
        return self.gain_std * np.array([[motion.x_m, 0.0], [motion.y_m, 0.0], [0.0, motion.theta_rad]])

    def push(self, seconds: float) -> FloatArray:
        """Return (3, 3) float64: covariance of pushes that no wheel measures, m, m and rad."""
        return seconds * np.diag([self.push_m**2, self.push_m**2, self.push_rad**2])


@dataclass(frozen=True, slots=True)
class FrameErrors:
    """Errors of single frames.

    Parameters
    ----------
    bias_ratio : float
        Fraction of a frame's stated variance due to an error that the next frames share. It does not average out while
        the robot stands, and changes over `bias_distance_m` of driving. From 0 to under 1.
    bias_distance_m : float
        Metres of driving over which the shared error changes.
    bias_turn_rad : float
        Rotation over which the shared error changes, because a forward camera then sees other things. Infinite for a
        camera that sees all around.
    outlier_rate : float
        Fraction of the frames with a wrong pose.
    half_error_rate : float
        Fraction of the frames with one candidate whose half of the field is wrong; under a half.
    spell_s : float
        Mean duration of a wrong place or half, seconds, because frames close together err alike. It is also the
        correlation time of the bias by which a frame exceeds a better one before it.

    Raises
    ------
    ArgumentError
        If one is not within its bounds.
    """

    bias_ratio: float = 0.2
    bias_distance_m: float = 0.5
    bias_turn_rad: float = math.inf
    outlier_rate: float = 0.02
    half_error_rate: float = 0.05
    spell_s: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= self.bias_ratio < 1:
            raise ArgumentError(f"bias_ratio of the frames must be from 0 to under 1, got {self.bias_ratio!r}")
        for name in ("outlier_rate", "half_error_rate"):
            value = getattr(self, name)
            if not 0 < value < 0.5:
                raise ArgumentError(f"{name} of the frames must be above 0 and under a half, got {value!r}")
        for name in ("bias_distance_m", "spell_s"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} of the frames must be positive, got {value!r}")
        if not self.bias_turn_rad > 0:
            raise ArgumentError(f"bias_turn_rad of the frames must be positive, got {self.bias_turn_rad!r}")

    def bias_kept(self, motion: Pose2) -> float:
        """Return the correlation of the frames' common error before a motion and after it."""
        way_m, turn_rad = math.hypot(motion.x_m, motion.y_m), abs(motion.theta_rad)
        return math.exp(-way_m / self.bias_distance_m - turn_rad / self.bias_turn_rad)


# about half of the variance of a resting robot's frames is shared, until it turns by about half a radian
FORWARD_FRAME_ERRORS = FrameErrors(bias_ratio=0.5, bias_turn_rad=0.5)
