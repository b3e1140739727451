"""All guesses at where the robot is at one time, and how a frame changes what each is worth.

A frame agrees with a guess or it does not. When it does not, the guess takes it for an error, and errors come in
spells: a two-state Markov chain says what a frame that errs, or errs again, is worth. So many frames in one moment do
not count as that many witnesses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robocup_vision.belief import Hypothesis
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.hypothesis import (
    FrameErrors,
    OdometryNoise,
    PoseMeasurement,
    PoseMode,
    pose_offset,
)

# squared Mahalanobis distance that one frame in a thousand exceeds, with 3 degrees of freedom
_GATE = 16.27
# up to this many times that, a frame may just be less exact than it says, as one in ten is; it counts for less then
_NEAR_MISS, _NEAR_MISS_RATE = 9.0, 0.1
# modes nearer to each other than a standard deviation are one
_SAME = 1.0
# a mode less probable than this is not followed, and no more than so many are
_MIN_PROBABILITY, _MAX_MODES = 1e-4, 8
# no count of frames makes a half of the field more certain than this: a hand may have turned the robot round
_MAX_HALF_ODDS = math.log(9999.0)
# how often the robot is in the half where it was expected
_EXPECTED_ODDS = math.log(0.8 / 0.2)
# standard deviations of the velocity that a shove or spinning wheels may have
_SHOVE_MPS, _SHOVE_RPS = 0.5, 3.0
# a position less sure than this is no position
_LOST_STD_M = 0.5
# frames closer together than this are the same moment
_MIN_FRAME_S = 1e-3


@dataclass(frozen=True, eq=False)
class Mixture:
    """The state of a pose filter at one time.

    Parameters
    ----------
    modes : tuple of PoseMode
        Most probable first; empty while nothing is known.
    near : Pose2 or None
        Where the robot was last believed or expected: orders what a frame cannot tell apart.
    frame_s : float
        When the last frame was taken that told a pose.
    """

    modes: tuple[PoseMode, ...] = ()
    near: Pose2 | None = None
    frame_s: float = -math.inf

    @property
    def is_contradicted(self) -> bool:
        """The last frame contradicts what is believed most."""
        return not self.modes or not self.modes[0].agrees

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Most probable first; probabilities sum to 1."""
        both = [hypothesis for mode in self.modes for hypothesis in mode.hypotheses]
        whole = sum(hypothesis.probability for hypothesis in both)
        scaled = [replace(hypothesis, probability=hypothesis.probability / whole) for hypothesis in both]
        return tuple(sorted(scaled, key=lambda hypothesis: -hypothesis.probability))

    def move(self, motion: Pose2, seconds: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Carry all modes along; those that become too unsure are lost."""
        if not self.modes:
            return self
        moved = [mode.move(motion, seconds, odometry, errors.bias_distance_m) for mode in self.modes]
        sure = [mode for mode in moved if mode.std_m <= _LOST_STD_M]
        return Mixture(_normalised(sure), moved[0].pose, self.frame_s)

    def update(self, estimate: PoseEstimate, t_s: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Take in what a frame tells; unchanged if its numbers make no sense."""
        measurements = _measurements(estimate, errors.bias_ratio)
        if not measurements:
            return self
        since_s = max(t_s - self.frame_s, _MIN_FRAME_S)
        fresh = -math.expm1(-since_s / errors.spell_s)
        matches = [_match(mode, measurements) for mode in self.modes]
        is_exact = any(match is not None and match.excess <= 1 for match in matches)
        # what a near miss is worth beside one that agrees; none but a new mode is better beside a near miss
        miss = math.log(_NEAR_MISS_RATE)
        modes: list[PoseMode] = []
        if any(matches):
            for mode, match in zip(self.modes, matches, strict=True):
                worth = _log_chance(mode.agrees, match is not None, fresh, errors.outlier_rate)
                weighed = replace(mode, log_weight=mode.log_weight + worth, agrees=match is not None)
                if match is not None:
                    weighed = _follow(weighed, match, estimate, t_s, errors)
                    if is_exact and match.excess > 1:
                        weighed = replace(weighed, log_weight=weighed.log_weight + miss)
                modes.append(weighed)
        else:
            # to all of them it is a new error; or else the robot is somewhere else
            worth = math.log(fresh * errors.outlier_rate)
            for rank, mode in enumerate(self.modes):
                modes.append(replace(mode, log_weight=mode.log_weight + worth, agrees=mode.agrees and rank > 0))
        if not is_exact:
            for measurement in measurements:
                new = self._new_mode(measurement, len(measurements), estimate, t_s, odometry)
                if any(matches):
                    new = replace(new, log_weight=new.log_weight - miss)
                modes.append(_update_half(new, 1 if measurement.half_known else 0, t_s, errors))
        joined = _normalised(_merged(modes))
        return Mixture(joined, joined[0].pose, t_s)

    def _new_mode(
        self,
        measurement: PoseMeasurement,
        measurements: int,
        estimate: PoseEstimate,
        t_s: float,
        odometry: OdometryNoise,
    ) -> PoseMode:
        """Found a mode where a frame says that no mode is; in the half where the robot was believed, if any."""
        near = self.near
        if near is not None and _apart(measurement.pose.half_turn(), near) < _apart(measurement.pose, near):
            turned = self._new_mode(measurement.half_turn(), measurements, estimate, t_s, odometry)
            return turned.half_turn()
        odds = 0.0 if near is None else _EXPECTED_ODDS
        if not self.modes:
            # of several measurements, too, the nearest is the likeliest, by so much a metre or radian
            log_weight = -odds * _apart(measurement.pose, near) if near is not None else 0.0
            slip_std = 1.0
        else:
            believed = self.modes[0]
            rate, since_s = odometry.kidnap_per_s, max(t_s - self.frame_s, _MIN_FRAME_S)
            reach = max(t_s - believed.agreed_s, _MIN_FRAME_S) * np.array([_SHOVE_MPS, _SHOVE_MPS, _SHOVE_RPS])
            if believed.distance(measurement, np.diag(reach**2)) <= _GATE:
                rate, odds = rate + odometry.shove_per_s, believed.half_log_odds
            log_weight = math.log(-math.expm1(-rate * since_s) / measurements)
            # wheels may spin: all of what odometry tells may be slip
            slip_std = max(1 / odometry.slip_ratio, 1.0)
        mode = PoseMode.found(measurement, estimate, t_s, log_weight, slip_std)
        return replace(mode, half_log_odds=odds)


def _apart(pose: Pose2, near: Pose2) -> float:
    """Metres and radians together: near the centre both halves are equally far, and only the heading parts them."""
    return sum(pose.error_to(near))


def _measurements(estimate: PoseEstimate, bias_ratio: float) -> list[PoseMeasurement]:
    """Every pose the frame allows, modulo the half turn."""
    poses = list(estimate.candidates)
    if not all(math.isfinite(v) for pose in poses for v in (pose.x_m, pose.y_m, pose.theta_rad)):
        return []
    if not np.isfinite(estimate.covariance).all():
        return []
    first = PoseMeasurement.of(poses[0], estimate.covariance, True, bias_ratio)
    if first is None:
        return []
    measurements: list[PoseMeasurement] = []
    for pose in poses:
        turned = [index for index, r in enumerate(measurements) if sum(pose.half_turn().error_to(r.pose)) < 1e-6]
        if turned:
            measurements[turned[0]] = replace(measurements[turned[0]], half_known=False)
        else:
            measurements.append(replace(first, pose=pose))
    return measurements


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    """A measurement turned into a mode's half, the half it tells (1, -1; 0: neither), its squared distance in gates."""

    measurement: PoseMeasurement
    half: int
    excess: float


def _match(mode: PoseMode, measurements: Sequence[PoseMeasurement]) -> _Match | None:
    """Find the measurement that agrees best with a mode."""
    best: _Match | None = None
    for measurement in measurements:
        is_turned = _apart(measurement.pose.half_turn(), mode.pose) < _apart(measurement.pose, mode.pose)
        seen = measurement.half_turn() if is_turned else measurement
        excess = mode.distance(seen) / _GATE
        if excess <= (_NEAR_MISS if best is None else best.excess):
            best = _Match(seen, (-1 if is_turned else 1) if measurement.half_known else 0, excess)
    return best


def _follow(mode: PoseMode, match: _Match, estimate: PoseEstimate, t_s: float, errors: FrameErrors) -> PoseMode:
    """Correct a mode by the measurement that agrees with it."""
    measurement = match.measurement
    if match.excess > 1:
        measurement = replace(measurement, white=match.excess * measurement.white)
    return replace(
        _update_half(mode.update(measurement), match.half, t_s, errors),
        agreed_s=t_s,
        inlier_ratio=estimate.inlier_ratio,
        residual_px=estimate.residual_px,
    )


def _update_half(mode: PoseMode, half: int, t_s: float, errors: FrameErrors) -> PoseMode:
    """Weigh a frame that tells the half of the field: 1 this one, -1 the other, 0 neither."""
    if half != 0:
        rate = errors.half_error_rate
        fresh = -math.expm1(-max(t_s - mode.half_reported_s, _MIN_FRAME_S) / errors.spell_s)
        if mode.reported_half == 0:
            odds = half * math.log((1 - rate) / rate)
        else:
            # two chains: one of a robot in this half, one of a robot in the other
            odds = _log_chance(mode.reported_half > 0, half > 0, fresh, rate) - _log_chance(
                mode.reported_half < 0, half < 0, fresh, rate
            )
        total = min(max(mode.half_log_odds + odds, -_MAX_HALF_ODDS), _MAX_HALF_ODDS)
        mode = replace(mode, half_log_odds=total, reported_half=half, half_reported_s=t_s)
    return mode if mode.half_log_odds >= 0 else mode.half_turn()


def _log_chance(was_right: bool, is_right: bool, fresh: float, error_rate: float) -> float:
    """Logarithm of a step of the chain: a frame's error outlives the time since the last with chance 1 - `fresh`."""
    wrong = fresh * error_rate + (0.0 if was_right else 1 - fresh)
    return math.log1p(-wrong) if is_right else math.log(wrong)


def _merged(modes: Sequence[PoseMode]) -> list[PoseMode]:
    """Return the modes, heaviest first, each joined with those that are nearly the same."""
    kept: list[PoseMode] = []
    for mode in sorted(modes, key=lambda p: -p.log_weight):
        for index, other in enumerate(kept):
            if _is_same(mode, other):
                kept[index] = other.merge(mode)
                break
        else:
            kept.append(mode)
    return kept


def _is_same(mode: PoseMode, other: PoseMode) -> bool:
    spread = (mode.covariance + other.covariance)[:3, :3]
    for pose in (mode.pose, mode.pose.half_turn()):
        offset = pose_offset(pose, other.pose)
        if offset @ np.linalg.solve(spread, offset) < _SAME:
            return True
    return False


def _normalised(modes: Sequence[PoseMode]) -> tuple[PoseMode, ...]:
    """Weights that sum to 1, most probable first, without those that hardly count."""
    if not modes:
        return ()
    ordered = sorted(modes, key=lambda mode: -mode.log_weight)
    whole = float(np.logaddexp.reduce([mode.log_weight for mode in ordered]))
    least = whole + math.log(_MIN_PROBABILITY)
    kept = [mode for mode in ordered if mode.log_weight >= least][:_MAX_MODES]
    whole = float(np.logaddexp.reduce([mode.log_weight for mode in kept]))
    return tuple(replace(mode, log_weight=mode.log_weight - whole) for mode in kept)
