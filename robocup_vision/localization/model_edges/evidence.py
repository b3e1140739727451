"""Decides whether a frame confirms a pose.

Hidden is neutral on the floor, where robots stand before lines, and counts a little against it higher up; missing
counts against it. The pose must explain the line points that are there, and the measurements alone must fix it: a pose
that only repeats its prior is not located.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
    odds_but_std: float

    @property
    def found_ratio(self) -> float:
        """Fraction of the samples predicted that are not hidden."""
        return self.found / max(self.found + self.missing, 1.0)

    def log_odds(self, settings: EdgeSettings) -> float:
        """Logarithm of the odds that the pose is right; see `EdgeSettings` for the weights' origin."""
        return self.odds_but_std - settings.odds_against_std * min(self.position_std_m, 0.5)


def reject(evidence: Evidence, settings: EdgeSettings) -> str | None:
    """Return why a fit is rejected, None where it is accepted."""
    s, e = settings, evidence
    if e.inliers < s.min_inliers:
        return f"only {e.inliers:.0f} places on edges agree"
    if e.found_ratio < s.min_found_ratio:
        return f"{e.missing:.0f} places on edges are missing, {e.found:.0f} are there"
    if e.points >= s.min_points and e.explained < s.min_explained_ratio * e.points:
        return f"only {e.explained:.0f} of {e.points:.0f} line points are explained"
    if e.prior_distance2 > s.max_prior_distance2:
        return "what is in view lies too far from where the prior puts it"
    odds = e.log_odds(s)
    if odds < s.min_log_odds:
        return f"the picture does not confirm the pose: odds {math.exp(odds):.2g} to 1"
    return None
