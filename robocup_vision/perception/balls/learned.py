"""Balls of any look in frames of a fisheye, by the network, each where its size belongs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Ball, ball_on_floor
from robocup_vision.perception.balls.network import BallNetwork, BallPlaces, Sighting

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
    """What the search by the network can be tuned by.

    Parameters
    ----------
    min_nats : float
        A sighting with less is no ball: of thirty balls told in photographs of an event that was not learnt from one at
        most is none.
    again_nats : float
        It may be so much less near a ball of the last frame: balls stay.
    max_balls : int
        Told at most.
    near_looks : int
        So many looks after one at the whole frame go near the balls that it showed, as long as these are seen.
    place_std : float
        Of a ball's centre, in radii.
    tilt_std_rad : float
        Of the camera's tilt, which sways.
    """

    min_nats: float = 2.0
    again_nats: float = 1.0
    max_balls: int = 8
    near_looks: int = 3
    place_std: float = 0.15
    tilt_std_rad: float = 0.013


class LearnedBallFinder:
    """Finds balls of any look in frames of one pinhole camera; holds scratch memory: one object a thread.

    Parameters
    ----------
    field : Field
        Gives the ball's size.
    camera : PinholeCamera
        With a known tilt.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    settings : LearnedBallSettings, optional
        Thresholds of the search.
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
        """Forget where balls were in the last frame."""
        self._last: list[Sighting] = []
        self._near_looks = 0

    def find(self, frame: UInt8Array, camera: PinholeCamera) -> tuple[Ball, ...]:
        """Find the balls in a frame, the likeliest first.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR.
        camera : PinholeCamera
            As held in the frame.
        """
        seen = self._look(frame, self._places_of(camera))
        placed = (self._ball(one, camera) for one in seen)
        return tuple([ball for ball in placed if ball is not None][: self.settings.max_balls])

    def _look(self, frame: UInt8Array, places: BallPlaces) -> list[Sighting]:
        """Look near the last balls, and at the whole frame now and then, or where one of them is not seen again."""
        min_nats = self.settings.min_nats
        if self._last and self._near_looks < self.settings.near_looks:
            strips = places.near(self._last)
            seen = [] if strips is None else self._network.look(frame, strips, min_nats - self.settings.again_nats)
            if len(seen) >= len(self._last):
                self._near_looks += 1
                self._last = seen
                return seen
        whole = places.strips
        self._last = [] if whole is None else self._network.look(frame, whole, min_nats)
        self._near_looks = 0
        return self._last

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
        s, radius_m = self.settings, self._radius_m
        return ball_on_floor(
            camera,
            (one.u_px, one.v_px),
            radius_m,
            lambda distance_m: s.place_std * radius_m / distance_m,
            s.tilt_std_rad,
            one.nats,
        )
