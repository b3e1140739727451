"""Estimates a camera's parameters over time: an information filter that forgets slowly and notices a knock.

What no frame tells stays at the camera file's value with its stated standard deviation: that is the prior, and nothing
else is decided by thresholds. A knock is a change point: beliefs that the camera was moved at one of the last moments
are carried along, and one of them, widened, replaces the estimate when the frames since then are likelier under it, by
as much as knocks are rare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.online.evidence import Evidence
from robocup_vision.geometry import Pose2


@dataclass(frozen=True, slots=True)
class ParameterFilterSettings:
    """How fast is forgotten, what counts as new, and what is believed of knocks.

    Parameters
    ----------
    memory_s : float
        Time constant with which the estimate returns to the file's values and standard deviations where nothing tells:
        mounts get warm and loose within a match's half.
    same_place_m, same_heading_rad : float
        A frame from so near to one that has been used tells whether the camera has moved, and nothing else: it shows
        the same edges with the same errors.
    places : int
        So many places are remembered. Older ones count as new: light and what stands around have changed.
    knock_every_s : float
        A knock is expected once in so many seconds of play: robots fall, and are run into.
    wrong_ratio : float
        Of the frames, those that are taken for something that they are not: a single frame counts for no more than
        that against the parameters.
    alike_s : float
        Correlation time of the frames' errors: they show the same edges, and count as one against the parameters.
    moments, moment_s : int, float
        How many moments are carried along at which the camera may have been moved, the likeliest, and the time between
        them.
    """

    memory_s: float = 1200.0
    same_place_m: float = 0.1
    same_heading_rad: float = math.radians(15.0)
    places: int = 60
    knock_every_s: float = 60.0
    wrong_ratio: float = 0.02
    alike_s: float = 0.6
    moments: int = 4
    moment_s: float = 2.0


@dataclass
class CameraBelief:
    """A Gaussian over a camera's parameters, and the places whose frames it is made of."""

    #: (G,), (G, G) float64: of the parameters
    mean: FloatArray
    covariance: FloatArray
    since_s: float = 0.0  #: from when on the camera is believed to be as it is
    nats: float = 0.0  #: how much likelier the frames since then are under it than under the estimate, logarithm
    places: list[Pose2] = field(default_factory=list)  #: the camera's, newest last

    def forget(self, keep: float, start: FloatArray, prior: FloatArray) -> None:
        """Return a little towards the prior: `keep` is what is left."""
        self.mean = start + keep * (self.mean - start)
        self.covariance = keep**2 * self.covariance + (1.0 - keep**2) * prior

    def is_new(self, pose: Pose2, settings: ParameterFilterSettings) -> bool:
        """Whether no frame has been used from near there."""
        for place in self.places:
            distance_m, angle_rad = place.error_to(pose)
            if distance_m < settings.same_place_m and angle_rad < settings.same_heading_rad:
                return False
        return True

    def take(self, evidence: Evidence, pose: Pose2, settings: ParameterFilterSettings) -> None:
        """Take in a frame, if it was taken at a new place."""
        if not self.is_new(pose, settings):
            return
        self.places = [*self.places[1 - settings.places :], pose]
        before = np.linalg.inv(self.covariance)
        total = before + evidence.information
        self.mean = evidence.linearised_at + np.linalg.solve(
            total, evidence.gradient + before @ (self.mean - evidence.linearised_at)
        )
        covariance = np.linalg.inv(total)
        self.covariance = (covariance + covariance.T) / 2


class ParameterFilter:
    """Estimate of a camera's parameters.

    Parameters
    ----------
    start, std : (G,) float64
        The file's values, and their standard deviations.
    knock_std : (G,) float64
        By how much a knock moves them.
    """

    def __init__(
        self, start: FloatArray, std: FloatArray, knock_std: FloatArray, settings: ParameterFilterSettings
    ) -> None:
        self.start, self.settings = start.copy(), settings
        self._prior = np.diag(std**2)
        self._knock = np.diag(knock_std**2)
        self._now = CameraBelief(start.copy(), self._prior.copy())
        self._moved: list[CameraBelief] = []
        self._t_s = 0.0
        self.knocks = 0

    @property
    def mean(self) -> FloatArray:
        """(G,) float64: the estimate."""
        return self._now.mean

    @property
    def covariance(self) -> FloatArray:
        """(G, G) float64: its covariance."""
        return self._now.covariance

    @property
    def std(self) -> FloatArray:
        """(G,) float64: standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def widened(self) -> FloatArray:
        """(G, G) float64: covariance if a knock came just now."""
        return self.covariance + self._knock

    def take(self, evidence: Evidence, pose: Pose2, dt_s: float) -> None:
        """Take in a frame."""
        s = self.settings
        self._t_s += dt_s
        keep = math.exp(-dt_s / s.memory_s)
        most, part = -math.log(s.wrong_ratio), min(dt_s / s.alike_s, 1.0)
        for belief in (self._now, *self._moved):
            belief.forget(keep, self.start, self._prior)
        self._add_moment()
        now = log_evidence(evidence, self.mean, self.covariance)
        ratios = [log_evidence(evidence, belief.mean, belief.covariance) - now for belief in self._moved]
        for belief, ratio in zip(self._moved, ratios, strict=True):
            weight = 1.0 if belief.is_new(pose, s) else part
            belief.nats += weight * min(max(ratio, -most), most)
            belief.take(evidence, pose, s)
        likeliest = max(self._moved, key=lambda belief: belief.nats)
        if likeliest.nats >= math.log(s.knock_every_s / s.alike_s):
            # frames before the knock may have gone into it, too
            self._now = CameraBelief(likeliest.mean, likeliest.covariance + self._knock)
            self._now.take(evidence, pose, s)
            self._moved = []
            self.knocks += 1
        elif max(ratios) < most:
            # what speaks as strongly as a wrong frame can is a wrong frame, or one after a knock
            self._now.take(evidence, pose, s)

    def _add_moment(self) -> None:
        """Begin to believe that the camera was moved just now, in place of the least likely such belief."""
        s = self.settings
        if self._moved and self._t_s - max(belief.since_s for belief in self._moved) < s.moment_s:
            return
        kept = sorted(self._moved, key=lambda belief: belief.nats, reverse=True)[: s.moments - 1]
        self._moved = [*kept, CameraBelief(self.mean.copy(), self.widened, self._t_s)]


def log_evidence(evidence: Evidence, mean: FloatArray, covariance: FloatArray) -> float:
    """Logarithm of a frame's likelihood under a Gaussian belief, up to what the belief does not change."""
    size = len(mean)
    away = mean - evidence.linearised_at
    # the frame's log-likelihood about the belief's mean
    gradient = evidence.gradient - evidence.information @ away
    level = float(evidence.gradient @ away - 0.5 * away @ evidence.information @ away)
    # ln of the integral: gradient' (P^-1 + I)^-1 gradient / 2 - ln det(1 + P I) / 2
    system = np.eye(size) + covariance @ evidence.information
    gain = float(0.5 * gradient @ np.linalg.solve(system, covariance @ gradient))
    return level + gain - 0.5 * float(np.linalg.slogdet(system)[1])
