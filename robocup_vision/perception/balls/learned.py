"""Search for balls of any appearance by the network, where a ball has the right size."""

from __future__ import annotations

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.perception.balls.ball import Sighting
from robocup_vision.perception.balls.network import BallNetwork, BallPlaces, BallSpot, is_near
from robocup_vision.perception.balls.projection import BallFrame, Sightings
from robocup_vision.perception.balls.sizes import BallSizes

# greatest number of places to search again
_MAX_EXPECTED = 8
# least log-likelihood ratio of a ball, and its reduction near a ball that was seen, because balls stay
MIN_NATS, _AGAIN_NATS = 2.0, 1.0
# period in which the whole frame is searched once, a part in each look, and time for which the surroundings of
# sightings are searched: short enough for a ball that comes into view. Frames without a time, or farther apart, are
# searched completely.
SWEEP_S = 0.4
# standard deviation of a ball's centre, in radii
_PLACE_STD = 0.15


class _Expected(NamedTuple):
    """A place to search again: a ball with its time, or a possible one that is not reported."""

    seen: BallSpot
    seen_s: float
    is_ball: bool


class LearnedLook:
    """Balls of any appearance in frames of one pinhole camera; has scratch memory, so not shared between threads.

    Parameters
    ----------
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(self, mask: UInt8Array | None = None) -> None:
        self._mask = mask
        self._network = BallNetwork()
        self._places: WeakKeyDictionary[BallSizes, BallPlaces] = WeakKeyDictionary()
        self.forget()

    def forget(self) -> None:
        """Forget the previous frames: the next one is searched completely."""
        self._expected: list[_Expected] = []
        self._looked_s: float | None = None
        # fraction of the whole frame's work that this sweep has done
        self._swept = 0.0

    def sightings(self, seen: BallFrame) -> Sightings:
        """Return the sightings of balls in a frame."""
        if seen.projection is None:
            return [], None
        balls = self._look(seen.frame, self._places_of(seen.projection.sizes), self._part_of_work(seen.t_s))
        is_ball = [self._is_ball(one) for one in balls]
        self._expect(balls, is_ball, seen.t_s)
        reported = [one for one, is_reported in zip(balls, is_ball, strict=True) if is_reported]
        return [Sighting(one.u_px, one.v_px, _PLACE_STD * one.radius_px, one.nats) for one in reported], seen.projection

    def _part_of_work(self, t_s: float | None) -> float:
        """Return the fraction of the whole frame to search at this time."""
        since_s = math.inf if t_s is None or self._looked_s is None else t_s - self._looked_s
        self._looked_s = t_s
        return since_s / SWEEP_S if 0.0 < since_s < SWEEP_S else 1.0

    def _look(self, frame: UInt8Array, places: BallPlaces, part: float) -> list[BallSpot]:
        """Search the whole frame, or its next part and the places where balls are expected.

        A sighting may be less certain than a reported ball.
        """
        strips = places.strips
        if part >= 1.0:
            self._expected, self._swept = [], 0.0
        else:
            begin, end = self._swept, self._swept + part
            self._swept = end - 1.0 if end >= 1.0 else end
            strips = None if strips is None else strips.some(begin, end, [one.seen for one in self._expected])
        min_nats = MIN_NATS - _AGAIN_NATS
        return [] if strips is None else self._network.look(frame, strips, min_nats)

    def _is_ball(self, one: BallSpot) -> bool:
        """Whether a sighting is reported as a ball: certain by itself, or near a previous ball."""
        place = np.array(one)
        return one.nats >= MIN_NATS or any(
            bool(is_near(place, other.seen)) for other in self._expected if other.is_ball
        )

    def _expect(self, seen: list[BallSpot], is_ball: list[bool], t_s: float | None) -> None:
        """Expect balls at the present sightings, and for a while at previous ones."""
        if t_s is None:
            return
        places = np.array(seen).reshape(-1, 4)
        old = [one for one in self._expected if t_s - one.seen_s < SWEEP_S and not is_near(places, one.seen).any()]
        new = [_Expected(one, t_s, ball) for one, ball in zip(seen, is_ball, strict=True)]
        self._expected = [*new, *old][:_MAX_EXPECTED]

    def _places_of(self, sizes: BallSizes) -> BallPlaces:
        """Return the places to search for balls of these sizes; cached as long as the sizes exist."""
        if sizes not in self._places:
            self._places[sizes] = BallPlaces(sizes, self._mask)
        return self._places[sizes]
