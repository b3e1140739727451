"""Fuses a robot's own sighting of the ball with those of its team.

Each sighting is extrapolated to the present with its own velocity, and its covariance grows with its age, because the
ball may have been kicked since. The ball's motion since then is common to all sightings, so their errors are correlated
in an unknown way. They are fused by covariance intersection, which is consistent for any correlation.

A robot that is lost reports the ball at a wrong place, most often in the wrong half. Three rules exclude it. Sightings
that are too far apart (Mahalanobis distance) are not fused; the group of consistent sightings with the largest weight
is used. If the robot itself has just seen the ball, its own sighting decides. A robot whose sightings contradicted the
own ones before is not believed alone.

Source: Julier and Uhlmann, A non-divergent estimation algorithm in the presence of unknown correlations, ACC 1997.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.normal import GATE_2D
from robocup_vision.team.message import BallSighting, TeamMessage

# weights tried for covariance intersection: near the best one the trace hardly changes
_WEIGHTS = np.linspace(0.0, 1.0, 21)
OWN = -1
FORGET_S = 4.0  # an older sighting is useless: in this time a kicked ball crosses a field
# the own sighting decides while it is younger than this; afterwards the ball may have been kicked
_OWN_S = 0.3
# while the own sighting decides and is better than this, messages add nothing: driving needs a precise relative place
_ENOUGH_STD_M = 0.1
# smallest standard deviation of a sighting along each axis: errors that all frames of a robot have in common
_MIN_STD_M = 0.03
# growth of the standard deviation with age: mostly the ball lies or rolls on, sometimes it is kicked
_KICK_SPEED_MPS = 0.3
_ROLL_S = 1.0  # a ball loses its velocity with this time constant: friction, and robots in its way
# one message adds the first to the trust in its sender, or subtracts the second. One message reveals a robot in the
# wrong half; two others are needed until it is believed alone again.
_AGREE_NATS = 0.5
_DISAGREE_NATS = 1.0
_MAX_TRUST_NATS = 2.0  # trust stays within this: a robot may get lost at any time


@dataclass(frozen=True, slots=True, eq=False)
class FusedBall:
    """The present state of the ball, field frame."""

    #: place and velocity
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    covariance: FloatArray  #: (2, 2) float64: covariance of the place, square metres
    sources: tuple[int, ...]  #: numbers of the robots that saw it, the newest sighting first; -1: this robot


class TeamBall:
    """Keeps the team's sightings of the ball, and fuses them with the robot's own."""

    def __init__(self) -> None:
        self._received: dict[int, BallSighting] = {}
        self._trust: dict[int, float] = {}
        self._since_s = -math.inf

    def update(self, message: TeamMessage, own: BallSighting | None) -> None:
        """Add a message; one that is not newer than the last one of its sender is ignored.

        Parameters
        ----------
        message : TeamMessage
            Message of another robot.
        own : BallSighting or None
            This robot's last sighting of the ball.
        """
        received, known = message.ball, self._received.get(message.sender)
        if received is None or received.t_s < self._since_s or (known is not None and received.t_s <= known.t_s):
            return
        self._received[message.sender] = received
        if own is None or abs(own.t_s - received.t_s) > _OWN_S:
            return
        t_s = max(own.t_s, received.t_s)
        change = _AGREE_NATS if _agree(self.moved(own, t_s), self.moved(received, t_s)) else -_DISAGREE_NATS
        trust = self.trust(message.sender) + change
        self._trust[message.sender] = max(-_MAX_TRUST_NATS, min(_MAX_TRUST_NATS, trust))

    def is_own_enough(self, own: BallSighting, t_s: float) -> bool:
        """Whether the own sighting is so recent and accurate that messages add nothing."""
        largest = float(np.linalg.eigvalsh(own.covariance)[-1])
        return t_s - own.t_s <= _OWN_S and largest <= _ENOUGH_STD_M**2

    def forget(self, t_s: float) -> None:
        """Forget sightings from before a time, because the ball was put elsewhere, as for a kick-off."""
        self._since_s = t_s
        self._received = {sender: ball for sender, ball in self._received.items() if ball.t_s >= t_s}

    def reject(self, sources: Sequence[int]) -> None:
        """Forget the sightings of some robots, because the ball is not there."""
        for source in sources:
            self._received.pop(source, None)

    def trust(self, sender: int) -> float:
        """Return the trust in a robot, in nats: positive if its sightings mostly agreed with the own ones."""
        return self._trust.get(sender, 0.0)

    def moved(self, sighting: BallSighting, t_s: float) -> BallSighting:
        """Return a sighting extrapolated to a time."""
        age_s = max(t_s - sighting.t_s, 0.0)
        rolled_s = _ROLL_S * -math.expm1(-age_s / _ROLL_S)
        slower = math.exp(-age_s / _ROLL_S)
        kicked_mps2 = _KICK_SPEED_MPS**2 + sighting.velocity_std_mps**2
        variance = _MIN_STD_M**2 + kicked_mps2 * age_s**2
        return BallSighting(
            t_s,
            sighting.x_m + rolled_s * sighting.vx_mps,
            sighting.y_m + rolled_s * sighting.vy_mps,
            slower * sighting.vx_mps,
            slower * sighting.vy_mps,
            sighting.covariance + variance * np.eye(2),
            sighting.velocity_std_mps,
        )

    def fuse(self, own: BallSighting | None, t_s: float) -> FusedBall | None:
        """Return the present state of the ball; None if no robot that is believed has seen it lately.

        Parameters
        ----------
        own : BallSighting or None
            This robot's last sighting of the ball.
        """
        seen: Mapping[int, BallSighting] = self._received if own is None else {OWN: own, **self._received}
        seen = {k: one for k, one in seen.items() if t_s - one.t_s <= FORGET_S}
        moved = {k: self.moved(one, t_s) for k, one in seen.items()}
        group = self._believed(seen, moved, t_s)
        if not group:
            return None
        place, covariance = _intersect([moved[k] for k in group])
        newest = moved[group[0]]
        return FusedBall(float(place[0]), float(place[1]), newest.vx_mps, newest.vy_mps, covariance, tuple(group))

    def _believed(
        self, seen: Mapping[int, BallSighting], moved: Mapping[int, BallSighting], t_s: float
    ) -> Sequence[int]:
        """Return the robots whose sightings are believed, the newest sighting first."""
        is_own_fresh = OWN in seen and t_s - seen[OWN].t_s <= _OWN_S
        best: tuple[float, list[int]] = (0.0, [])
        for centre in seen:
            if is_own_fresh and centre != OWN:
                continue
            group = [k for k in seen if _agree(moved[centre], moved[k])]
            if len(group) == 1 and self.trust(centre) < 0.0:
                continue
            # newer sightings and trusted robots weigh more
            weight = sum(self._weight(k, t_s - seen[k].t_s) for k in group)
            if weight > best[0]:
                best = weight, group
        return sorted(best[1], key=lambda k: (-seen[k].t_s, k))

    def _weight(self, source: int, age_s: float) -> float:
        return math.exp(-age_s / FORGET_S) / (1.0 + math.exp(-self.trust(source)))


def _agree(one: BallSighting, other: BallSighting) -> bool:
    apart = np.array([one.x_m - other.x_m, one.y_m - other.y_m])
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart)) <= GATE_2D


def _intersect(sightings: Sequence[BallSighting]) -> tuple[FloatArray, FloatArray]:
    """Return place and covariance of the covariance intersection of sightings, fused one after the other."""
    place = np.array([sightings[0].x_m, sightings[0].y_m])
    information = np.linalg.inv(sightings[0].covariance)
    for one in sightings[1:]:
        other_place, other = np.array([one.x_m, one.y_m]), np.linalg.inv(one.covariance)
        weights = _WEIGHTS[:, None, None]
        both = weights * information + (1.0 - weights) * other
        k = int(np.argmin(np.trace(np.linalg.inv(both), axis1=1, axis2=2)))
        weight, sum_ = float(_WEIGHTS[k]), both[k]
        place = np.linalg.solve(sum_, weight * information @ place + (1.0 - weight) * other @ other_place)
        information = sum_
    covariance = np.linalg.inv(information)
    return place, np.asarray(0.5 * (covariance + covariance.T))
