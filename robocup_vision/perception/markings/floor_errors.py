"""What the places of a frame's pixels on the floor err by in common: how the camera is held is known so well only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera

Held = TypeVar("Held", OmniCamera, PinholeCamera)


@dataclass(frozen=True)
class FloorErrors:
    """A camera, and the same camera held a little otherwise.

    Parameters
    ----------
    camera : OmniCamera or PinholeCamera
        As the frame shows it to be held.
    sway_std_rad : float
        Of tilt and roll, where a forward camera does not say.
    mirror_std_rad : float
        Of a mirror camera's tilt about either axis.
    """

    camera: OmniCamera | PinholeCamera
    sway_std_rad: float
    mirror_std_rad: float

    @cached_property
    def _others(self) -> tuple[tuple[OmniCamera | PinholeCamera, OmniCamera | PinholeCamera], ...]:
        """The camera off by a standard deviation of tilt, roll and height either way, one at a time."""
        camera = self.camera
        if isinstance(camera, PinholeCamera):
            tilt_std, roll_std = camera.sway_std_rad(self.sway_std_rad)
            tilt, roll, height = camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m
            return (
                _both(lambda s: camera.with_orientation(camera.pan_rad, tilt + s * tilt_std, roll)),
                _both(lambda s: camera.with_orientation(camera.pan_rad, tilt, roll + s * roll_std)),
                # a camera is above the floor
                _both(lambda s: replace(camera, height_m=max(height + s * camera.height_std_m, 0.1 * height))),
            )
        if camera.height_m is None or not self.mirror_std_rad:
            return ()
        (x, y), std = camera.tilt_rad, self.mirror_std_rad
        held = replace(camera, viewpoint_height_m=camera.height_m)
        return (
            _both(lambda s: replace(held, tilt_rad=(x + s * std, y))),
            _both(lambda s: replace(held, tilt_rad=(x, y + s * std))),
        )

    def shifts_m(self, pixels: FloatArray) -> FloatArray:
        """How far floor places of pixels (..., 2) move by one standard deviation of each error, (..., 2, K), metres.

        Half of what they move by from one such deviation to the opposite one: the farther away, the more the two
        differ. NaN where a pixel may be beyond the horizon.
        """
        shifts = [(more.pixel_to_floor(pixels) - less.pixel_to_floor(pixels)) / 2 for more, less in self._others]
        return np.stack(shifts, axis=-1) if shifts else np.empty((*np.shape(pixels), 0))


def _both(held: Callable[[float], Held]) -> tuple[Held, Held]:
    return held(1.0), held(-1.0)
