"""Renders the frames of a match whose robots carry several cameras each."""

from __future__ import annotations

from collections.abc import Sequence

from robocup_vision.arrays import UInt8Array
from sim2d.rendering.scene import Light
from sim2d.sensors.body_sway import UPRIGHT, Sway
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.state import WorldState


class MatchRig:
    """Takes the pictures of all cameras of a robot at one moment."""

    def __init__(self, cameras: Sequence[MatchCamera]) -> None:
        self._cameras = tuple(cameras)

    def render(self, state: WorldState, index: int, sway: Sway = UPRIGHT) -> tuple[UInt8Array, ...]:
        """Take one robot's pictures, (H, W, 3) uint8 each, read-only; see `MatchCamera.render`."""
        return tuple(camera.render(state, index, sway) for camera in self._cameras)

    def set_light(self, light: Light) -> None:
        """See `MatchCamera.set_light`."""
        for camera in self._cameras:
            camera.set_light(light)
