"""A ball as one frame shows it, and what looks like one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from robocup_vision.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """Where a ball is.

    Parameters
    ----------
    x_m, y_m : float
        Its centre in the robot frame, metres.
    covariance : (2, 2) float64
        Of its position, square metres.
    u_px, v_px : float
        Its centre in the frame.
    log_likelihood_ratio : float
        How much more likely a ball looks so than anything else that has its colour, nats.
    """

    x_m: float
    y_m: float
    covariance: FloatArray
    u_px: float
    v_px: float
    log_likelihood_ratio: float = 0.0


class Sighting(NamedTuple):
    """What looks like a ball."""

    #: its centre in the frame, and the standard deviation of that
    u_px: float
    v_px: float
    std_px: float
    nats: float  #: log-likelihood ratio: what speaks for it


def lie_apart(places: Sequence[tuple[float, float, float]], radii: float) -> list[int]:
    """Return the indices of the finds (u, v, radius), the likeliest first, that lie over no likelier one.

    They do where their centres are no farther apart than so many radii of the larger.
    """
    kept: list[int] = []
    for n, (u, v, radius) in enumerate(places):
        others = (places[m] for m in kept)
        if all(math.hypot(u - x, v - y) > radii * max(radius, other) for x, y, other in others):
            kept.append(n)
    return kept
