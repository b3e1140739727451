"""Balls of any look in frames of a fisheye, by the network, each where its size belongs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Ball, ball_on_floor
from robocup_vision.perception.balls.network import BallNetwork, BallPlaces, Sighting, is_near

# places are worked out anew where tilt or roll, or height or focal length by their logarithms, differ by half of this:
# sizes then are still those that it knows
_STEP_RAD, _STEP_RATIO = math.radians(0.5), 0.04
_MAX_PLACES = 64


def is_learned(camera: PinholeCamera) -> bool:
    """Whether balls are found by the network: in a fisheye.

    It has learnt from photographs of fisheyes. In those of narrow lenses the finders by colour and by patches see more.
    """
    return isinstance(camera, FisheyeCamera)


@dataclass(frozen=True, slots=True)
class LearnedBallSettings:
    """What the search by the network can be tuned by."""

    #: a sighting with less is no ball: of thirty balls told in photographs of an event that was not learnt from one at
    #: most is none
    min_nats: float = 2.0
    again_nats: float = 1.0  #: reduction of the threshold near a ball that was seen: balls stay
    max_balls: int = 8  #: largest number of balls that are reported
    #: the whole frame is searched once in so long, a part each look, and for so long near what was last seen then: less
    #: than half a second, in which a robot is to know of a ball that comes into view. Frames without a time, or farther
    #: apart, are searched whole.
    sweep_s: float = 0.4
    place_std: float = 0.15  #: of a ball's centre, in radii
    tilt_std_rad: float = 0.013  #: of the camera's tilt, which sways


class _Expected(NamedTuple):
    """What is looked at again: where a ball was seen, and when; or what may be one, which is not reported."""

    seen: Sighting
    seen_s: float
    is_ball: bool


class LearnedBallFinder:
    """Finds balls of any look in frames of one pinhole camera; holds scratch memory: one object a thread.

    Parameters
    ----------
    camera : PinholeCamera
        With a known tilt.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        mask: UInt8Array | None = None,
        settings: LearnedBallSettings = LearnedBallSettings(),
    ) -> None:
        self.settings = settings
        self._radius_m = field.ball_radius_m
        self._mask = mask
        self._network = BallNetwork()
        self._places: dict[tuple[int, ...], BallPlaces] = {}
        self.forget()

    def forget(self) -> None:
        """Forget the frames before: the next one is searched whole."""
        self._expected: list[_Expected] = []
        self._looked_s: float | None = None
        # fraction of the whole frame's work that this sweep has done
        self._swept = 0.0

    def find(self, frame: UInt8Array, camera: PinholeCamera, t_s: float | None = None) -> tuple[Ball, ...]:
        """Find the balls in a frame, the likeliest first."""
        seen = self._look(frame, self._places_of(camera), self._part_of_work(t_s))
        is_ball = [self._is_ball(one) for one in seen]
        self._expect(seen, is_ball, t_s)
        placed = (self._ball(one, camera) for one, ball in zip(seen, is_ball, strict=True) if ball)
        return tuple([ball for ball in placed if ball is not None][: self.settings.max_balls])

    def _part_of_work(self, t_s: float | None) -> float:
        """Return how much of the whole frame is searched in the look at this time."""
        since_s = math.inf if t_s is None or self._looked_s is None else t_s - self._looked_s
        self._looked_s = t_s
        return since_s / self.settings.sweep_s if 0.0 < since_s < self.settings.sweep_s else 1.0

    def _look(self, frame: UInt8Array, places: BallPlaces, part: float) -> list[Sighting]:
        """Look at the whole frame, or at the part of it that is next and where balls are expected.

        A sighting may be less certain than a ball that is reported.
        """
        strips = places.strips
        if part >= 1.0:
            self._expected, self._swept = [], 0.0
        else:
            begin, end = self._swept, self._swept + part
            self._swept = end - 1.0 if end >= 1.0 else end
            strips = None if strips is None else strips.some(begin, end, [one.seen for one in self._expected])
        min_nats = self.settings.min_nats - self.settings.again_nats
        return [] if strips is None else self._network.look(frame, strips, min_nats)

    def _is_ball(self, one: Sighting) -> bool:
        """Whether a sighting is reported as a ball: certain by itself, or where a ball was."""
        place = np.array(one)
        return one.nats >= self.settings.min_nats or any(
            bool(is_near(place, other.seen)) for other in self._expected if other.is_ball
        )

    def _expect(self, seen: list[Sighting], is_ball: list[bool], t_s: float | None) -> None:
        """Expect what is seen, and for a while what is not seen again."""
        if t_s is None:
            return
        places = np.array(seen).reshape(-1, 4)
        old = [
            one
            for one in self._expected
            if t_s - one.seen_s < self.settings.sweep_s and not is_near(places, one.seen).any()
        ]
        new = [_Expected(one, t_s, ball) for one, ball in zip(seen, is_ball, strict=True)]
        self._expected = [*new, *old][: self.settings.max_balls]

    def _places_of(self, camera: PinholeCamera) -> BallPlaces:
        """Return the places made for about this orientation; the last used ones are kept."""
        held = [round(math.log(size) / _STEP_RATIO) for size in (camera.height_m, *camera.focal_px)]
        steps = (*held, *(round(angle / _STEP_RAD) for angle in (camera.tilt_rad or 0.0, camera.roll_rad or 0.0)))
        made = self._places.pop(steps) if steps in self._places else BallPlaces(camera, self._radius_m, self._mask)
        self._places[steps] = made
        if len(self._places) > _MAX_PLACES:
            del self._places[next(iter(self._places))]
        return made

    def _ball(self, one: Sighting, camera: PinholeCamera) -> Ball | None:
        """Place a ball on the floor; None where its ray does not meet it."""
        s = self.settings
        return ball_on_floor(camera, (one.u_px, one.v_px), self._radius_m, s.place_std, s.tilt_std_rad, one.nats)
