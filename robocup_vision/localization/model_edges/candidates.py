"""Weighs poses found without a prior against each other, and against that none of them is right.

Many poses of a field explain a picture well; only a comparison tells which one is right. The posterior is a conditional
logit over all poses that were fitted, with one more outcome: the right pose is not among them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.localization.model_edges.evidence import Evidence


@dataclass(frozen=True, slots=True)
class CandidateSettings:
    """Weights of what a fit shows, and what is done with the posterior.

    The weights were fitted to 530 pictures of development sequences (four_legged_2007 and spl_2020).
    """

    # of the fraction missing where carpet shows instead
    of_missing: float = -35.7
    # of the fraction found of all that were looked for: a pose that hides much explains little
    of_found: float = 4.24
    # of the fraction of line points left unexplained
    of_unexplained: float = -27.1
    # of the inliers' root mean square, pixels of a picture 208 wide: wrong poses leave larger residuals
    of_rms: float = -5.79
    # of each edge of the field that is found
    of_edge: float = 0.71
    # of the logarithm of the position's standard deviation, metres: what fits everywhere explains nothing
    of_std: float = -1.26
    # of the outcome that none is right
    of_none: float = 6.76
    # smallest probability of a pose that is the answer alone, and of several together that are candidates. Of 1661
    # frames of development walks 0.4 % are answered wrongly and 64 % rightly; at 0.94 0.6 and 65 %
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
    """Return which poses are the answer, the most probable first; none where too much is left open."""
    order = np.argsort(-probabilities)[: settings.max_candidates].tolist()
    total = 0.0
    for number, index in enumerate(order, 1):
        total += float(probabilities[index])
        if total >= (settings.min_probability if number == 1 else settings.min_together):
            return [int(one) for one in order[:number]]
    return []
