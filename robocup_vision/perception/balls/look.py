"""Interface of the searches for balls, each of which identifies balls by other properties."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Sighting
from robocup_vision.perception.balls.projection import BallProjection
from robocup_vision.perception.color_table import ColorTable


class BallFrame(NamedTuple):
    """A frame, with what is known of it."""

    frame: UInt8Array  #: (H, W, 3) uint8, BGR
    camera: OmniCamera | PinholeCamera  #: as held in the frame; its tilt may be unknown
    projection: BallProjection | None = None  #: projection of balls; if None a finder makes it, if the tilt is known
    table: ColorTable | None = None  #: the colours; None if not learnt yet
    #: mean log-likelihood ratio of the floor near the robot
    near_floor_nats: float = 0.0
    t_s: float | None = None  #: when it was taken


class BallLook(Protocol):
    """A search for balls by their appearance."""

    def sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """Return the sightings, the most likely first, and the projection: the frame's, or one estimated from balls."""
        ...

    def forget(self) -> None:
        """Forget the previous frames."""
        ...
