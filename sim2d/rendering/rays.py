"""The rays of a camera's image."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from sim2d.kernels.ray_casting import LEVEL, MIN_RUN

# width of the mirror's rim outside the usable radius, as a fraction of that radius
RIM_MARGIN = 4.0 / 112.0


class RaySet:
    """Rays of a camera in its robot's frame, `samples` for each pixel, with pixels sorted by bearing.

    A ray is a horizontal direction (cos, sin), a slope (rise over run) and a start at the viewpoint, so that the
    horizontal distance of an upright surface depends on the horizontal direction only. Of N = P * samples
    rays, samples of one pixel follow one another.

    Parameters
    ----------
    height_m : float
        Height of the viewpoint above the floor.
    pixel_index : (P,) intp
        Flat image index of each pixel.
    directions : (P, samples, 3) float64
        Directions, robot frame.
    radial_m, tangential_m : (P, samples) float64
        Size of each ray's patch on the floor, along and across the ray, metres.

    Attributes
    ----------
    pixel_index : (P,) intp
        Flat image indices, sorted by bearing.
    cos, sin, slope : (N,) float32
        Directions, robot frame.
    floor_m : (N,) float32
        Horizontal distance at which a ray meets the floor, metres; inf at and above the horizon.
    patch_m : (2, N) float32
        Radial and tangential sizes of the patches, metres.
    """

    def __init__(
        self,
        height_m: float,
        pixel_index: npt.NDArray[np.intp],
        directions: FloatArray,
        radial_m: FloatArray,
        tangential_m: FloatArray,
    ) -> None:
        self.height_m, self.samples = height_m, directions.shape[1]
        order = np.argsort(np.arctan2(directions[:, 0, 1], directions[:, 0, 0]), kind="stable")
        self.pixel_index = pixel_index[order]
        x, y, z = directions[order].reshape(-1, 3).T
        run = np.maximum(np.hypot(x, y), MIN_RUN)
        slope = z / run
        floor_m = np.full(len(slope), np.inf)
        np.divide(-height_m, slope, out=floor_m, where=slope < LEVEL)
        rows = (x / run, y / run, slope, floor_m)
        self.cos, self.sin, self.slope, self.floor_m = (row.astype(np.float32) for row in rows)
        self.patch_m = np.stack([radial_m[order].ravel(), tangential_m[order].ravel()]).astype(np.float32)


class MirrorRays(RaySet):
    """All rays of a mirror camera.

    Parameters
    ----------
    camera : OmniCamera
        Must have a known viewpoint height.

    Attributes
    ----------
    traced_part, body_part : (H, W) float32
        Fractions of each pixel that show the scene and the robot's own body; the rest is black.
    """

    def __init__(self, camera: OmniCamera, supersample: int) -> None:
        if supersample < 1:
            raise ArgumentError(f"supersample must be at least 1, got {supersample}")
        if camera.height_m is None:
            raise ArgumentError("the camera needs viewpoint_height_m: without it no upright thing can be rendered")
        samples = supersample**2
        width, height = camera.size_px
        inner, outer = camera.usable_radius_px
        rim = outer * (1 + RIM_MARGIN)
        offsets = sample_offsets(supersample)
        rows, columns = np.mgrid[:height, :width]
        centers = np.stack([columns.ravel(), rows.ravel()], axis=-1).astype(np.float64)
        radius_of_pixel = np.hypot(*(centers - camera.center_px).T)
        candidates = np.flatnonzero((radius_of_pixel < rim + 1) & (radius_of_pixel > inner - 1))
        points = centers[candidates, None, :] + offsets
        radius = np.hypot(points[..., 0] - camera.center_px[0], points[..., 1] - camera.center_px[1])
        with np.errstate(invalid="ignore"):
            ray = camera.pixel_to_ray(points)
        seen = (radius >= inner) & (radius <= rim) & np.isfinite(ray).all(axis=-1)

        self.traced_part = np.zeros((height, width), dtype=np.float32)
        self.traced_part.ravel()[candidates] = seen.mean(axis=1)
        self.body_part = (radius_of_pixel <= inner).astype(np.float32).reshape(height, width)
        self.body_part.ravel()[candidates] = (radius < inner).mean(axis=1)

        # unseen rays of a partly seen pixel are replaced by one of its seen rays
        stand_in = np.where(seen, np.arange(samples), np.argmax(seen, axis=1)[:, None])
        ray = np.take_along_axis(ray, stand_in[..., None], axis=1)
        radius = np.take_along_axis(radius, stand_in, axis=1)
        traced = seen.any(axis=1)
        candidates, ray, radius = candidates[traced], ray[traced], radius[traced]

        slope = ray[..., 2] / np.maximum(np.hypot(ray[..., 0], ray[..., 1]), 1e-9)
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = np.where(slope < -1e-7, camera.height_m / -slope, np.inf)
            curve = camera.floor_range.inverse_range_per_m
            per_px = np.abs(curve(radius + 0.05) - curve(radius - 0.05)) * 10
            radial = np.minimum(np.nan_to_num(per_px, nan=0.0) * np.minimum(floor, 1e3) ** 2, 1e3) / supersample
        tangential = np.minimum(floor, 1e3) / radius / supersample
        super().__init__(camera.height_m, candidates, ray, radial, tangential)


def sample_offsets(supersample: int) -> FloatArray:
    """Return offsets (n^2, 2): a grid sheared both ways, so that all samples differ in u and in v.

    An edge along a pixel row or column then changes the mean in n^2 steps, not in n. A half turn maps the grid onto
    itself.
    """
    n = supersample
    a, b = (index.ravel() for index in np.mgrid[:n, :n])
    u = (a + (b + 0.5) / n) / n
    v = (b + (n - 1 - a + 0.5) / n) / n
    return np.stack([u, v], axis=-1) - 0.5
