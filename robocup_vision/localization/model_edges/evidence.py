"""Decides whether a frame confirms a pose, and weighs poses found without a prior against each other.

Hidden samples are neutral on the floor, where robots stand before lines, and count a little against a pose higher up;
missing ones count against it. The pose must explain the line points in view, and gain information on its prior. A
fit that leaves a direction open is accepted where the other evidence suffices, with a covariance that says so.

Many poses of a field explain a picture well. Their posterior is a conditional logit over all poses that were fitted,
with one more outcome: the right pose is not among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.localization.model_edges.settings import EdgeSettings


class Evidence(NamedTuple):
    """Counts of samples and line points after a fit (see `kernels.model_edges.follow.Fit`)."""

    samples: float
    looked_for: float
    found: float
    missing: float
    found_upright: float
    inliers: float
    rms_px: float
    prior_distance2: float
    points: float
    explained: float
    hidden_upright: float
    position_std_m: float
    edges: float
    gained_nats: float

    @property
    def found_ratio(self) -> float:
        """Fraction of the samples predicted that are not hidden."""
        return self.found / max(self.found + self.missing, 1.0)

    @property
    def in_words(self) -> str:
        """The samples that a frame shows of those that the pose predicts."""
        places = f"{self.found:.0f} of {self.found + self.missing:.0f} visible places on edges are found"
        hidden = self.looked_for - self.found - self.missing
        hidden_too = f" ({hidden:.0f} more are hidden)" if hidden >= 1 else ""
        return f"{places}{hidden_too}, {self.explained:.0f} of {self.points:.0f} line points are explained"

    def log_odds(self, settings: EdgeSettings) -> float:
        """Logarithm of the odds that the pose is right; see `EdgeSettings` for the weights' origin."""
        return self._log_odds(settings, self._against(settings))[0]

    def _log_odds(self, settings: EdgeSettings, against: float) -> tuple[float, float]:
        """Logarithm of the odds, and the same without the penalty for an open position."""
        s = settings
        whatever_is_open = s.odds_at_all + s.odds_of_edge * self.edges - against
        open_ = s.odds_against_open + s.odds_against_std * min(self.position_std_m, 0.5)
        return whatever_is_open - max(open_ - s.odds_of_nat * self.gained_nats, 0.0), whatever_is_open

    def _against(self, settings: EdgeSettings) -> float:
        s = settings
        return (
            s.odds_against_missing * self.missing / (self.found + self.missing + 4.0)
            + s.odds_against_hidden * self.hidden_upright / (self.found_upright + self.hidden_upright + 4.0)
            + s.odds_against_unexplained * (self.points - self.explained) / (self.points + 4.0)
            + s.odds_against_distance * self.prior_distance2
            # with few inliers the residuals say less
            + s.odds_against_rms * self.rms_px * min(self.inliers / s.min_inliers, 1.0)
        )


class Verdict(NamedTuple):
    """The verdict on a fit."""

    reason: str | None  #: why it is rejected; None where it is accepted
    #: of the frame for a right and for a wrong pose. A frame that agrees with a pose without fixing it is neutral, and
    #: a few samples count against it only by contradictions.
    log_likelihood_ratio: float


def weigh(evidence: Evidence, settings: EdgeSettings, prior_log_odds: float = 0.0) -> Verdict:
    """Weigh a fit, given the log odds that its prior is right by the frames before."""
    s, e = settings, evidence
    against = e._against(s)
    odds, whatever_is_open = e._log_odds(s, against)
    if e.inliers < s.min_inliers:
        ratio = min(s.odds_at_all / 2 - against, 0.0)
    else:
        ratio = max(odds, min(whatever_is_open, 0.0))
    if e.inliers < (s.min_inliers if prior_log_odds <= 0.0 else s.min_inliers_followed):
        return Verdict(f"only {e.inliers:.0f} of {e.looked_for:.0f} places on edges agree", ratio)
    if prior_log_odds > 0.0:
        odds = prior_log_odds + ratio
    if odds < 0.0:
        return Verdict(
            f"the picture does not confirm the pose, by odds of {math.exp(odds):.2g} to 1: {e.in_words}", ratio
        )
    return Verdict(None, ratio)


@dataclass(frozen=True, slots=True)
class CandidateSettings:
    """Weights of a fit's evidence in a conditional logit, and thresholds on the posterior."""

    #: weight of the fraction missing where carpet shows instead
    of_missing: float = -35.7
    #: weight of the fraction found of all predicted samples: a pose that hides much explains little
    of_found: float = 4.24
    #: weight of the fraction of line points left unexplained
    of_unexplained: float = -27.1
    #: weight of the inliers' root mean square, pixels of a picture 208 wide: wrong poses leave larger residuals
    of_rms: float = -5.79
    #: weight of each edge of the field that is found
    of_edge: float = 0.71
    #: weight of the logarithm of the position's standard deviation, metres: a picture that fits everywhere shows little
    of_std: float = -1.26
    #: weight of the outcome that none is right
    of_none: float = 6.76
    #: smallest probability of a pose that is the answer alone, and of several together that are candidates
    min_probability: float = 0.95
    min_together: float = 0.98
    max_candidates: int = 3


def log_weight(evidence: Evidence, settings: CandidateSettings) -> float:
    """Return the logarithm of a pose's weight among others, relative to that none is right."""
    e, s = evidence, settings
    return (
        s.of_missing * e.missing / (e.found + e.missing + 4.0)
        + s.of_found * e.found / (e.looked_for + 4.0)
        + s.of_unexplained * (e.points - e.explained) / (e.points + 4.0)
        + s.of_rms * e.rms_px
        + s.of_edge * e.edges
        + s.of_std * math.log(min(e.position_std_m, 1.0) + 0.01)
        - s.of_none
    )


def posterior(log_weights: Sequence[float]) -> FloatArray:
    """Return the probability of each pose, (N,) float64; the rest, up to 1, is the probability that none is right."""
    weights = np.append(np.asarray(log_weights, dtype=np.float64), 0.0)
    weights = np.exp(weights - weights.max())
    return np.asarray(weights[:-1] / weights.sum())


def accepted(probabilities: FloatArray, settings: CandidateSettings) -> list[int]:
    """Return the indices of the accepted poses, the most probable first; none where none is probable enough."""
    order = np.argsort(-probabilities)[: settings.max_candidates].tolist()
    total = 0.0
    for number, index in enumerate(order, 1):
        total += float(probabilities[index])
        if total >= (settings.min_probability if number == 1 else settings.min_together):
            return [int(one) for one in order[:number]]
    return []
