"""Tells the kinds of what one frame shows on the floor, when somebody asks for one of them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.kinds.network import KINDS, Kind, KindNetwork, upright_pictures
from robocup_vision.perception.networks import Shrunk

# a kind is told from here on: of twenty told in photographs of an event that was not learnt from, one at most is wrong
MIN_NATS = 3.0
# farther away a thing is too few pixels: none so far was learnt from
MAX_RANGE_M = 8.0


class _OfThread(threading.local):
    """The network of each thread."""

    @cached_property
    def network(self) -> KindNetwork:
        return KindNetwork()


_OF_THREAD = _OfThread()


@dataclass(frozen=True, eq=False)
class KindSource:
    """What the kinds of the things in one frame are told by.

    Parameters
    ----------
    frame : callable
        Returns the frame, (H, W, 3) uint8, BGR.
    camera : PinholeCamera
        As held in the frame.
    places_m : (N, 2) float64
        Where the things stand, robot frame.
    """

    frame: Callable[[], UInt8Array]
    camera: PinholeCamera
    places_m: FloatArray

    def kind(self, number: int) -> Kind | None:
        """Return the kind of one thing, by its number; None where nothing tells."""
        return self._kinds[number]

    @cached_property
    def _kinds(self) -> tuple[Kind | None, ...]:
        away_m = ((self.places_m - self.camera.offset_m) ** 2).sum(axis=1) ** 0.5
        pictures = upright_pictures(Shrunk(self.frame()), self.camera, self.places_m)
        nats = _OF_THREAD.network.nats(pictures)
        nats[away_m > MAX_RANGE_M] = -MIN_NATS
        return tuple(KINDS[int(one.argmax())] if one.max() >= MIN_NATS else None for one in nats)
