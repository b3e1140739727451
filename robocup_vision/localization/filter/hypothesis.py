"""Error models of odometry and frames, and one mode of the pose: a Gaussian that odometry moves and frames update.

Errors of successive frames are correlated: a place, a wrong calibration or a shadow has the same effect on the next
one. So the Gaussian is over the pose and over the present common error of the frames. What odometry gets wrong lasts,
too: for a moment where wheels slip, for good where they or the carpet are not as they were calibrated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.belief import Hypothesis
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2, half_turn_covariance, wrap_angle

# no frame is better than a micrometre, nor a microradian
_MIN_STD = 1e-6
# a half turn about the field's centre, of the parts that have the field's axes; slip has the robot's, gains have none
_FLIP = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0, *[1.0] * 5])
# a motion takes at least this fraction of the time that slip lasts: keeps a quotient finite
_MIN_TIMES = 1e-4
_POSE, _BIAS, _SLIP, _GAIN = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
_STATE = 11


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Errors of odometry: slip in proportion to the motion, gains that are off, and pushes that no wheel measures.

    Slip is a first-order Gauss-Markov process in time and part of the state, so that frames correct it for the next
    moment. Its default is a little more than that of good wheels: odometry with a lasting error of a fifth (worn
    wheels, another carpet) is then still followed with a correct covariance. Gains last: frames that correct them
    correct all the way that comes, as well where no frame shows the pose. They are for odometry of legs, or where
    nobody has calibrated it.

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
    outlier_rate : float
        Fraction of the frames with a wrong pose.
    half_error_rate : float
        Fraction of the frames with a single candidate whose half of the field is wrong; under a half.
    spell_s : float
        A wrong place or half lasts that long in the mean, seconds: frames close together err together.

    Raises
    ------
    ArgumentError
        If one is not within its bounds.
    """

    bias_ratio: float = 0.2
    bias_distance_m: float = 0.5
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


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A pose that a frame allows.

    Parameters
    ----------
    pose : Pose2
        The robot in the field frame.
    bias : (3, 3) float64
        M: the frame measures pose + M b + white noise, b being the bias error in units of its standard deviation.
    white : (3, 3) float64
        Covariance of the white noise.
    half_known : bool
        The frame does not allow its half turn.
    """

    pose: Pose2
    bias: FloatArray
    white: FloatArray
    half_known: bool

    @classmethod
    def of(cls, pose: Pose2, covariance: FloatArray, half_known: bool, bias_ratio: float) -> PoseMeasurement | None:
        """Split a frame's covariance into bias and white noise; None if it is no covariance."""
        if np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max():
            return None
        values, vectors = np.linalg.eigh(covariance)
        if values[0] < -1e-9 * abs(values[2]):
            return None
        values = np.maximum(values, _MIN_STD**2)
        # the symmetric root turns with the field, so that no axis of it is special
        root = (vectors * np.sqrt(values)) @ vectors.T
        whole = (vectors * values) @ vectors.T
        return cls(pose, math.sqrt(bias_ratio) * root, (1 - bias_ratio) * whole, half_known)

    def half_turn(self) -> PoseMeasurement:
        """Return the same measurement of a robot in the other half."""
        return PoseMeasurement(
            self.pose.half_turn(),
            half_turn_covariance(self.bias),
            half_turn_covariance(self.white),
            self.half_known,
        )


