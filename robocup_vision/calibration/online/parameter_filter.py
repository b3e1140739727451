"""Estimates a camera's parameters over time: an information filter that forgets slowly and notices a knock.

What no frame tells stays at the camera file's value with its stated standard deviation: that is the prior, and nothing
else is decided by thresholds. A knock is a change point: cumulative sum of the log-likelihood ratios of "moved just
now" against "still the same" (Page 1954).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.online.evidence import Evidence


@dataclass(frozen=True, slots=True)
class ParameterFilterSettings:
    """How fast is forgotten, and what is believed of knocks.

    Parameters
    ----------
    memory_s : float
        Time constant with which the estimate returns to the file's values and standard deviations where nothing tells:
        mounts get warm and loose within a match's half.
    knock_every_s : float
        A knock is expected once in so many seconds of play.
    wrong_ratio : float
        Of the frames, those that are taken for something that they are not: a single frame counts for no more than
        that against the parameters.
    alike_s : float
        Frames err alike for so long, as they show the same edges: together they count as one against the parameters.
    """

    memory_s: float = 1200.0
    knock_every_s: float = 300.0
    wrong_ratio: float = 0.02
    alike_s: float = 0.6


class ParameterFilter:
    """Estimate of a camera's parameters.

    Parameters
    ----------
    start, std : (G,) float64
        The file's values, and their standard deviations.
    knock_std : (G,) float64
        By how much a knock moves them.
    settings : ParameterFilterSettings
        See there.
    """

    def __init__(
        self, start: FloatArray, std: FloatArray, knock_std: FloatArray, settings: ParameterFilterSettings
    ) -> None:
        self.start, self.settings = start.copy(), settings
        self._prior = np.diag(std**2)
        self._knock = np.diag(knock_std**2)
        self.mean = start.copy()
        self.covariance: FloatArray = self._prior.copy()
        self.knocks = 0
        self._nats = self._last_nats = 0.0

    @property
    def std(self) -> FloatArray:
        """(G,) float64: standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def widened(self) -> FloatArray:
        """(G, G) float64: covariance if a knock came just now."""
        return self.covariance + self._knock

    def pass_time(self, dt_s: float) -> None:
        """Forget a little."""
        keep = math.exp(-dt_s / self.settings.memory_s)
        self.mean = self.start + keep * (self.mean - self.start)
        self.covariance = keep**2 * self.covariance + (1.0 - keep**2) * self._prior

    def is_knocked(self, evidence: Evidence, dt_s: float) -> bool:
        """Weigh a frame for and against a knock; if there was one, widen the estimate.

        Parameters
        ----------
        evidence : Evidence
            Of the frame.
        dt_s : float
            Since the frame before.
        """
        s = self.settings
        most, share = -math.log(s.wrong_ratio), min(dt_s / s.alike_s, 1.0)
        ratio = log_evidence(evidence, self.mean, self.widened) - log_evidence(evidence, self.mean, self.covariance)
        self._last_nats = ratio
        self._nats = max(self._nats + share * min(max(ratio, -most), most), 0.0)
        if self._nats < math.log(s.knock_every_s / s.alike_s):
            return False
        self.covariance = self.widened
        self._nats = self._last_nats = 0.0
        self.knocks += 1
        return True

    @property
    def is_in_doubt(self) -> bool:
        """Whether the last frame speaks for a knock, or is wrong, as strongly as a wrong frame can."""
        return self._last_nats >= -math.log(self.settings.wrong_ratio)

    def update(self, evidence: Evidence) -> None:
        """Take in a frame."""
        before = np.linalg.inv(self.covariance)
        total = before + evidence.information
        step = np.linalg.solve(total, evidence.gradient + before @ (self.mean - evidence.about))
        self.mean = evidence.about + step
        covariance = np.linalg.inv(total)
        self.covariance = (covariance + covariance.T) / 2


def log_evidence(evidence: Evidence, mean: FloatArray, covariance: FloatArray) -> float:
    """Logarithm of a frame's likelihood under a Gaussian belief, up to what the belief does not change."""
    size = len(mean)
    away = mean - evidence.about
    # the frame's log-likelihood about the belief's mean
    gradient = evidence.gradient - evidence.information @ away
    level = float(evidence.gradient @ away - 0.5 * away @ evidence.information @ away)
    # ln of the integral: gradient' (P^-1 + I)^-1 gradient / 2 - ln det(1 + P I) / 2
    system = np.eye(size) + covariance @ evidence.information
    gain = float(0.5 * gradient @ np.linalg.solve(system, covariance @ gradient))
    return level + gain - 0.5 * float(np.linalg.slogdet(system)[1])
