"""What a look for balls takes, a frame, and what it returns; each look knows balls by something else."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Sighting
from robocup_vision.perception.balls.projection import BallProjection
from robocup_vision.perception.color_table import ColorTable


class BallFrame(NamedTuple):
    """A frame, and what is known of it."""

    frame: UInt8Array  #: (H, W, 3) uint8, BGR
    camera: OmniCamera | PinholeCamera  #: as held in the frame; its tilt may be unknown
    projection: BallProjection | None = None  #: how it shows balls; None: a finder makes it, where the tilt is known
    table: ColorTable | None = None  #: the colours; None: not learnt yet
    #: mean log-likelihood ratio of the floor near the robot: how much of it is of the learnt floor's colour
    near_floor_nats: float = 0.0
    t_s: float | None = None  #: when it was taken


class BallLook(Protocol):
    """What a ball looks like, and how that is seen in frames."""

    def sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """Return what looks like balls, the likeliest first, and what places it: the frame's own, or as balls tell."""
        ...

    def forget(self) -> None:
        """Forget the frames before."""
        ...
