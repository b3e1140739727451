"""A ball as one frame shows it, and what the search for it can be tuned by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from robocup_vision.arrays import FloatArray
from robocup_vision.kernels.balls.evidence import BallEvidence


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


@dataclass(frozen=True, slots=True)
class BallSettings:
    """What the search for balls can be tuned by."""

    evidence: BallEvidence = field(default_factory=BallEvidence)  #: what a ball looks like, and everything else
    #: a find with less is no ball: of some hundred things of its colour in a frame none may pass by chance
    min_log_likelihood_ratio: float = 6.5
    #: it may be so much less where the last frame showed a ball within so many half sizes: balls stay, and of the
    #: hundred things few are so near
    again_nats: float = 3.0
    again_half_sizes: float = 8.0
    max_blobs: int = 128  #: more are not looked at: a picture full of the ball's colour
    #: so many standard deviations of the noise beyond where it begins on the way from white is the ball's colour: dark
    #: grey has any hue in noise
    white_noise_stds: float = 0.5
    #: where on the way from white it begins where a channel is at its end, by the others: a ball burnt out by a lamp is
    #: nearly white
    clipped_ratio: float = 0.15
    #: standard deviations by which floor seldom differs from itself: the ball's colour begins beyond
    floor_stds: float = 3.5
    min_level: float = 0.6  #: brightness of the ball's shaded side, sum of its channels, as a ratio of the lit floor's
    min_signal: float = 4.0  #: standard deviations by which a blob must differ from the floor
    #: mean log-likelihood ratio from which on the floor near the robot is all carpet; how far, as a standard deviation,
    #: robots and walls let it fall; nats of a frame with such a floor. Photographs of anything have 1.3 (median), of
    #: fields 3 to 4; of rendered frames in a crowd one in ten has less than 1.5.
    floor_nats: float = 3.0
    floor_std: float = 0.7
    max_floor: float = 1.0
    #: carpet is greener than grey and than the frame's white by some times the first, a logarithm; each time that it is
    #: less green costs the second. The greyest carpet of the photographs has 1.5 times the first.
    green_scale: float = 0.025
    green_nats: float = 2.0
    center_std_px: float = 0.3  #: of the blob's centre
    #: something upright goes on above a blob, or below it, where what is as wide as it differs
    #: from what lies to both sides by so many levels, and by so many times what differs in it; what that costs
    min_upright_step: float = 15.0
    upright_spreads: float = 2.0
    upright_nats: float = -2.5
