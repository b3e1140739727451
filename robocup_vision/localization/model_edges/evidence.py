"""Decides whether a frame confirms a pose, and compares poses found without a prior with each other.

The log odds that a pose is right are linear in the figures of its fit. One set of weights serves fits near a prior and
fits all over the field; for each of these two cases a constant states how probable a pose is before the frame is seen.
Missing samples count against a pose. Hidden samples are neutral on the floor, where robots stand before lines, and
count a little against a pose above the floor.

Many poses of a field explain a picture well. Their posterior is a conditional logit over all poses that were fitted,
with one more outcome: the right pose is not among them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.localization.model_edges.weights import EdgeWeights

# least number of inliers of a pose; also of samples found on edges that the field's other half lacks, for a frame that
# shows the half. Two samples may agree by chance.
MIN_INLIERS = 3


class Evidence(NamedTuple):
    """Counts of samples and line points after a fit (see `kernels.model_edges.tables.Fit`)."""

    samples: float
    looked_for: float
    found: float
    missing: float
    inliers: float
    rms_px: float
    prior_distance2: float
    points: float
    explained: float
    edges: float
    position_std_m: float
    found_upright: float
    hidden_upright: float
    log_odds: float  #: log odds that the pose is right, near a prior
    log_odds_if_fixed: float  #: log odds if the frame also fixed the position

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

    def log_odds_anywhere(self, weights: EdgeWeights) -> float:
        """Return the log odds of a pose found without a prior against the outcome that no pose found is right."""
        constant, of_distance2 = weights.near_prior[:2].tolist()
        # a search's proposal is no evidence, so the distance from it does not count
        terms = self.log_odds - constant - of_distance2 * self.prior_distance2
        return float(weights.anywhere + weights.within_picture * terms)


class Verdict(NamedTuple):
    """The verdict on a fit."""

    reason: str | None  #: why it is rejected; None where it is accepted
    #: log-likelihood ratio of the frame, for a right against a wrong pose; 0 for a frame that agrees with the pose
    #: without determining it, at most 0 with too few inliers
    log_likelihood_ratio: float


def weigh(evidence: Evidence, prior_log_odds: float = 0.0) -> Verdict:
    """Weigh a fit, given the log odds that its prior is right by the frames before."""
    e, odds = evidence, evidence.log_odds
    # an open position does not contradict the pose
    ratio = max(odds, min(e.log_odds_if_fixed, 0.0))
    if e.inliers < MIN_INLIERS:
        return Verdict(f"only {e.inliers:.0f} of {e.looked_for:.0f} places on edges agree", min(ratio, 0.0))
    if prior_log_odds > 0.0:
        odds = prior_log_odds + ratio
    if odds < 0.0:
        return Verdict(
            f"the picture does not confirm the pose, by odds of {math.exp(odds):.2g} to 1: {e.in_words}", ratio
        )
    return Verdict(None, ratio)


@dataclass(frozen=True, slots=True)
class CandidateSettings:
    """Thresholds on the posterior of poses found without a prior."""

    #: smallest probability of a pose that is the answer alone, or of several together that are candidates
    min_probability: float = 0.9
    max_candidates: int = 3


def posterior(log_weights: npt.ArrayLike) -> FloatArray:
    """Return the probability of each pose, (N,) float64; 1 less their sum is the probability that none is right.

    `log_weights` (N,) are the log odds of each pose against the outcome that none of them is right.
    """
    weights = np.append(np.asarray(log_weights, dtype=np.float64), 0.0)
    weights = np.exp(weights - weights.max())
    return np.asarray(weights[:-1] / weights.sum())


def accepted(probabilities: FloatArray, settings: CandidateSettings) -> list[int]:
    """Return the indices of the accepted poses, the most probable first; empty if they are not probable enough."""
    order = np.argsort(-probabilities)[: settings.max_candidates]
    (reached,) = np.nonzero(np.cumsum(probabilities[order]) >= settings.min_probability)
    return [int(one) for one in order[: reached[0] + 1]] if len(reached) else []
