"""One mode of the pose filter: a Gaussian that odometry predicts and frames update.

Its state is the pose, the bias that frames share, and the slip and the gain errors of odometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.belief import Hypothesis
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2, half_turn_covariance
from robocup_vision.localization.distinct import pose_offset
from robocup_vision.localization.filter.errors import FrameErrors, OdometryNoise

# least standard deviation of a frame, m and rad
_MIN_STD = 1e-6
# half turn about the field's centre: pose and bias have the field's axes, slip has the robot's, gains have none
_FLIP = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0, *[1.0] * 5])
# least duration of a motion relative to the slip's correlation time, so that a quotient is finite
_MIN_TIMES = 1e-4
# bounds that keep numbers finite for frames of one time, and for long motions without a frame
_MAX_REPEATED, _MIN_KEPT, _MAX_BIAS = 0.9, 1e-3, 1e2
_POSE, _BIAS, _SLIP, _GAIN = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
_STATE = 11
# a frame measures the sum of pose and bias
_SEEN = np.hstack([np.eye(3), np.eye(3), np.zeros((3, _STATE - 6))])


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A pose by a frame."""

    pose: Pose2  #: the robot in the field frame
    #: (3, 3) float64: covariances of bias and white noise; the measurement is pose + bias + white noise
    bias: FloatArray
    white: FloatArray
    half_known: bool  #: whether the frame excludes its half turn

    @classmethod
    def of(cls, pose: Pose2, covariance: FloatArray, half_known: bool, bias_ratio: float) -> PoseMeasurement | None:
        """Divide a frame's covariance into bias and white noise; None if it is not a covariance."""
        if np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max():
            return None
        values, vectors = np.linalg.eigh(covariance)
        if values[0] < -1e-9 * abs(values[2]):
            return None
        values = np.maximum(values, _MIN_STD**2)
        whole = (vectors * values) @ vectors.T
        return cls(pose, bias_ratio * whole, (1 - bias_ratio) * whole, half_known)

    def half_turn(self) -> PoseMeasurement:
        """Return the half turn of the measurement."""
        return PoseMeasurement(
            self.pose.half_turn(),
            half_turn_covariance(self.bias),
            half_turn_covariance(self.white),
            self.half_known,
        )


