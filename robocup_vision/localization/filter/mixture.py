"""The Gaussian mixture of the pose filter at one time, and its update by a frame.

A frame that does not match a mode is an error if that mode is right. Errors are correlated: a two-state Markov chain
gives the probability of an error and of a repeated one, so that frames shortly after each other do not count as
independent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robocup_vision.belief import Hypothesis
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.distinct import squared_distance
from robocup_vision.localization.filter.errors import FrameErrors, OdometryNoise
from robocup_vision.localization.filter.hypothesis import FacedFrame, PoseMeasurement, PoseMode
from robocup_vision.localization.filter.settings import Half, PoseFilterSettings


@dataclass(frozen=True, eq=False)
class Mixture:
    """The state of a pose filter at one time."""

    modes: tuple[PoseMode, ...] = ()  #: most probable first; empty while nothing is known
    near: Pose2 | None = None  #: last estimated or expected pose, which orders poses that a frame allows equally well
    frame_s: float = -math.inf  #: time of the last frame with a pose
    settings: PoseFilterSettings = PoseFilterSettings()
    half: Half | None = None  #: half of the field in which the robot is known to start: "own" or None

    @property
    def is_contradicted(self) -> bool:
        """Whether the last frame contradicts the most probable mode."""
        return not self.modes or not self.modes[0].agrees

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The hypotheses, most probable first; probabilities sum to 1."""
        both = [hypothesis for mode in self.modes for hypothesis in mode.hypotheses]
        whole = sum(hypothesis.probability for hypothesis in both)
        scaled = [Hypothesis(one.pose, one.covariance, one.probability / whole) for one in both]
        return tuple(sorted(scaled, key=lambda hypothesis: -hypothesis.probability))

    def move(self, motion: Pose2, seconds: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Predict all modes by odometry; delete those that become too uncertain."""
        if not self.modes:
            return self
        moved = [mode.move(motion, seconds, odometry, errors) for mode in self.modes]
        sure = [mode for mode in moved if mode.std_m <= self.settings.lost_std_m]
        return replace(self, modes=_normalised(sure, self.settings), near=moved[0].pose)

    def changed(self, change: Callable[[PoseMode], PoseMode]) -> Mixture:
        """Return the mixture with a change applied to every mode; itself if none changes."""
        modes = tuple(change(mode) for mode in self.modes)
        return (
            self if all(new is old for new, old in zip(modes, self.modes, strict=True)) else replace(self, modes=modes)
        )

    def widen(self, seconds: float) -> Mixture:
        """Widen all modes by an unmeasured motion of this duration; delete those that become too uncertain."""
        settings = self.settings
        std_m, std_rad = settings.max_speed_mps * seconds / 3, settings.max_turn_rps * seconds / 3
        wide = [mode.widen(std_m, std_rad) for mode in self.modes]
        sure = [mode for mode in wide if mode.std_m <= settings.lost_std_m]
        return replace(self, modes=_normalised(sure, settings))

    def update(self, estimate: PoseEstimate, t_s: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Update with a frame; unchanged if its numbers are not finite."""
        measurements = _measurements(estimate, errors.bias_ratio)
        if not measurements:
            return self
        settings = self.settings
        since_s = max(t_s - self.frame_s, settings.min_frame_s)
        fresh = -math.expm1(-since_s / errors.spell_s)
        matches = [_match(mode, measurements, settings) for mode in self.modes]
        is_exact = any(match is not None and match.excess <= 1 for match in matches)
        # a near miss has less weight if there is an exact match; otherwise a new mode gains that weight
        miss = math.log(settings.near_miss_rate)
        modes: list[PoseMode] = []
        if any(matches):
            for mode, match in zip(self.modes, matches, strict=True):
                log_chance = _log_chance(mode.agrees, match is not None, fresh, errors.outlier_rate)
                weighed = replace(mode, log_weight=mode.log_weight + log_chance, agrees=match is not None)
                if match is not None:
                    weighed = self._follow(weighed, match, estimate, t_s, errors)
                    if is_exact and match.excess > 1:
                        weighed = replace(weighed, log_weight=weighed.log_weight + miss)
                modes.append(weighed)
        else:
            # no mode matches: this is a new error, or the robot is elsewhere
            log_chance = math.log(fresh * errors.outlier_rate)
            for rank, mode in enumerate(self.modes):
                modes.append(replace(mode, log_weight=mode.log_weight + log_chance, agrees=mode.agrees and rank > 0))
        if not is_exact:
            for measurement in measurements:
                new = self._new_mode(measurement, len(measurements), estimate, t_s, odometry)
                if any(matches):
                    new = replace(new, log_weight=new.log_weight - miss)
                modes.append(self._update_half(new, 1 if measurement.half_known else 0, t_s, errors))
        joined = _normalised(_merged(modes, settings.merge_distance), settings)
        return replace(self, modes=joined, near=joined[0].pose, frame_s=t_s)

    def _new_mode(
        self,
        measurement: PoseMeasurement,
        measurements: int,
        estimate: PoseEstimate,
        t_s: float,
        odometry: OdometryNoise,
    ) -> PoseMode:
        """Make a mode at a measurement without a match, in the half that is more probable a priori."""
        near, settings = self.near, self.settings
        odds = self._half_log_odds(measurement)
        if odds < 0.0:
            turned = self._new_mode(measurement.half_turn(), measurements, estimate, t_s, odometry)
            return turned.half_turn()
        if not self.modes:
            # of several measurements the nearest is the most probable, by the same odds for each metre or radian
            log_weight = 0.0 if near is None else -math.log(settings.expected_odds) * _apart(measurement.pose, near)
            slip_std = 1.0
        else:
            likeliest = self.modes[0]
            rate, since_s = odometry.kidnap_per_s, max(t_s - self.frame_s, settings.min_frame_s)
            shove = np.array([settings.shove_mps, settings.shove_mps, settings.shove_rps])
            reach = max(t_s - likeliest.agreed_s, settings.min_frame_s) * shove
            if likeliest.facing(measurement).distance(np.diag(reach**2)) <= settings.gate:
                rate, odds = rate + odometry.shove_per_s, likeliest.half_log_odds
            log_weight = math.log(-math.expm1(-rate * since_s) / measurements)
            # all of the odometry may be slip of spinning wheels
            slip_std = max(1 / odometry.slip_ratio, 1.0)
        mode = PoseMode.found(measurement, estimate, t_s, log_weight, slip_std)
        if self.modes:
            mode = mode.with_gains_of(self.modes[0])
        return replace(mode, half_log_odds=odds)

    def _half_log_odds(self, measurement: PoseMeasurement) -> float:
        """Log odds of a new mode's half by the last, the expected or the known first place."""
        odds = 0.0
        if self.near is not None:
            turned = _apart(measurement.pose.half_turn(), self.near) < _apart(measurement.pose, self.near)
            odds = math.log(self.settings.expected_odds) * (-1.0 if turned else 1.0)
        if self.half is None or self.frame_s > -math.inf:
            return odds
        # probability of x < 0 by the position's variance
        variance = float(measurement.bias[0, 0] + measurement.white[0, 0])
        own = 0.5 * math.erfc(measurement.pose.x_m / math.sqrt(2 * variance))
        least = 1.0 / (1.0 + self.settings.max_half_odds)
        own = min(max(own, least), 1.0 - least)
        return odds + math.log(own / (1.0 - own))

    def _follow(
        self, mode: PoseMode, match: _Match, estimate: PoseEstimate, t_s: float, errors: FrameErrors
    ) -> PoseMode:
        """Update a mode with its matching measurement."""
        seen = replace(match.frame, mode=replace(match.frame.mode, log_weight=mode.log_weight, agrees=mode.agrees))
        return replace(
            self._update_half(seen.update(t_s, errors, max(match.excess, 1.0)), match.half, t_s, errors),
            agreed_s=t_s,
            inlier_ratio=estimate.inlier_ratio,
            residual_px=estimate.residual_px,
        )

    def _update_half(self, mode: PoseMode, half: int, t_s: float, errors: FrameErrors) -> PoseMode:
        """Update the odds of the halves with a measured half: 1 this one, -1 the other, 0 none."""
        if half != 0:
            rate = errors.half_error_rate
            fresh = -math.expm1(-max(t_s - mode.half_reported_s, self.settings.min_frame_s) / errors.spell_s)
            if mode.reported_half == 0:
                odds = half * math.log((1 - rate) / rate)
            else:
                # two chains: of a robot in this half, and in the other
                odds = _log_chance(mode.reported_half > 0, half > 0, fresh, rate) - _log_chance(
                    mode.reported_half < 0, half < 0, fresh, rate
                )
            most = math.log(self.settings.max_half_odds)
            total = min(max(mode.half_log_odds + odds, -most), most)
            mode = replace(mode, half_log_odds=total, reported_half=half, half_reported_s=t_s)
        return mode if mode.half_log_odds >= 0 else mode.half_turn()


def _apart(pose: Pose2, near: Pose2) -> float:
    """Return the sum of metres and radians: near the field's centre only the headings of the halves differ."""
    return sum(pose.error_to(near))


def _measurements(estimate: PoseEstimate, bias_ratio: float) -> list[PoseMeasurement]:
    """Return every pose that the frame allows, modulo the half turn."""
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
    """A measurement turned into a mode's half, the measured half (1, -1; 0: none), and squared distance in gates."""

    frame: FacedFrame
    half: int
    excess: float


def _match(mode: PoseMode, measurements: Sequence[PoseMeasurement], settings: PoseFilterSettings) -> _Match | None:
    """Return the best match of the measurements with a mode; None without one."""
    best: _Match | None = None
    for measurement in measurements:
        is_turned = _apart(measurement.pose.half_turn(), mode.pose) < _apart(measurement.pose, mode.pose)
        turned = measurement.half_turn() if is_turned else measurement
        frame = mode.facing(turned)
        excess = frame.distance() / settings.gate
        if excess <= (settings.near_miss if best is None else best.excess):
            best = _Match(frame, (-1 if is_turned else 1) if measurement.half_known else 0, excess)
    return best


def _log_chance(was_right: bool, is_right: bool, fresh: float, error_rate: float) -> float:
    """Return the log-probability of a step of the chain; an error continues to the next frame with 1 - `fresh`."""
    wrong = fresh * error_rate + (0.0 if was_right else 1 - fresh)
    return math.log1p(-wrong) if is_right else math.log(wrong)


def _merged(modes: Sequence[PoseMode], merge_distance: float) -> list[PoseMode]:
    """Return the modes, largest weight first, each merged with those that are nearly the same."""
    kept: list[PoseMode] = []
    for mode in sorted(modes, key=lambda p: -p.log_weight):
        for index, other in enumerate(kept):
            if _is_same(mode, other, merge_distance):
                kept[index] = other.merge(mode)
                break
        else:
            kept.append(mode)
    return kept


def _is_same(mode: PoseMode, other: PoseMode, merge_distance: float) -> bool:
    spread = (mode.covariance + other.covariance)[:3, :3]
    places = (mode.pose, mode.pose.half_turn())
    return any(squared_distance(pose, other.pose, spread) < merge_distance for pose in places)


def _normalised(modes: Sequence[PoseMode], settings: PoseFilterSettings) -> tuple[PoseMode, ...]:
    """Return the modes, most probable first, without improbable ones; their weights sum to 1."""
    if not modes:
        return ()
    ordered = sorted(modes, key=lambda mode: -mode.log_weight)
    whole = float(np.logaddexp.reduce([mode.log_weight for mode in ordered]))
    least = whole + math.log(settings.min_probability)
    kept = [mode for mode in ordered if mode.log_weight >= least][: settings.max_modes]
    whole = float(np.logaddexp.reduce([mode.log_weight for mode in kept]))
    if whole == 0.0:
        return tuple(kept)
    return tuple(replace(mode, log_weight=mode.log_weight - whole) for mode in kept)
