"""Balls in one frame, and sightings of what looks like one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from robocup_vision.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """The place of a ball.

    Parameters
    ----------
    x_m, y_m : float
        Its centre in the robot frame, metres.
    covariance : (2, 2) float64
        Covariance of its position, square metres.
    u_px, v_px : float
        Its centre in the frame.
    log_likelihood_ratio : float
        Log-likelihood ratio of a ball to anything else with its appearance, nats.
    """

    x_m: float
    y_m: float
    covariance: FloatArray
    u_px: float
    v_px: float
    log_likelihood_ratio: float = 0.0


class Sighting(NamedTuple):
    """A sighting of what looks like a ball."""

    #: its centre in the frame, and the standard deviation of that
    u_px: float
    v_px: float
    std_px: float
    nats: float  #: log-likelihood ratio of a ball


def lie_apart(places: Sequence[tuple[float, float, float]], radii: float) -> list[int]:
    """Return the indices of the sightings (u, v, radius), the most likely first, that overlap no more likely one.

    Two overlap if their centres are no farther apart than this number of radii of the larger.
    """
    kept: list[int] = []
    for n, (u, v, radius) in enumerate(places):
        others = (places[m] for m in kept)
        if all(math.hypot(u - x, v - y) > radii * max(radius, other) for x, y, other in others):
            kept.append(n)
    return kept