@dataclass(frozen=True, slots=True, eq=False)
class PoseMode:
    """A pose modulo the half turn about the field's centre, tracked over time."""

    pose: Pose2  #: the pose in the more probable half
    #: (8,) float64: bias of the frames, field frame, m, m and rad; slip, robot frame, x, y, theta; gain errors of way
    #: and rotation. The latter two are in standard deviations.
    hidden: FloatArray
    covariance: FloatArray  #: (11, 11) float64: covariance of `pose` and `hidden`
    #: (3, 3) float64: prior covariance of the bias, of the best of the last matching frames
    bias: FloatArray
    bias_kept: float  #: correlation of the bias with that of the last of these frames, after the motion since
    log_weight: float  #: logarithm of the probability
    half_log_odds: float  #: ln(p / (1 - p)) for the pose against its half turn; never negative
    agrees: bool  #: whether the last frame matches
    agreed_s: float  #: time of the last matching frame
    #: half measured by the last frame with a known half: that of `pose` (1) or the other (-1); 0 if none yet
    reported_half: int
    half_reported_s: float  #: time of that frame
    #: inlier ratio and residual of the last matching frame
    inlier_ratio: float
    residual_px: float

    @classmethod
    def found(
        cls, measurement: PoseMeasurement, estimate: PoseEstimate, t_s: float, log_weight: float, slip_std: float
    ) -> PoseMode:
        """Make a mode at a frame's pose, in an unknown half.

        `slip_std` is the present standard deviation of the slip, relative to its usual one.
        """
        covariance = np.diag([*[0.0] * 6, *[slip_std**2] * 3, 1.0, 1.0])
        covariance[_POSE, _POSE] = measurement.bias + measurement.white
        covariance[_BIAS, _BIAS] = measurement.bias
        covariance[_POSE, _BIAS] = covariance[_BIAS, _POSE] = -measurement.bias
        return cls(
            measurement.pose,
            np.zeros(_STATE - 3),
            covariance,
            measurement.bias,
            1.0,
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
        """Return the mode with the gain errors of another mode, because they do not depend on the place."""
        hidden, covariance = self.hidden.copy(), self.covariance.copy()
        hidden[6:] = other.hidden[6:]
        covariance[_GAIN, _GAIN] = other.covariance[_GAIN, _GAIN]
        return replace(self, hidden=hidden, covariance=covariance)

    def move(self, motion: Pose2, seconds: float, odometry: OdometryNoise, errors: FrameErrors) -> PoseMode:
        """Predict the mode by odometry, given in the robot's frame before the motion."""
        # the bias changes with the place, so its covariance grows until a frame bounds it
        bias_kept = max(errors.bias_kept(motion), _MIN_KEPT)
        more_bias = (1 / bias_kept - 1) * self.bias if self.bias.trace() < _MAX_BIAS else np.zeros((3, 3))
        # exact Gauss-Markov process: mean of the slip over the motion, and its end, given its beginning
        times = max(seconds / odometry.slip_s, _MIN_TIMES)
        slip_decay = math.exp(-times)
        mean = (1 - slip_decay) / times
        mean_variance = 2 * (times - 1 + slip_decay) / times**2 - mean**2
        slip, gain = odometry.slip(motion), odometry.gain(motion)
        x, y, theta = (motion.array + mean * slip @ self.hidden[3:6] + gain @ self.hidden[6:]).tolist()
        c, s = math.cos(self.pose.theta_rad), math.sin(self.pose.theta_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        slip = turn @ slip
        kept = np.array([*[1.0] * 3, *[slip_decay] * 3, *[math.exp(-seconds / odometry.gain_s)] * 2])
        by_state = np.diag([1.0, 1.0, 1.0, *kept])
        by_state[0, 2], by_state[1, 2] = -s * x - c * y, c * x - s * y
        by_state[_POSE, _SLIP] = mean * slip
        by_state[_POSE, _GAIN] = turn @ gain
        noise = np.diag([*[0.0] * 6, *(1 - kept[3:] ** 2)])
        noise[_BIAS, _BIAS] = more_bias
        noise[_POSE, _POSE] = mean_variance * slip @ slip.T + turn @ odometry.push(seconds) @ turn.T
        noise[_POSE, _SLIP] = mean * (1 - slip_decay) * slip
        noise[_SLIP, _POSE] = noise[_POSE, _SLIP].T
        return replace(
            self,
            pose=self.pose.compose(Pose2(x, y, theta)),
            hidden=self.hidden * kept,
            covariance=by_state @ self.covariance @ by_state.T + noise,
            bias=self.bias + more_bias,
            bias_kept=self.bias_kept * bias_kept,
        )

    def widen(self, std_m: float, std_rad: float) -> PoseMode:
        """Return the mode after an unmeasured motion of these standard deviations."""
        covariance = self.covariance.copy()
        covariance[_POSE, _POSE] += np.diag([std_m, std_m, std_rad]) ** 2
        return replace(self, covariance=covariance)

    def facing(self, measurement: PoseMeasurement) -> FacedFrame:
        """Return the mode before a frame whose bias has another covariance, and the additional bias of that frame.

        The shared bias is that of the best frame, direction by direction. A worse frame has an additional one, so that
        differences of frames do not determine the size of the shared bias.
        """
        if not self.bias.any():
            return FacedFrame(self, measurement, measurement.bias)
        root = np.linalg.cholesky(self.bias)
        inverse = np.linalg.inv(root)
        ratios, turn = np.linalg.eigh(inverse @ measurement.bias @ inverse.T)
        basis, kept = root @ turn, np.clip(ratios, 0.0, 1.0)
        change = np.eye(_STATE)
        change[_BIAS, _BIAS] = (basis * kept) @ turn.T @ inverse
        hidden = self.hidden.copy()
        hidden[:3] = change[_BIAS, _BIAS] @ hidden[:3]
        covariance = change @ self.covariance @ change.T
        covariance[_BIAS, _BIAS] += (basis * (kept - kept**2)) @ basis.T
        mode = replace(self, hidden=hidden, covariance=covariance, bias=(basis * kept) @ basis.T)
        return FacedFrame(mode, measurement, (basis * np.maximum(ratios - 1.0, 0.0)) @ basis.T)

    def half_turn(self) -> PoseMode:
        """Return the half turn of the mode."""
        return replace(
            self,
            pose=self.pose.half_turn(),
            hidden=_FLIP[3:, 3:] @ self.hidden,
            covariance=_FLIP @ self.covariance @ _FLIP,
            bias=half_turn_covariance(self.bias),
            half_log_odds=-self.half_log_odds,
            reported_half=-self.reported_half,
        )

    def merge(self, other: PoseMode) -> PoseMode:
        """Merge with a less probable mode that is nearly the same, with mean and covariance of the mixture of both."""
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


@dataclass(frozen=True, slots=True, eq=False)
class FacedFrame:
    """A mode before a frame, and the frame, for their distance and the update."""

    mode: PoseMode  #: the mode, with the bias that it shares with the frame
    measurement: PoseMeasurement
    on_top: FloatArray  #: (3, 3) float64: covariance of the frame's additional bias

    def distance(self, more: FloatArray | None = None) -> float:
        """Return the squared Mahalanobis distance, 3 degrees of freedom; `more` (3, 3) is added to the covariance."""
        offset, spread = self._innovation(self.measurement.white + self.on_top)
        return float(offset @ np.linalg.solve(spread if more is None else spread + more, offset))

    def update(self, t_s: float, errors: FrameErrors, scale: float = 1.0) -> PoseMode:
        """Return the mode after a Kalman update by the frame; `scale` multiplies the frame's white noise."""
        mode = self.mode
        # a repeated bias averages out more slowly, as the mean of a first-order Gauss-Markov process
        repeated = min(mode.bias_kept * math.exp(-max(t_s - mode.agreed_s, 0.0) / errors.spell_s), _MAX_REPEATED)
        white = scale * (self.measurement.white + (1 + repeated) / (1 - repeated) * self.on_top)
        offset, spread = self._innovation(white)
        gain = np.linalg.solve(spread, _SEEN @ mode.covariance).T
        change = gain @ offset
        x, y, theta = (mode.pose.array + change[:3]).tolist()
        rest = np.eye(_STATE) - gain @ _SEEN
        # Joseph's form, which remains symmetric and positive definite
        covariance = rest @ mode.covariance @ rest.T + gain @ white @ gain.T
        return replace(
            mode, pose=Pose2(x, y, theta), hidden=mode.hidden + change[3:], covariance=covariance, bias_kept=1.0
        )

    def _innovation(self, white: FloatArray) -> tuple[FloatArray, FloatArray]:
        offset = pose_offset(self.measurement.pose, self.mode.pose) - self.mode.hidden[:3]
        return offset, _SEEN @ self.mode.covariance @ _SEEN.T + white


def _probability(log_odds: float) -> float:
    return 1 / (1 + math.exp(-log_odds))
