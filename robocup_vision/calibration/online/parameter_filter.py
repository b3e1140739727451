"""Filter of a camera's parameters over time: an information filter that forgets slowly and detects knocks.

The prior has the camera file's values and their standard deviations; parameters without evidence keep them. A knock is
a change point: several alternative beliefs assume that the camera was moved at one of the last moments. One of them,
widened, replaces the estimate if the likelihood ratio of the frames since then exceeds the prior odds against a knock.
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
    """Settings of forgetting, of independent frames, and of knocks.

    Parameters
    ----------
    memory_s : float
        Time constant with which the estimate returns to the file's values and standard deviations without evidence:
        mounts get warm and loose within a half of a match.
    same_place_m, same_heading_rad : float
        Greatest distance and angle to the place of a used frame at which a frame counts only as evidence of knocks,
        because it shows the same edges with the same errors.
    places : int
        Number of remembered places. Older ones count as new, because light and surroundings have changed.
    knock_every_s : float
        Mean time between knocks in play: robots fall, and are hit.
    wrong_ratio : float
        Ratio of frames with wrong associations, which bounds the evidence of a single frame for or against a belief.
    alike_s : float
        Correlation time of the frames' errors: frames within it show the same edges, and count as one.
    moments, moment_s : int, float
        Number of the likeliest moments of a knock that are kept, and time between them.
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
    """A Gaussian over a camera's parameters, and the places of its frames."""

    #: (G,), (G, G) float64
    mean: FloatArray
    covariance: FloatArray
    since_s: float = 0.0  #: time since which the camera is assumed unchanged
    nats: float = 0.0  #: log likelihood ratio of the frames since then, against the estimate
    places: list[Pose2] = field(default_factory=list)  #: poses of the camera, newest last

    def forget(self, keep: float, start: FloatArray, prior: FloatArray) -> None:
        """Move towards the prior; `keep` is the ratio that remains."""
        self.mean = start + keep * (self.mean - start)
        self.covariance = keep**2 * self.covariance + (1.0 - keep**2) * prior

    def is_new(self, pose: Pose2, settings: ParameterFilterSettings) -> bool:
        """Whether no used frame is from a place near this one."""
        for place in self.places:
            distance_m, angle_rad = place.error_to(pose)
            if distance_m < settings.same_place_m and angle_rad < settings.same_heading_rad:
                return False
        return True

    def take(self, evidence: Evidence, pose: Pose2, settings: ParameterFilterSettings) -> None:
        """Update with a frame, if it is from a new place."""
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
    """Filter of a camera's parameters.

    Parameters
    ----------
    start, std : (G,) float64
        The file's values, and their standard deviations.
    knock_std : (G,) float64
        Standard deviations of the changes by a knock.
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
        """(G, G) float64: covariance after a knock at this moment."""
        return self.covariance + self._knock

    def take(self, evidence: Evidence, pose: Pose2, dt_s: float) -> None:
        """Update with a frame."""
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
            # the belief may contain frames from before the knock
            self._now = CameraBelief(likeliest.mean, likeliest.covariance + self._knock)
            self._now.take(evidence, pose, s)
            self._moved = []
            self.knocks += 1
        elif max(ratios) < most:
            # evidence at its bound is an association error, or a frame after a knock
            self._now.take(evidence, pose, s)

    def _add_moment(self) -> None:
        """Add the belief that the camera was moved at this moment, in place of the least likely one."""
        s = self.settings
        if self._moved and self._t_s - max(belief.since_s for belief in self._moved) < s.moment_s:
            return
        kept = sorted(self._moved, key=lambda belief: belief.nats, reverse=True)[: s.moments - 1]
        self._moved = [*kept, CameraBelief(self.mean.copy(), self.widened, self._t_s)]


def log_evidence(evidence: Evidence, mean: FloatArray, covariance: FloatArray) -> float:
    """Log-likelihood of a frame under a Gaussian belief, up to a constant."""
    size = len(mean)
    away = mean - evidence.linearised_at
    # the frame's log-likelihood about the belief's mean
    gradient = evidence.gradient - evidence.information @ away
    level = float(evidence.gradient @ away - 0.5 * away @ evidence.information @ away)
    # logarithm of the integral: gradient' (P^-1 + I)^-1 gradient / 2 - ln det(1 + P I) / 2
    system = np.eye(size) + covariance @ evidence.information
    gain = float(0.5 * gradient @ np.linalg.solve(system, covariance @ gradient))
    return level + gain - 0.5 * float(np.linalg.slogdet(system)[1])
