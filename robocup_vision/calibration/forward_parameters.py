"""A forward camera as a vector of parameters for a fit: mounting, lens, and the width of painted lines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera

# indices: tilt, roll (rad), height (m), logarithm of the focal length's scale, centre (px), logarithm of the painted
# lines' width relative to the field file; then the first coefficients of the distortion
TILT, ROLL, HEIGHT, LOG_FOCAL, LINE_WIDTH = 0, 1, 2, 3, 6
CENTER = slice(4, 6)
LENS = 7
# step of the numerical derivatives, in each parameter's unit
_STEP = 1e-4
# standard deviations of a start before any picture: of tilt and roll, of the height, of the logarithm of the focal
# length, and of that of the painted lines' width, which is the tolerance of tape measures and painting
_ANGLE_STD_RAD, _HEIGHT_STD_M, _LOG_FOCAL_STD, _LOG_LINE_WIDTH_STD = 0.1, 0.1, 0.15, 0.05
# those of each coordinate of the centre, relative to the picture's width, for a pinhole camera and a fisheye: a
# fisheye's is the tolerance of lenses on sensors; a pinhole camera's is smaller, because its centre and tilt are hardly
# separable
_CENTER_STD_RATIO, _FISHEYE_CENTER_STD_RATIO = 0.005, 0.02
# those of the first two coefficients of the distortion: the range of common lenses
_COEFFICIENTS_STD, _FISHEYE_COEFFICIENTS_STD = (0.2, 0.2), (0.05, 0.02)


class ForwardParameters:
    """Converts cameras to vectors and back.

    Parameters
    ----------
    start : PinholeCamera
        Provides all that is not in the vector. Its tilt is known.
    bends : bool
        Whether the distortion is fitted; otherwise it is the start's.
    """

    def __init__(self, start: PinholeCamera, *, bends: bool = True) -> None:
        self.start = start
        is_free = bends and (not isinstance(start, FisheyeCamera) or start.projection == "kannala_brandt")
        self.coefficients = len(_COEFFICIENTS_STD) if is_free else 0
        if is_free and not start.distortion:
            self.start = replace(start, distortion=(0.0,) * 4)

    @property
    def start_std(self) -> FloatArray:
        """(G,) float64: standard deviations of a start."""
        ratio, of_lens = _CENTER_STD_RATIO, _COEFFICIENTS_STD
        if isinstance(self.start, FisheyeCamera):
            ratio, of_lens = _FISHEYE_CENTER_STD_RATIO, _FISHEYE_COEFFICIENTS_STD
        mounting = _ANGLE_STD_RAD, _ANGLE_STD_RAD, _HEIGHT_STD_M
        center = (ratio * self.start.size_px[0],) * 2
        return np.array([*mounting, _LOG_FOCAL_STD, *center, _LOG_LINE_WIDTH_STD, *of_lens[: self.coefficients]])

    def vector(self, camera: PinholeCamera) -> FloatArray:
        """Return the vector (G,) of a camera, with lines as wide as the field file says."""
        log_focal = math.log(camera.focal_px[0] / self.start.focal_px[0])
        lens = (*camera.distortion, 0.0, 0.0)[: self.coefficients]
        mounting = camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m
        return np.array([*mounting, log_focal, *camera.center_px, 0.0, *lens])

    def camera(self, vector: FloatArray) -> PinholeCamera:
        """Return the camera of a vector (G,), in which line width and lens may be missing."""
        tilt, roll, height, log_focal, u, v = vector[:LINE_WIDTH].tolist()
        scale, start, lens = math.exp(log_focal), self.start, vector[LENS:].tolist()
        return replace(
            start,
            focal_px=(start.focal_px[0] * scale, start.focal_px[1] * scale),
            center_px=(u, v),
            distortion=(*lens, *start.distortion[len(lens) :]),
            height_m=height,
            tilt_rad=tilt,
            roll_rad=roll,
        )

    def by_coefficients(self, camera: PinholeCamera, pixels: FloatArray, normal: FloatArray) -> FloatArray:
        """Return derivatives (N, C) of pixels (N, 2) along normals (N, 2) by the coefficients of the distortion.

        They are 0 for pixels without a ray.
        """
        rays = camera.pixel_to_camera_ray(pixels)
        at = camera.camera_ray_to_pixel(rays)
        columns = []
        for place in range(self.coefficients):
            lens = np.array(camera.distortion)
            lens[place] += _STEP
            moved = replace(camera, distortion=tuple(lens.tolist())).camera_ray_to_pixel(rays)
            columns.append(((moved - at) * normal).sum(axis=1) / _STEP)
        return np.asarray(np.nan_to_num(np.array(columns).reshape(self.coefficients, len(pixels)).T))
