"""Error models of odometry and of frames, which the pose filter and its users name.

Errors of successive frames are correlated: a place, a wrong calibration or a shadow has the same effect on the next
one. Errors of odometry last, too: for a moment where wheels slip, for good where wheels or carpet differ from the
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
    """Errors of odometry: slip in proportion to the motion, gains that are off, and pushes that no wheel measures.

    Slip is a first-order Gauss-Markov process in time and part of the state, so that frames correct it for the next
    moment. Its default is a little more than that of good wheels: odometry with a lasting error of a fifth (worn
    wheels, another carpet) is then still followed with a correct covariance. Gain errors last: frames that
    correct them improve all later odometry, also where no frame shows the pose. They are for legged or uncalibrated
    odometry.

    Parameters
    ----------
    slip_ratio : float
        Standard deviation of the slip, as a fraction of the velocity and of the turning rate; and, radians a metre, of
        the turn that driving adds.
    slip_s : float
        How long slip lasts, seconds.
    gain_std : float
        Standard deviation of the lasting error of the way and of the turn, as a fraction of each; 0: calibrated.
    gain_s : float
        How long it lasts, seconds: carpet and wear change during a half.
    push_m, push_rad : float
        Standard deviation of position and heading per root of a second; also while the robot stands.
    shove_per_s : float
        How often wheels spin or the robot is shoved, so that odometry is wrong altogether for a moment. Few enough that
        an outlier near by must last longer than `spell_s` of the frames to be taken for one.
    kidnap_per_s : float
        How often it is carried elsewhere.

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
        """(3, 3) float64: standard deviations of slip that stays the same over a motion, in the robot's frame."""
        way, turn = math.hypot(motion.x_m, motion.y_m), motion.theta_rad
        return self.slip_ratio * np.diag([way, way, math.hypot(way, turn)])

    def gain(self, motion: Pose2) -> FloatArray:
        """(3, 2) float64: standard deviations of what lasting errors of way and turn make of a motion."""
        return self.gain_std * np.array([[motion.x_m, 0.0], [motion.y_m, 0.0], [0.0, motion.theta_rad]])

    def push(self, seconds: float) -> FloatArray:
        """(3, 3) float64: covariance of pushes that no wheel measures, m, m and rad."""
        return seconds * np.diag([self.push_m**2, self.push_m**2, self.push_rad**2])


@dataclass(frozen=True, slots=True)
class FrameErrors:
    """Errors of single frames.

    The bias ratio was measured in the simulation as the correlation of the errors of frames a second apart, in their
    standard deviations: 0.02 to 0.1 (mirror camera, noise sigma 18), 0.1 to 0.7 (pinhole camera, goals), 0.2 to 0.9
    (mirror camera, lines, large field). Frames of the latter two state thrice the variance they have, which makes up
    for a ratio that is set too low.

    Parameters
    ----------
    bias_ratio : float
        Fraction of a frame's stated variance that is an error which the next frames have too. It does not average out
        while the robot stands, and is another error once it has driven `bias_distance_m`. From 0 to under 1.
    bias_distance_m : float
        Metres.
    bias_turn_rad : float
        It is another error, too, once the robot has turned by so much: a camera that looks ahead then shows other
        things. Infinite: as a camera that sees all around.
    outlier_rate : float
        Fraction of the frames with a wrong pose.
    half_error_rate : float
        Fraction of the frames with a single candidate whose half of the field is wrong; under a half.
    spell_s : float
        A wrong place or half lasts that long in the mean, seconds: frames close together err together. So does what a
        frame has of the bias beyond a better one before it.

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


# measured in matches on three fields: of the variance that frames of a robot have which stands, 0.4 to 0.5 is an error
# that lasts; it fell to a third after a turn of half a radian
FORWARD_FRAME_ERRORS = FrameErrors(bias_ratio=0.5, bias_turn_rad=0.5)
