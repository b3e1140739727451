"""Leans a mirror camera's frame over: what a body that sways a little does to a picture drawn upright.

The rays of a frame are sorted by bearing for an upright camera. For a small lean the picture itself is moved instead:
each pixel shows what the upright picture shows where its ray would come from there, which is linear in the lean.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import OmniCamera
from robocup_vision.camera.pinhole import camera_rotation
from sim2d.rendering.rays import RIM_MARGIN

# derivatives are differences over so much; less leans are not drawn: they move nothing by a tenth of a pixel
_STEP_RAD, _MIN_RAD = math.radians(1.0), math.radians(0.01)
# of maps whose two coordinates stand together
_NO_MAP = np.empty(0, dtype=np.float32)


class LeaningMirror:
    """Leans the frames of one mirror camera.

    Parameters
    ----------
    camera : OmniCamera
        With a known viewpoint height.
    """

    def __init__(self, camera: OmniCamera) -> None:
        self._height_m = camera.height_m or 0.0
        width, height = camera.size_px
        u, v = np.meshgrid(np.arange(width), np.arange(height))
        pixels = np.stack([u, v], axis=-1).astype(np.float64)
        self._upright = pixels.astype(np.float32)
        self._source = np.empty_like(self._upright)
        from_center = pixels - camera.center_px
        radius = np.hypot(from_center[..., 0], from_center[..., 1])
        inner, rim = camera.usable_radius_px[0], camera.usable_radius_px[1] * (1 + RIM_MARGIN)
        # the robot's own body leans with its camera, and beyond the mirror's rim it is black
        shows = (radius > inner) & (radius < rim)
        with np.errstate(invalid="ignore"):
            rays = camera.pixel_to_ray(pixels)
        self._by_pitch, self._by_roll = (
            _derivative(camera, rays, shows, lean) for lean in ((_STEP_RAD, 0.0), (0.0, _STEP_RAD))
        )

    def shift_m(self, pitch_rad: float, roll_rad: float) -> tuple[float, float]:
        """Return how far forward and left of its upright place the camera is: the body leans about its foot."""
        return -self._height_m * math.sin(pitch_rad), -self._height_m * math.sin(roll_rad)

    def lean(self, frame: UInt8Array, pitch_rad: float, roll_rad: float) -> UInt8Array:
        """Return a frame (H, W, 3) uint8 as the leaning camera takes it; itself where it is as good as upright.

        Parameters
        ----------
        pitch_rad, roll_rad : float
            Nose up and right side down are positive.
        """
        if max(abs(pitch_rad), abs(roll_rad)) < _MIN_RAD:
            return frame
        cv2.scaleAdd(self._by_pitch, pitch_rad, self._upright, self._source)
        cv2.scaleAdd(self._by_roll, roll_rad, self._source, self._source)
        # OpenCV is fastest at whole pixels and their fractions
        whole, parts = cv2.convertMaps(self._source, _NO_MAP, cv2.CV_16SC2)
        moved = cv2.remap(frame, whole, parts, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(moved, dtype=np.uint8)


def _derivative(
    camera: OmniCamera, rays: FloatArray, shows: npt.NDArray[np.bool_], lean: tuple[float, float]
) -> npt.NDArray[np.float32]:
    """Return how far the source of each pixel moves a radian (H, W, 2) float32, by differences to either side."""
    pixels = []
    for sign in (1.0, -1.0):
        turned = rays @ camera_rotation(0.0, sign * lean[0], sign * lean[1]).T
        with np.errstate(invalid="ignore"):
            pixels.append(camera.ray_to_pixel(turned))
    per_rad = (pixels[0] - pixels[1]) / (2 * _STEP_RAD)
    return np.where(shows[..., None] & np.isfinite(per_rad), per_rad, 0.0).astype(np.float32)
