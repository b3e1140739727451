"""How odometry and frames err, and one guess at where the robot is: a Gaussian that the one moves, the other corrects.

Frames do not err anew each time: what a place, a wrong calibration or a shadow does to one it does to the next. So the
Gaussian is over the pose and over the error that the frames now share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.geometry import FloatArray, Pose2, read_only, wrap_angle

# no frame is better than a micrometre, nor a microradian
_LEAST_STD = 1e-6
# steps of no duration count as if they took a hundredth of a second
_LEAST_STEP_S = 0.01
_FLIP = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A guess at where the robot is now.

    Parameters
    ----------
    pose : Pose2
        The robot in the field frame.
    covariance : (3, 3) float64
        Of (x_m, y_m, theta_rad), in m, m and rad.
    probability : float
        Those of all hypotheses sum to 1.
    """

    pose: Pose2
    covariance: FloatArray
    probability: float


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """How odometry errs: slip in proportion to the motion, and pushes that no wheel feels.

    Slip lasts a while, so its variance over a time t at a constant speed v is 2 slip_s (slip_share v)^2 t, however many
    steps the time is cut into; and that of pushes is push_m^2 t.

    Parameters
    ----------
    slip_share : float
        Standard deviation of the slip, as a share of the velocity and of the turning rate; and, radians a metre, of the
        turn that driving adds.
    slip_s : float
        How long slip lasts, seconds.
    push_m, push_rad : float
        Standard deviation of position and heading per root of a second; also while the robot stands.

    Raises
    ------
    ArgumentError
        If one is negative or not finite.
    """

    slip_share: float = 0.1
    slip_s: float = 0.1
    push_m: float = 0.005
    push_rad: float = 0.01

    def __post_init__(self) -> None:
        for name in ("slip_share", "slip_s", "push_m", "push_rad"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ArgumentError(f"{name} of the odometry must not be negative, got {value!r}")

    def covariance(self, motion: Pose2, seconds: float) -> FloatArray:
        """Covariance (3, 3) of a motion, m, m and rad, in the robot's frame before it."""
        way, turn = math.hypot(motion.x_m, motion.y_m), motion.theta_rad
        slip = 2 * self.slip_s * self.slip_share**2 / max(seconds, _LEAST_STEP_S)
        aside = slip * way**2 + self.push_m**2 * seconds
        return np.diag([aside, aside, slip * (turn**2 + way**2) + self.push_rad**2 * seconds])


@dataclass(frozen=True, slots=True)
class FrameErrors:
    """How single frames err.

    Parameters
    ----------
    lasting_share : float
        Share of the variance a frame states that is an error which the next frames have too; it does not average out
        while the robot stands, and is another error once it has driven `lasting_m`. 0 to 1.
    lasting_m : float
        Metres.
    outlier_rate : float
        Share of the frames that show a wrong place.
    half_error_rate : float
        Share of the frames with a single candidate that name the wrong half of the field; under a half.
    spell_s : float
        A wrong place or half lasts that long in the mean, seconds: frames close together err together.
    kidnap_per_s : float
        How often a robot is carried off or pushed away from where odometry says it is.

    Raises
    ------
    ArgumentError
        If one is not within its bounds.
    """

    lasting_share: float = 0.2
    lasting_m: float = 0.5
    outlier_rate: float = 0.02
    half_error_rate: float = 0.05
    spell_s: float = 0.1
    kidnap_per_s: float = 0.005

    def __post_init__(self) -> None:
        if not 0 <= self.lasting_share <= 1:
            raise ArgumentError(f"lasting_share of the frames must be within 0 to 1, got {self.lasting_share!r}")
        for name in ("outlier_rate", "half_error_rate"):
            value = getattr(self, name)
            if not 0 < value < 0.5:
                raise ArgumentError(f"{name} of the frames must be above 0 and under a half, got {value!r}")
        for name in ("lasting_m", "spell_s", "kidnap_per_s"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} of the frames must be positive, got {value!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A pose that a frame allows.

    Parameters
    ----------
    pose : Pose2
        The robot in the field frame.
    lasting : (3, 3) float64
        M: the frame says pose + M b + white noise, b being the lasting error in units of its standard deviation.
    white : (3, 3) float64
        Covariance of the white noise.
    tells_half : bool
        The frame does not allow its half turn.
    """

    pose: Pose2
    lasting: FloatArray
    white: FloatArray
    tells_half: bool

    @classmethod
    def of(cls, pose: Pose2, covariance: FloatArray, tells_half: bool, lasting_share: float) -> Reading | None:
        """Split a frame's covariance; None if it is none."""
        if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12):
            return None
        values, vectors = np.linalg.eigh(covariance)
        if values[0] < -1e-9 * abs(values[2]):
            return None
        values = np.maximum(values, _LEAST_STD**2)
        # the symmetric root turns with the field, so that no axis of it is special
        root = (vectors * np.sqrt(values)) @ vectors.T
        whole = (vectors * values) @ vectors.T
        return cls(pose, math.sqrt(lasting_share) * root, (1 - lasting_share) * whole, tells_half)

    def half_turn(self) -> Reading:
        """The same reading of a robot in the other half."""
        flip = _FLIP[:3, :3]
        return Reading(self.pose.half_turn(), flip @ self.lasting @ flip, flip @ self.white @ flip, self.tells_half)


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A pose modulo the half turn about the field's centre, followed through time.

    Parameters
    ----------
    pose : Pose2
        In the more probable half.
    lasting : (3,) float64
        The lasting error of the frames, in its standard deviations.
    covariance : (6, 6) float64
        Of both.
    log_weight : float
        Logarithm of the probability.
    half_log_odds : float
        ln(p / (1 - p)) for the pose against its half turn; never negative.
    agrees : bool
        With the last frame.
    told : int
        The last frame that told a half told this one (1) or the other (-1); 0: none has.
    told_s : float
        When.
    inlier_share, residual_px : float
        Of the last frame that agreed.
    """

    pose: Pose2
    lasting: FloatArray
    covariance: FloatArray
    log_weight: float
    half_log_odds: float
    agrees: bool
    told: int
    told_s: float
    inlier_share: float
    residual_px: float

    @classmethod
    def found(cls, reading: Reading, log_weight: float, inlier_share: float, residual_px: float) -> Place:
        """Begin where a frame says, with nothing known of its half."""
        m = reading.lasting
        covariance = np.block([[m @ m.T + reading.white, -m], [-m.T, np.eye(3)]])
        return cls(
            reading.pose, np.zeros(3), covariance, log_weight, 0.0, True, 0, -math.inf, inlier_share, residual_px
        )

    def move(self, motion: Pose2, noise: FloatArray, kept: float) -> Place:
        """Carry it along.

        Parameters
        ----------
        motion : Pose2
            In the robot's frame before.
        noise : (3, 3) float64
            Covariance of the motion.
        kept : float
            Correlation of the lasting error after the motion with that before, 0 to 1.
        """
        c, s = math.cos(self.pose.theta_rad), math.sin(self.pose.theta_rad)
        by_state = np.diag([1.0, 1.0, 1.0, kept, kept, kept])
        by_state[0, 2] = -s * motion.x_m - c * motion.y_m
        by_state[1, 2] = c * motion.x_m - s * motion.y_m
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        covariance = by_state @ self.covariance @ by_state.T
        covariance[:3, :3] += turn @ noise @ turn.T
        covariance[3:, 3:] += (1 - kept * kept) * np.eye(3)
        return replace(self, pose=self.pose.compose(motion), lasting=kept * self.lasting, covariance=covariance)

    def distance(self, reading: Reading) -> float:
        """Squared Mahalanobis distance of a reading, 3 degrees of freedom."""
        offset, seen, spread = self._innovation(reading)
        return float(offset @ np.linalg.solve(spread, offset))

    def absorb(self, reading: Reading) -> Place:
        """Correct it by a reading, as a Kalman filter does."""
        offset, seen, spread = self._innovation(reading)
        gain = np.linalg.solve(spread, seen @ self.covariance).T
        change = gain @ offset
        x, y, theta = (self.pose.array + change[:3]).tolist()
        rest = np.eye(6) - gain @ seen
        # Joseph's form, which stays symmetric and positive
        covariance = rest @ self.covariance @ rest.T + gain @ reading.white @ gain.T
        return replace(self, pose=Pose2(x, y, theta), lasting=self.lasting + change[3:], covariance=covariance)

    def _innovation(self, reading: Reading) -> tuple[FloatArray, FloatArray, FloatArray]:
        seen = np.hstack([np.eye(3), reading.lasting])
        offset = pose_offset(reading.pose, self.pose) - reading.lasting @ self.lasting
        return offset, seen, seen @ self.covariance @ seen.T + reading.white

    def half_turn(self) -> Place:
        """The same in the other half."""
        return replace(
            self,
            pose=self.pose.half_turn(),
            lasting=_FLIP[3:, 3:] @ self.lasting,
            covariance=_FLIP @ self.covariance @ _FLIP,
            half_log_odds=-self.half_log_odds,
            told=-self.told,
        )

    def merge(self, other: Place) -> Place:
        """Join with a less probable place that is nearly the same, keeping mean and covariance of both together."""
        if sum(other.pose.error_to(self.pose)) > sum(other.pose.half_turn().error_to(self.pose)):
            other = other.half_turn()
        log_weight = float(np.logaddexp(self.log_weight, other.log_weight))
        share = math.exp(other.log_weight - log_weight)
        apart = np.append(pose_offset(other.pose, self.pose), other.lasting - self.lasting)
        x, y, theta = (self.pose.array + share * apart[:3]).tolist()
        half = (1 - share) * _probability(self.half_log_odds) + share * _probability(other.half_log_odds)
        return replace(
            self,
            pose=Pose2(x, y, theta),
            lasting=self.lasting + share * apart[3:],
            covariance=(1 - share) * self.covariance
            + share * other.covariance
            + share * (1 - share) * np.outer(apart, apart),
            log_weight=log_weight,
            half_log_odds=math.log(half / (1 - half)),
        )

    @property
    def hypotheses(self) -> tuple[Hypothesis, Hypothesis]:
        """The pose and its half turn."""
        weight, half = math.exp(self.log_weight), _probability(self.half_log_odds)
        turned = self.half_turn()
        return (
            Hypothesis(self.pose, read_only(self.covariance[:3, :3]), weight * half),
            Hypothesis(turned.pose, read_only(turned.covariance[:3, :3]), weight * (1 - half)),
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
