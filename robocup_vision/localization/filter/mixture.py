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
from robocup_vision.localization.filter.hypothesis import FrameErrors, OdometryNoise, Place, Reading, pose_offset

# squared Mahalanobis distance that one frame in a thousand exceeds, with 3 degrees of freedom
_GATE = 16.27
# up to this many times that, a frame may just be less exact than it says, as one in ten is; it counts for less then
_NEAR_MISS, _NEAR_MISS_RATE = 9.0, 0.1
# places nearer to each other than a standard deviation are one
_SAME = 1.0
# a place less probable than this is not followed, and no more than so many are
_MIN_PROBABILITY, _MAX_PLACES = 1e-4, 8
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
    places : tuple of Place
        Most probable first; empty while nothing is known.
    near : Pose2 or None
        Where the robot was last believed or expected: orders what a frame cannot tell apart.
    frame_s : float
        When the last frame was taken that told a pose.
    """

    places: tuple[Place, ...] = ()
    near: Pose2 | None = None
    frame_s: float = -math.inf

    @property
    def is_in_doubt(self) -> bool:
        """The last frame contradicts what is believed most."""
        return not self.places or not self.places[0].agrees

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Most probable first; probabilities sum to 1."""
        both = [hypothesis for place in self.places for hypothesis in place.hypotheses]
        whole = sum(hypothesis.probability for hypothesis in both)
        scaled = [replace(hypothesis, probability=hypothesis.probability / whole) for hypothesis in both]
        return tuple(sorted(scaled, key=lambda hypothesis: -hypothesis.probability))

    def move(self, motion: Pose2, seconds: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Carry all places along; those that become too unsure are lost."""
        if not self.places:
            return self
        moved = [place.move(motion, seconds, odometry, errors.lasting_m) for place in self.places]
        sure = [place for place in moved if place.std_m <= _LOST_STD_M]
        return Mixture(_normalised(sure), moved[0].pose, self.frame_s)

    def see(self, estimate: PoseEstimate, t_s: float, odometry: OdometryNoise, errors: FrameErrors) -> Mixture:
        """Take in what a frame tells; unchanged if its numbers make no sense."""
        readings = _readings(estimate, errors.lasting_share)
        if not readings:
            return self
        since_s = max(t_s - self.frame_s, _MIN_FRAME_S)
        fresh = -math.expm1(-since_s / errors.spell_s)
        matches = [_match(place, readings) for place in self.places]
        is_exact = any(match is not None and match.excess <= 1 for match in matches)
        # what a near miss is worth beside one that agrees; none but a new place is better beside a near miss
        miss = math.log(_NEAR_MISS_RATE)
        places: list[Place] = []
        if any(matches):
            for place, match in zip(self.places, matches, strict=True):
                worth = _log_chance(place.agrees, match is not None, fresh, errors.outlier_rate)
                weighed = replace(place, log_weight=place.log_weight + worth, agrees=match is not None)
                if match is not None:
                    weighed = _follow(weighed, match, estimate, t_s, errors)
                    if is_exact and match.excess > 1:
                        weighed = replace(weighed, log_weight=weighed.log_weight + miss)
                places.append(weighed)
        else:
            # to all of them it is a new error; or else the robot is somewhere else
            worth = math.log(fresh * errors.outlier_rate)
            for rank, place in enumerate(self.places):
                places.append(replace(place, log_weight=place.log_weight + worth, agrees=place.agrees and rank > 0))
        if not is_exact:
            for reading in readings:
                born = self._born(reading, len(readings), estimate, t_s, odometry)
                if any(matches):
                    born = replace(born, log_weight=born.log_weight - miss)
                places.append(_tell_half(born, 1 if reading.tells_half else 0, t_s, errors))
        joined = _normalised(_merged(places))
        return Mixture(joined, joined[0].pose, t_s)

    def _born(
        self, reading: Reading, readings: int, estimate: PoseEstimate, t_s: float, odometry: OdometryNoise
    ) -> Place:
        """Found a place where a frame says that no place is; in the half where the robot was believed, if any."""
        near = self.near
        if near is not None and _apart(reading.pose.half_turn(), near) < _apart(reading.pose, near):
            turned = self._born(reading.half_turn(), readings, estimate, t_s, odometry)
            return turned.half_turn()
        odds = 0.0 if near is None else _EXPECTED_ODDS
        if not self.places:
            # of several readings, too, the nearest is the likeliest, by so much a metre or radian
            log_weight = -odds * _apart(reading.pose, near) if near is not None else 0.0
            slip_std = 1.0
        else:
            believed = self.places[0]
            rate, since_s = odometry.kidnap_per_s, max(t_s - self.frame_s, _MIN_FRAME_S)
            reach = max(t_s - believed.agreed_s, _MIN_FRAME_S) * np.array([_SHOVE_MPS, _SHOVE_MPS, _SHOVE_RPS])
            if believed.distance(reading, np.diag(reach**2)) <= _GATE:
                rate, odds = rate + odometry.shove_per_s, believed.half_log_odds
            log_weight = math.log(-math.expm1(-rate * since_s) / readings)
            # wheels may spin: all of what odometry tells may be slip
            slip_std = max(1 / odometry.slip_share, 1.0)
        place = Place.found(reading, estimate, t_s, log_weight, slip_std)
        return replace(place, half_log_odds=odds)


def _apart(pose: Pose2, near: Pose2) -> float:
    """Metres and radians together: near the centre both halves are equally far, and only the heading parts them."""
    return sum(pose.error_to(near))


def _readings(estimate: PoseEstimate, lasting_share: float) -> list[Reading]:
    """Every pose the frame allows, modulo the half turn."""
    poses = list(estimate.candidates)
    if not all(math.isfinite(v) for pose in poses for v in (pose.x_m, pose.y_m, pose.theta_rad)):
        return []
    if not np.isfinite(estimate.covariance).all():
        return []
    first = Reading.of(poses[0], estimate.covariance, True, lasting_share)
    if first is None:
        return []
    readings: list[Reading] = []
    for pose in poses:
        turned = [index for index, r in enumerate(readings) if sum(pose.half_turn().error_to(r.pose)) < 1e-6]
        if turned:
            readings[turned[0]] = replace(readings[turned[0]], tells_half=False)
        else:
            readings.append(replace(first, pose=pose))
    return readings


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    """A reading turned into a place's half, the half it tells (1, -1; 0: neither), its squared distance in gates."""

    reading: Reading
    half: int
    excess: float


def _match(place: Place, readings: Sequence[Reading]) -> _Match | None:
    """Find the reading that agrees best with a place."""
    best: _Match | None = None
    for reading in readings:
        is_turned = _apart(reading.pose.half_turn(), place.pose) < _apart(reading.pose, place.pose)
        seen = reading.half_turn() if is_turned else reading
        excess = place.distance(seen) / _GATE
        if excess <= (_NEAR_MISS if best is None else best.excess):
            best = _Match(seen, (-1 if is_turned else 1) if reading.tells_half else 0, excess)
    return best


def _follow(place: Place, match: _Match, estimate: PoseEstimate, t_s: float, errors: FrameErrors) -> Place:
    """Correct a place by the reading that agrees with it."""
    reading = match.reading
    if match.excess > 1:
        reading = replace(reading, white=match.excess * reading.white)
    return replace(
        _tell_half(place.absorb(reading), match.half, t_s, errors),
        agreed_s=t_s,
        inlier_share=estimate.inlier_share,
        residual_px=estimate.residual_px,
    )


def _tell_half(place: Place, half: int, t_s: float, errors: FrameErrors) -> Place:
    """Weigh a frame that tells the half of the field: 1 this one, -1 the other, 0 neither."""
    if half != 0:
        rate = errors.half_error_rate
        fresh = -math.expm1(-max(t_s - place.told_s, _MIN_FRAME_S) / errors.spell_s)
        if place.told == 0:
            odds = half * math.log((1 - rate) / rate)
        else:
            # two chains: one of a robot in this half, one of a robot in the other
            odds = _log_chance(place.told > 0, half > 0, fresh, rate) - _log_chance(
                place.told < 0, half < 0, fresh, rate
            )
        total = min(max(place.half_log_odds + odds, -_MAX_HALF_ODDS), _MAX_HALF_ODDS)
        place = replace(place, half_log_odds=total, told=half, told_s=t_s)
    return place if place.half_log_odds >= 0 else place.half_turn()


def _log_chance(was_right: bool, is_right: bool, fresh: float, error_rate: float) -> float:
    """Logarithm of a step of the chain: a frame's error outlives the time since the last with chance 1 - `fresh`."""
    wrong = fresh * error_rate + (0.0 if was_right else 1 - fresh)
    return math.log1p(-wrong) if is_right else math.log(wrong)


def _merged(places: Sequence[Place]) -> list[Place]:
    """Return the places, heaviest first, each joined with those that are nearly the same."""
    kept: list[Place] = []
    for place in sorted(places, key=lambda p: -p.log_weight):
        for index, other in enumerate(kept):
            if _is_same(place, other):
                kept[index] = other.merge(place)
                break
        else:
            kept.append(place)
    return kept


def _is_same(place: Place, other: Place) -> bool:
    spread = (place.covariance + other.covariance)[:3, :3]
    for pose in (place.pose, place.pose.half_turn()):
        offset = pose_offset(pose, other.pose)
        if offset @ np.linalg.solve(spread, offset) < _SAME:
            return True
    return False


def _normalised(places: Sequence[Place]) -> tuple[Place, ...]:
    """Weights that sum to 1, most probable first, without those that hardly count."""
    if not places:
        return ()
    ordered = sorted(places, key=lambda place: -place.log_weight)
    whole = float(np.logaddexp.reduce([place.log_weight for place in ordered]))
    least = whole + math.log(_MIN_PROBABILITY)
    kept = [place for place in ordered if place.log_weight >= least][:_MAX_PLACES]
    whole = float(np.logaddexp.reduce([place.log_weight for place in kept]))
    return tuple(replace(place, log_weight=place.log_weight - whole) for place in kept)
