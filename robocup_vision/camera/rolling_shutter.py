"""Straightens frames of a rolling shutter: the rows of a camera that turns are each seen from another heading."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import Float32Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera, camera_rotation

_TURN_RAD = 1e-4
# a smaller shift is less than what edges are measured to
_MIN_SHIFT_PX = 0.2


class RollingShutter:
    """Moves each row of a frame to where a camera that stands shows it.

    Parameters
    ----------
    camera : PinholeCamera
        Its `readout_s` says how long the rows take. An unknown tilt counts as level. How the body nods is not known.

    Notes
    -----
    A head that pans at 6 rad/s turns by 7 degrees while the rows are read in 20 ms: lines and posts lean, and places by
    them are off by decimetres. The frame is warped once, to first order in the turn; the middle row stays.
    """

    def __init__(self, camera: PinholeCamera) -> None:
        self._camera = camera
        width, height = camera.size_px
        u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        # as the head pans, about the vertical
        rotation = camera_rotation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        turned = camera_rotation(_TURN_RAD, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        pixels = np.stack([u, v], axis=-1)
        moved = camera.camera_ray_to_pixel(camera.pixel_to_camera_ray(pixels) @ rotation.T @ turned)
        shift = np.nan_to_num((moved - pixels) / _TURN_RAD)
        part = (v / max(height - 1, 1) - 0.5)[..., None]
        self._u, self._v = u.astype(np.float32), v.astype(np.float32)
        # pixels a radian of turn between the first row and the last
        self._shift_u: Float32Array = (shift * part)[..., 0].astype(np.float32)
        self._shift_v: Float32Array = (shift * part)[..., 1].astype(np.float32)
        self._max_shift = float(np.abs(self._shift_u).max(initial=0.0))

    def straighten(self, frame: UInt8Array, turn_rps: float) -> UInt8Array:
        """Return the frame as a camera takes it that stands as this one did when the middle row was read.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            As read.
        turn_rps : float
            How fast the camera turned about the vertical, head and body together, positive to the left.

        Returns
        -------
        (H, W, 3) uint8
            The frame itself where the turn moves nothing.
        """
        turn = turn_rps * self._camera.readout_s
        if not abs(turn) * self._max_shift > _MIN_SHIFT_PX:
            return frame
        around = cv2.scaleAdd(self._shift_u, turn, self._u)
        down = cv2.scaleAdd(self._shift_v, turn, self._v)
        # to a 32nd of a pixel, in whole numbers: `remap` takes two thirds of the time
        places, parts = cv2.convertMaps(around, down, cv2.CV_16SC2)
        straight = cv2.remap(frame, places, parts, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(straight, dtype=np.uint8)
