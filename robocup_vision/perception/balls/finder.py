"""Search for balls on the floor with any camera, by the appearance of the field's ball."""

from __future__ import annotations

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.balls.colored import ColoredLook
from robocup_vision.perception.balls.learned import LearnedLook
from robocup_vision.perception.balls.patterned import PatternedLook
from robocup_vision.perception.balls.projection import BallFrame, Sightings, ball_projection

# greatest number of balls that are reported
_MAX_BALLS = 8


def has_patches(field: Field, camera: OmniCamera | PinholeCamera) -> bool:
    """Whether balls are found by their dark patches."""
    return bool(field.ball_patches) and isinstance(camera, PinholeCamera) and not isinstance(camera, FisheyeCamera)


class BallFinder:
    """Finds balls in frames of one camera; has scratch memory, so not shared between threads.

    Parameters
    ----------
    field : Field
        Gives the ball's size and appearance; a plain white ball cannot be distinguished from lines.
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(self, field: Field, camera: OmniCamera | PinholeCamera, mask: UInt8Array | None = None) -> None:
        self._radius_m = field.ball_radius_m
        self._colored = ColoredLook(field, camera.size_px, mask)
        self._look: ColoredLook | LearnedLook | PatternedLook = self._colored
        if isinstance(camera, FisheyeCamera):
            # the network is trained on photographs of fisheyes; for narrower lenses colours and patches are more
            # reliable
            self._look = LearnedLook(mask)
        elif isinstance(camera, PinholeCamera) and has_patches(field, camera):
            self._look = PatternedLook(field.ball_radius_m, camera, mask)

    @property
    def is_by_color(self) -> bool:
        """Whether balls are found only by the colour that the field file names."""
        return self._look is self._colored

    def find(self, seen: BallFrame) -> tuple[Ball, ...]:
        """Find the balls in a frame, the most likely first."""
        if seen.projection is None and (isinstance(seen.camera, OmniCamera) or seen.camera.known_orientation):
            seen = seen._replace(projection=ball_projection(seen.camera, self._radius_m))
        return _placed(self._look.sightings(seen))

    def find_colored(self, seen: BallFrame) -> tuple[Ball, ...]:
        """Find balls of the field file's colour, independent of the method for other balls."""
        return _placed(self._colored.sightings(seen))

    def find_swapped(self, seen: BallFrame) -> tuple[Ball, ...]:
        """Find objects that look like balls with red and blue swapped; does not change the state.

        None are found if the ball's colour is nearly the same with red and blue swapped.
        """
        return _placed(self._colored.swapped_sightings(seen))

    def forget(self) -> None:
        """Forget the balls of previous frames."""
        self._look.forget()
        self._colored.forget()


def _placed(seen: Sightings) -> tuple[Ball, ...]:
    """Place balls on the floor; sightings whose ray does not meet it are dropped."""
    sightings, projection = seen
    if projection is None:
        return ()
    balls = (projection.place(*sighting) for sighting in sightings)
    return tuple([ball for ball in balls if ball is not None][:_MAX_BALLS])
