"""All guesses at where the robot is at one time, and how a frame changes what each is worth.

A frame agrees with a guess or it does not. When it does not, the guess takes it for an error, and errors come in
spells: a two-state Markov chain says what a frame that errs, or errs again, is worth. So many frames in one moment do
not count as that many witnesses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2
from robocup_vision.localization.pose_hypothesis import FrameErrors, Hypothesis, Place, Reading, pose_offset

# squared Mahalanobis distance that one frame in a thousand exceeds, with 3 degrees of freedom
_GATE = 16.27
# places nearer to each other than a standard deviation are one
_SAME = 1.0
# a place less probable than this is not followed, and no more than so many are
_LEAST_PROBABILITY, _MOST_PLACES = 1e-4, 8
# no count of frames makes a half of the field more certain than this: a hand may have turned the robot round
_MOST_HALF_ODDS = math.log(999.0)
# how often the robot is in the half where it was expected, or of the poses allowed at the nearest
_EXPECTED = 0.8
# a position less sure than this is no position
_LOST_STD_M = 0.5
# frames closer together than this are the same moment
_LEAST_FRAME_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
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

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Most probable first; probabilities sum to 1."""
        both = [hypothesis for place in self.places for hypothesis in place.hypotheses]
        whole = sum(hypothesis.probability for hypothesis in both)
        scaled = [replace(hypothesis, probability=hypothesis.probability / whole) for hypothesis in both]
        return tuple(sorted(scaled, key=lambda hypothesis: -hypothesis.probability))

    def move(self, motion: Pose2, noise: FloatArray, errors: FrameErrors) -> Mixture:
        """Carry all places along; those that become too unsure are lost."""
        if not self.places:
            return self
        kept = math.exp(-math.hypot(motion.x_m, motion.y_m) / errors.lasting_m)
        moved = [place.move(motion, noise, kept) for place in self.places]
        sure = [place for place in moved if place.std_m <= _LOST_STD_M]
        return Mixture(_normalised(sure), moved[0].pose, self.frame_s)

    def see(self, estimate: PoseEstimate, t_s: float, errors: FrameErrors) -> Mixture:
        """Take in what a frame tells; unchanged if its numbers make no sense."""
        readings = _readings(estimate, errors.lasting_share)
        if not readings:
            return self
        since_s = max(t_s - self.frame_s, _LEAST_FRAME_S)
        agreeing = [_nearest(place, readings) for place in self.places]
        fresh = -math.expm1(-since_s / errors.spell_s)
        if not any(agreeing):
            # all took the same frame for a new error; or the robot is somewhere else
            error = math.log(fresh * errors.outlier_rate)
            kidnapped = math.log(-math.expm1(-errors.kidnap_per_s * since_s)) if self.places else 0.0
            places = [
                replace(place, log_weight=place.log_weight + error, agrees=place.agrees and rank > 0)
                for rank, place in enumerate(self.places)
            ]
            places += self._born(readings, kidnapped, estimate, t_s, errors)
        else:
            places = []
            for place, reading in zip(self.places, agreeing, strict=True):
                worth = _log_chance(place.agrees, reading is not None, fresh, errors.outlier_rate)
                weighed = replace(place, log_weight=place.log_weight + worth, agrees=reading is not None)
                if reading is not None:
                    weighed = replace(
                        _tell_half(weighed.absorb(reading[0]), reading[1], t_s, errors),
                        inlier_share=estimate.inlier_share,
                        residual_px=estimate.residual_px,
                    )
                places.append(weighed)
        joined = _normalised(_merged(places))
        return Mixture(joined, joined[0].pose, t_s)

    def _born(
        self, readings: Sequence[Reading], log_weight: float, estimate: PoseEstimate, t_s: float, errors: FrameErrors
    ) -> list[Place]:
        """A new place for each reading; the half nearer to where the robot was believed is the likelier."""
        near = self.near
        tied = [0.0 if near is None else min(_apart(r, near), _apart(r.half_turn(), near)) for r in readings]
        nearest = tied.index(min(tied))
        places = []
        for index, reading in enumerate(readings):
            share = 1 / len(readings)
            if near is not None and len(readings) > 1:
                share = _EXPECTED if index == nearest else (1 - _EXPECTED) / (len(readings) - 1)
            place = Place.found(reading, log_weight + math.log(share), estimate.inlier_share, estimate.residual_px)
            if near is not None:
                is_near = _apart(reading, near) <= _apart(reading.half_turn(), near)
                odds = math.log(_EXPECTED / (1 - _EXPECTED))
                place = replace(place, half_log_odds=odds if is_near else -odds)
            places.append(_tell_half(place, 1 if reading.tells_half else 0, t_s, errors))
        return places


def _apart(reading: Reading, near: Pose2) -> float:
    return sum(reading.pose.error_to(near))


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


def _nearest(place: Place, readings: Sequence[Reading]) -> tuple[Reading, int] | None:
    """The reading that agrees best with the place, turned into its half, and the half it tells (1, -1; 0: neither)."""
    best: tuple[Reading, int] | None = None
    least = _GATE
    for reading in readings:
        for seen, half in ((reading, 1), (reading.half_turn(), -1)):
            distance = place.distance(seen)
            if distance <= least:
                best, least = (seen, half if reading.tells_half else 0), distance
    return best


def _tell_half(place: Place, half: int, t_s: float, errors: FrameErrors) -> Place:
    """Weigh a frame that tells the half of the field: this one (1), the other (-1), or neither (0)."""
    if half == 0:
        return place
    fresh = -math.expm1(-max(t_s - place.told_s, _LEAST_FRAME_S) / errors.spell_s)
    rate = errors.half_error_rate
    # two chains: one in which this half is right, one in which it is not
    if place.told == 0:
        right = math.log((1 - rate) / rate)
        odds = half * right
    else:
        odds = _log_chance(place.told > 0, half > 0, fresh, rate) - _log_chance(place.told < 0, half < 0, fresh, rate)
    total = min(max(place.half_log_odds + odds, -_MOST_HALF_ODDS), _MOST_HALF_ODDS)
    told = replace(place, half_log_odds=total, told=half, told_s=t_s)
    return told if total >= 0 else told.half_turn()


def _log_chance(was_right: bool, is_right: bool, fresh: float, error_rate: float) -> float:
    """Logarithm of a step of the chain: a frame's error outlives the time since the last with chance 1 - `fresh`."""
    wrong = fresh * error_rate + (0.0 if was_right else 1 - fresh)
    return math.log1p(-wrong) if is_right else math.log(wrong)


def _merged(places: Sequence[Place]) -> list[Place]:
    """The places, heaviest first, each joined with those that are nearly the same."""
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
    least = whole + math.log(_LEAST_PROBABILITY)
    kept = [place for place in ordered if place.log_weight >= least][:_MOST_PLACES]
    whole = float(np.logaddexp.reduce([place.log_weight for place in kept]))
    return tuple(replace(place, log_weight=place.log_weight - whole) for place in kept)
