"""Elo ratings from the results of matches: the model of Bradley and Terry, fitted by maximum likelihood with a prior.

Player i wins against player j with the probability 1 / (1 + 10^((r_j - r_i) / 400)). A draw counts as half a match won
and half a match lost. The posterior is concave in the ratings, so Newton's method finds its one maximum.

The standard errors come from the information matrix at that maximum. Bootstrap over matches would need a source of
chance, and would say "no error" of a player that won all of a few matches. A draw varies less than a match that is won
or lost with the same mean, so errors are rather too large where there are many draws.

Source: Bradley and Terry, Rank analysis of incomplete block designs, Biometrika 39, 1952.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray

_ELO_PER_LOGIT = 400.0 / math.log(10.0)
# Newton's method doubles the digits with each step
_MAX_STEPS = 100
_CONVERGED_LOGIT = 1e-12


@dataclass(frozen=True, slots=True)
class RatingSettings:
    """Values of `rate_players`."""

    #: Mean of all ratings: results tell differences alone.
    mean_elo: float = 1500.0
    #: Standard deviation of a rating before any match. Keeps a player finite that won or lost all its matches. 400 Elo
    #: are ten matches won for one lost; among players of one program that is a large difference.
    prior_std_elo: float = 400.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean_elo):
            raise ArgumentError(f"mean_elo must be finite, got {self.mean_elo!r}")
        if not 0.0 < self.prior_std_elo < math.inf:
            raise ArgumentError(f"prior_std_elo must be positive, got {self.prior_std_elo!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Ratings:
    """Ratings of some players."""

    #: (n,) float64: rating of each player.
    elo: FloatArray
    #: (n, n) float64: of the errors of the ratings about their common mean, Elo squared.
    covariance: FloatArray

    @property
    def std_error_elo(self) -> FloatArray:
        """Standard error of each rating about the mean of all, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def difference(self, first: int, second: int) -> tuple[float, float]:
        """Return by how much the first player is rated above the second, and the standard error of that, in Elo."""
        apart = np.zeros(len(self.elo))
        apart[first] += 1.0
        apart[second] -= 1.0
        variance = float(apart @ self.covariance @ apart)
        return float(self.elo[first] - self.elo[second]), math.sqrt(max(variance, 0.0))


def rate_players(points: FloatArray, settings: RatingSettings = RatingSettings()) -> Ratings:
    """Rate players by what they won against each other.

    Parameters
    ----------
    points : (n, n) float64
        ``points[i, j]``: what player i won against player j, 1 for a match won and 0.5 for a draw. The diagonal is 0.

    Raises
    ------
    ArgumentError
        If the points are no such matrix.
    """
    won = np.asarray(points, dtype=np.float64)
    if won.ndim != 2 or won.shape[0] != won.shape[1] or not won.size:
        raise ArgumentError(f"points must be square, got shape {won.shape}")
    if not np.isfinite(won).all() or (won < 0.0).any() or np.diag(won).any():
        raise ArgumentError("points must be finite, not negative, and 0 on the diagonal")
    players = len(won)
    matches = won + won.T
    prior = (_ELO_PER_LOGIT / settings.prior_std_elo) ** 2
    rating = np.zeros(players)
    information = np.eye(players)
    value = _log_posterior(rating, won, prior)
    for _ in range(_MAX_STEPS):
        probability = 1.0 / (1.0 + np.exp(rating[None, :] - rating[:, None]))
        gradient = (won - matches * probability).sum(axis=1) - prior * rating
        weight = matches * probability * (1.0 - probability)
        information = np.diag(weight.sum(axis=1) + prior) - weight
        step = np.linalg.solve(information, gradient)
        if np.abs(step).max() < _CONVERGED_LOGIT:
            break
        # far from the maximum a whole step may go past it
        part = 1.0
        while part > _CONVERGED_LOGIT and _log_posterior(rating + part * step, won, prior) < value:
            part *= 0.5
        rating = rating + part * step
        value = _log_posterior(rating, won, prior)
    centred = np.eye(players) - 1.0 / players
    covariance = centred @ np.linalg.inv(information) @ centred * _ELO_PER_LOGIT**2
    rating = rating - rating.mean()
    return Ratings(settings.mean_elo + _ELO_PER_LOGIT * rating, covariance)


def _log_posterior(rating: FloatArray, won: FloatArray, prior: float) -> float:
    """Return the logarithm of the ratings' probability, but for a constant."""
    return float(-(won * np.logaddexp(0.0, rating[None, :] - rating[:, None])).sum() - 0.5 * prior * rating @ rating)
