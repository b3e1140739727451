"""Renders a scene for a mirror camera, ray by ray, as linear light before the sensor."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from robocup_vision.arrays import Float32Array
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.light import lay_nets, trace_light
from sim2d.rendering.rays import MirrorRays
from sim2d.rendering.scene import Scene

BODY_BGR = (30.0, 28.0, 28.0)
SPIN_POSES = 5


class MirrorRenderer:
    """Renders pictures of one camera.

    Parameters
    ----------
    camera : OmniCamera
        The true camera, with a known viewpoint height.
    supersample : int
        Rays for each pixel along each image axis.

    Raises
    ------
    ArgumentError
        If the viewpoint's height is unknown or `supersample` is not positive.
    """

    def __init__(self, camera: OmniCamera, supersample: int = 3) -> None:
        self.camera = camera
        self._rays = MirrorRays(camera, supersample)

    @cached_property
    def _coarse_rays(self) -> MirrorRays:
        return MirrorRays(self.camera, 2)

    def render(self, scene: Scene, pose: Pose2, *, spin_rad: float = 0.0) -> Float32Array:
        """Render a frame.

        Parameters
        ----------
        pose : Pose2
            Pose of the robot in the field frame, in the middle of the exposure.
        spin_rad : float
            Rotation of the robot during the exposure.

        Returns
        -------
        (H, W, 3) float32
            Linear light, BGR; the sensor saturates at 255, higher values are possible.
        """
        rays, count = (self._coarse_rays, SPIN_POSES) if spin_rad else (self._rays, 1)
        height, width = rays.traced_part.shape
        traced = np.zeros((len(rays.pixel_index), 3), dtype=np.float32)
        for fraction in (np.arange(count) + 0.5) / count - 0.5:
            traced += self._trace(rays, scene, Pose2(pose.x_m, pose.y_m, pose.theta_rad + fraction * spin_rad))
        image = rays.body_part[..., None] * np.array(BODY_BGR, dtype=np.float32)
        flat = image.reshape(height * width, 3)
        flat[rays.pixel_index] += traced / np.float32(count) * rays.traced_part.reshape(-1, 1)[rays.pixel_index]
        return np.asarray(image)

    def _trace(self, rays: MirrorRays, scene: Scene, pose: Pose2) -> Float32Array:
        """Return the mean light (P, 3) float32 of each traced pixel's rays."""
        x, y = pose.transform(self.camera.offset_m)
        traced = trace_light(rays, scene, Pose2(float(x), float(y), pose.theta_rad))
        lay_nets(traced, scene)
        return traced.per_pixel
