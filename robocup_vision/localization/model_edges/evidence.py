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
    odds_against: float
    edges: float

    @property
    def found_ratio(self) -> float:
        """Fraction of the samples predicted that are not hidden."""
        return self.found / max(self.found + self.missing, 1.0)

    def log_odds(self, settings: EdgeSettings) -> float:
        """Logarithm of the odds that the pose is right; see `EdgeSettings` for the weights' origin."""
        return self.odds_but_std - settings.odds_against_std * min(self.position_std_m, 0.5)

    def log_likelihood_ratio(self, settings: EdgeSettings) -> float:
        """Logarithm of how much likelier the frame is if the pose is right.

        A frame that shows little says little: it speaks against a pose only by what contradicts it.
        """
        return max(self.log_odds(settings), -self.odds_against)


def reject(evidence: Evidence, settings: EdgeSettings, prior_log_odds: float = 0.0) -> str | None:
    """Return why a fit is rejected, None where it is accepted.

    Parameters
    ----------
    evidence : Evidence
        Of the frame.
    settings : EdgeSettings
        Thresholds.
    prior_log_odds : float
        Logarithm of the odds that the prior is right, by the frames before.
    """
    s, e = settings, evidence
    if e.inliers < (s.min_inliers if prior_log_odds <= 0.0 else s.min_inliers_followed):
        return f"only {e.inliers:.0f} places on edges agree"
    if e.found_ratio < s.min_found_ratio:
        return f"{e.missing:.0f} places on edges are missing, {e.found:.0f} are there"
    if e.points >= s.min_points and e.explained < s.min_explained_ratio * e.points:
        return f"only {e.explained:.0f} of {e.points:.0f} line points are explained"
    if e.prior_distance2 > s.max_prior_distance2:
        return "what is in view lies too far from where the prior puts it"
    odds = e.log_odds(s)
    if prior_log_odds > 0.0:
        odds = prior_log_odds + e.log_likelihood_ratio(s)
    if odds < s.min_log_odds:
        return f"the picture does not confirm the pose: odds {math.exp(odds):.2g} to 1"
    return None
