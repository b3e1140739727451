"""Correction of frames for a rolling shutter, in which each row of a rotating camera has another heading."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import Float32Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera, camera_rotation

_TURN_RAD = 1e-4
# least corrected shift, below the accuracy of edges
_MIN_SHIFT_PX = 0.2


class RollingShutter:
    """Warps frames of a rotating camera to those of a camera at rest.

    Parameters
    ----------
    camera : PinholeCamera
        Its `readout_s` is the readout time of a frame. An unknown tilt is 0. Rotations about other axes are ignored.

    Notes
    -----
    A head that pans at 6 rad/s turns by 7 degrees during a readout of 20 ms: lines and posts are tilted, and places are
    wrong by decimetres. The frame is warped once, to first order in the rotation; the middle row is unchanged.
    """

    def __init__(self, camera: PinholeCamera) -> None:
        self._camera = camera
        width, height = camera.size_px
        u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        # rotation about the vertical
        rotation = camera_rotation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        turned = camera_rotation(_TURN_RAD, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        pixels = np.stack([u, v], axis=-1)
        moved = camera.camera_ray_to_pixel(camera.pixel_to_camera_ray(pixels) @ rotation.T @ turned)
        shift = np.nan_to_num((moved - pixels) / _TURN_RAD)
        part = (v / max(height - 1, 1) - 0.5)[..., None]
        self._u, self._v = u.astype(np.float32), v.astype(np.float32)
        # shift of each pixel in pixels per radian of rotation during the readout
        self._shift_u: Float32Array = (shift * part)[..., 0].astype(np.float32)
        self._shift_v: Float32Array = (shift * part)[..., 1].astype(np.float32)
        self._max_shift = float(np.abs(self._shift_u).max(initial=0.0))

    def straighten(self, frame: UInt8Array, turn_rps: float) -> UInt8Array:
        """Return the frame of a camera at rest in the orientation at the readout of the middle row.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            The distorted frame.
        turn_rps : float
            Rotation rate of the camera about the vertical, head and body together, positive to the left.

        Returns
        -------
        (H, W, 3) uint8
            The same frame if all shifts are negligible.
        """
        turn = turn_rps * self._camera.readout_s
        if not abs(turn) * self._max_shift > _MIN_SHIFT_PX:
            return frame
        around = cv2.scaleAdd(self._shift_u, turn, self._u)
        down = cv2.scaleAdd(self._shift_v, turn, self._v)
        # fixed-point maps with 1/32 pixel, which take a third less time in `remap`
        places, parts = cv2.convertMaps(around, down, cv2.CV_16SC2)
        straight = cv2.remap(frame, places, parts, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(straight, dtype=np.uint8)
