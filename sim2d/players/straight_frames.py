"""Correction of a player's frames for the rolling shutter, by the neck's joint and the odometry."""

from __future__ import annotations

import math

from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera, RollingShutter
from robocup_vision.localization.filter.pose_filter import PoseFilter

# greatest time between frames, after which a head may have swung to and fro
_MAX_GAP_S = 0.15


class StraightFrames:
    """Removes the skew of a rolling shutter from one robot's frames.

    Parameters
    ----------
    camera : PinholeCamera
        The camera of the file, with the shutter's `readout_s`.
    """

    def __init__(self, camera: PinholeCamera, odometry: PoseFilter) -> None:
        self._shutter = RollingShutter(camera)
        self._odometry = odometry
        self._last: tuple[float, float] | None = None  # exposure time and pan of the last frame

    def straighten(self, frame: UInt8Array, frame_t_s: float, pan_rad: float) -> UInt8Array:
        """Return a frame (H, W, 3) uint8 as taken by a resting camera; unchanged if the rotation is not known."""
        last, self._last = self._last, (frame_t_s, pan_rad)
        if last is None:
            return frame
        passed_s = frame_t_s - last[0]
        since, since_last = self._odometry.motion_since(frame_t_s), self._odometry.motion_since(last[0])
        if not 0.0 < passed_s <= _MAX_GAP_S or since is None or since_last is None:
            return frame
        body_rad = math.remainder(since_last.theta_rad - since.theta_rad, math.tau)
        return self._shutter.straighten(frame, (pan_rad - last[1] + body_rad) / passed_s)