@dataclass(frozen=True, slots=True, eq=False)
class PoseMode:
    """A pose modulo the half turn about the field's centre, followed through time.

    Parameters
    ----------
    pose : Pose2
        In the more probable half.
    hidden : (8,) float64
        The bias error of the frames, field frame, and the slip, robot frame: x, y, theta of each; then the odometry's
        lasting errors of way and turn. In standard deviations.
    covariance : (11, 11) float64
        Of pose and hidden.
    log_weight : float
        Logarithm of the probability.
    half_log_odds : float
        ln(p / (1 - p)) for the pose against its half turn; never negative.
    agrees : bool
        With the last frame.
    agreed_s : float
        When a frame last agreed with it.
    reported_half : int
        The half that the last frame with a known half measured: this one (1) or the other (-1); 0: none yet.
    half_reported_s : float
        When.
    inlier_ratio, residual_px : float
        Of the last frame that agreed.
    """

    pose: Pose2
    hidden: FloatArray
    covariance: FloatArray
    log_weight: float
    half_log_odds: float
    agrees: bool
    agreed_s: float
    reported_half: int
    half_reported_s: float
    inlier_ratio: float
    residual_px: float

    @classmethod
    def found(
        cls, measurement: PoseMeasurement, estimate: PoseEstimate, t_s: float, log_weight: float, slip_std: float
    ) -> PoseMode:
        """Begin a mode at a frame's pose, in an unknown half.

        Parameters
        ----------
        measurement : PoseMeasurement
            Where.
        estimate : PoseEstimate
            Of the frame.
        t_s : float
            When it was taken.
        log_weight : float
            As in the class.
        slip_std : float
            Standard deviation of the slip now, in its usual standard deviations.
        """
        covariance = np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, *[slip_std**2] * 3, 1.0, 1.0])
        covariance[_POSE, _POSE] = measurement.bias @ measurement.bias.T + measurement.white
        covariance[_POSE, _BIAS] = -measurement.bias
        covariance[_BIAS, _POSE] = -measurement.bias.T
        return cls(
            measurement.pose,
            np.zeros(_STATE - 3),
            covariance,
            log_weight,
            half_log_odds=0.0,
            agrees=True,
            agreed_s=t_s,
            reported_half=0,
            half_reported_s=-math.inf,
            inlier_ratio=estimate.inlier_ratio,
            residual_px=estimate.residual_px,
        )

    def with_gains_of(self, other: PoseMode) -> PoseMode:
        """Return the mode with what another one knows of the odometry's lasting errors: they are the same anywhere."""
        hidden, covariance = self.hidden.copy(), self.covariance.copy()
        hidden[6:] = other.hidden[6:]
        covariance[_GAIN, _GAIN] = other.covariance[_GAIN, _GAIN]
        return replace(self, hidden=hidden, covariance=covariance)

    def move(self, motion: Pose2, seconds: float, odometry: OdometryNoise, bias_distance_m: float) -> PoseMode:
        """Move the mode by odometry.

        Parameters
        ----------
        motion : Pose2
            In the robot's frame before, by odometry.
        seconds : float
            How long it took.
        odometry : OdometryNoise
            How it errs.
        bias_distance_m : float
            As in `FrameErrors`.
        """
        bias_decay = math.exp(-math.hypot(motion.x_m, motion.y_m) / bias_distance_m)
        # the exact Gauss-Markov process: mean of the slip over the motion, and its end, given its beginning
        times = max(seconds / odometry.slip_s, _MIN_TIMES)
        slip_decay = math.exp(-times)
        mean = (1 - slip_decay) / times
        mean_variance = 2 * (times - 1 + slip_decay) / times**2 - mean**2
        slip, gain = odometry.slip(motion), odometry.gain(motion)
        x, y, theta = (motion.array + mean * slip @ self.hidden[3:6] + gain @ self.hidden[6:]).tolist()
        c, s = math.cos(self.pose.theta_rad), math.sin(self.pose.theta_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        slip = turn @ slip
        kept = np.array([*[bias_decay] * 3, *[slip_decay] * 3, *[math.exp(-seconds / odometry.gain_s)] * 2])
        by_state = np.diag([1.0, 1.0, 1.0, *kept])
        by_state[0, 2], by_state[1, 2] = -s * x - c * y, c * x - s * y
        by_state[_POSE, _SLIP] = mean * slip
        by_state[_POSE, _GAIN] = turn @ gain
        noise = np.diag([0.0, 0.0, 0.0, *(1 - kept**2)])
        noise[_POSE, _POSE] = mean_variance * slip @ slip.T + turn @ odometry.push(seconds) @ turn.T
        noise[_POSE, _SLIP] = mean * (1 - slip_decay) * slip
        noise[_SLIP, _POSE] = noise[_POSE, _SLIP].T
        return replace(
            self,
            pose=self.pose.compose(Pose2(x, y, theta)),
            hidden=self.hidden * kept,
            covariance=by_state @ self.covariance @ by_state.T + noise,
        )

    def widen(self, std_m: float, std_rad: float) -> PoseMode:
        """Return the mode after a motion that nothing measured, of these standard deviations."""
        covariance = self.covariance.copy()
        covariance[_POSE, _POSE] += np.diag([std_m, std_m, std_rad]) ** 2
        return replace(self, covariance=covariance)

    def distance(self, measurement: PoseMeasurement, more: FloatArray | None = None) -> float:
        """Squared Mahalanobis distance of a measurement, 3 degrees of freedom; `more` (3, 3) adds to its covariance."""
        offset, _, spread = self._innovation(measurement)
        return float(offset @ np.linalg.solve(spread if more is None else spread + more, offset))

    def update(self, measurement: PoseMeasurement) -> PoseMode:
        """Update the mode with a measurement, as a Kalman filter does."""
        offset, seen, spread = self._innovation(measurement)
        gain = np.linalg.solve(spread, seen @ self.covariance).T
        change = gain @ offset
        x, y, theta = (self.pose.array + change[:3]).tolist()
        rest = np.eye(_STATE) - gain @ seen
        # Joseph's form, which stays symmetric and positive
        covariance = rest @ self.covariance @ rest.T + gain @ measurement.white @ gain.T
        return replace(self, pose=Pose2(x, y, theta), hidden=self.hidden + change[3:], covariance=covariance)

    def _innovation(self, measurement: PoseMeasurement) -> tuple[FloatArray, FloatArray, FloatArray]:
        seen = np.hstack([np.eye(3), measurement.bias, np.zeros((3, _STATE - 6))])
        offset = pose_offset(measurement.pose, self.pose) - measurement.bias @ self.hidden[:3]
        return offset, seen, seen @ self.covariance @ seen.T + measurement.white

    def half_turn(self) -> PoseMode:
        """Return the same in the other half."""
        return replace(
            self,
            pose=self.pose.half_turn(),
            hidden=_FLIP[3:, 3:] @ self.hidden,
            covariance=_FLIP @ self.covariance @ _FLIP,
            half_log_odds=-self.half_log_odds,
            reported_half=-self.reported_half,
        )

    def merge(self, other: PoseMode) -> PoseMode:
        """Merge with a less probable mode that is nearly the same, keeping mean and covariance of both together."""
        if sum(other.pose.error_to(self.pose)) > sum(other.pose.half_turn().error_to(self.pose)):
            other = other.half_turn()
        log_weight = float(np.logaddexp(self.log_weight, other.log_weight))
        fraction = math.exp(other.log_weight - log_weight)
        apart = np.append(pose_offset(other.pose, self.pose), other.hidden - self.hidden)
        x, y, theta = (self.pose.array + fraction * apart[:3]).tolist()
        half = (1 - fraction) * _probability(self.half_log_odds) + fraction * _probability(other.half_log_odds)
        merged = replace(
            self,
            pose=Pose2(x, y, theta),
            hidden=self.hidden + fraction * apart[3:],
            covariance=(1 - fraction) * self.covariance
            + fraction * other.covariance
            + fraction * (1 - fraction) * np.outer(apart, apart),
            log_weight=log_weight,
            half_log_odds=math.log(half / (1 - half)),
        )
        return merged if merged.half_log_odds >= 0 else merged.half_turn()

    @property
    def hypotheses(self) -> tuple[Hypothesis, Hypothesis]:
        """The pose and its half turn."""
        weight, half = math.exp(self.log_weight), _probability(self.half_log_odds)
        covariance = self.covariance[_POSE, _POSE]
        return (
            Hypothesis(self.pose, read_only(covariance), weight * half),
            Hypothesis(self.pose.half_turn(), read_only(half_turn_covariance(covariance)), weight * (1 - half)),
        )

    @property
    def std_m(self) -> float:
        """The greater standard deviation of x and y."""
        return math.sqrt(max(self.covariance[0, 0], self.covariance[1, 1]))


def pose_offset(pose: Pose2, reference: Pose2) -> FloatArray:
    """(3,) float64: difference of two poses, the angle the short way round."""
    return np.array(
        [pose.x_m - reference.x_m, pose.y_m - reference.y_m, wrap_angle(pose.theta_rad - reference.theta_rad)]
    )


def _probability(log_odds: float) -> float:
    return 1 / (1 + math.exp(-log_odds))
