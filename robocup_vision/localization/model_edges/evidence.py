"""Decides whether a frame confirms a pose, and weighs poses found without a prior against each other.

The logarithm of the odds that a pose is right is linear in what its fit finds, leaves unexplained and fixes. One set of
weights serves fits near a prior and fits all over the field; how probable a pose is before a frame is seen, is told by
a constant for each. Hidden samples are neutral on the floor, where robots stand before lines, and count a little
against a pose higher up; missing ones count against it.

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

# least number of inliers, and of samples found on edges that the field's other half lacks for a frame to show the
# half: two may agree by chance
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
    log_odds: float  #: that the pose is right, near a prior
    log_odds_if_fixed: float  #: the same if the frame also fixed the position

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
        """Logarithm of the odds of a pose found without a prior to that none that was found is right."""
        constant, of_distance2 = weights.near_prior[:2].tolist()
        # a search's proposal is no evidence, and so the distance from it is none
        terms = self.log_odds - constant - of_distance2 * self.prior_distance2
        return float(weights.anywhere + weights.within_picture * terms)


class Verdict(NamedTuple):
    """The verdict on a fit."""

    reason: str | None  #: why it is rejected; None where it is accepted
    #: of the frame for a right and for a wrong pose. A frame that agrees with a pose without fixing it is neutral, and
    #: a few samples count against it only by contradictions.
    log_likelihood_ratio: float


def weigh(evidence: Evidence, prior_log_odds: float = 0.0) -> Verdict:
    """Weigh a fit, given the log odds that its prior is right by the frames before."""
    e, odds = evidence, evidence.log_odds
    # an open position shows little, but nothing against the pose
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
    """Return the probability of each pose, (N,) float64; the rest, up to 1, is the probability that none is right.

    `log_weights` are the log odds of each pose to that none of them is right.
    """
    weights = np.append(np.asarray(log_weights, dtype=np.float64), 0.0)
    weights = np.exp(weights - weights.max())
    return np.asarray(weights[:-1] / weights.sum())


def accepted(probabilities: FloatArray, settings: CandidateSettings) -> list[int]:
    """Return the indices of the accepted poses, the most probable first; none where none is probable enough."""
    order = np.argsort(-probabilities)[: settings.max_candidates]
    (enough,) = np.nonzero(np.cumsum(probabilities[order]) >= settings.min_probability)
    return [int(one) for one in order[: enough[0] + 1]] if len(enough) else []
