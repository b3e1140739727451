"""The mirror camera's picture of a scene, ray by ray, as linear light before the sensor."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from robocup_vision.arrays import Float32Array
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.light import trace_light
from sim2d.rendering.nets import lay_nets
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
            Linear light, BGR; 255 is a sensor's white, higher values are possible.
        """
        if not spin_rad:
            return self._image(self._rays, self._trace(self._rays, scene, pose))
        rays = self._coarse_rays
        fractions = (np.arange(SPIN_POSES) + 0.5) / SPIN_POSES - 0.5
        poses = [Pose2(pose.x_m, pose.y_m, pose.theta_rad + fraction * spin_rad) for fraction in fractions]
        total = self._trace(rays, scene, poses[0])
        for turned in poses[1:]:
            total += self._trace(rays, scene, turned)
        return self._image(rays, total / np.float32(SPIN_POSES))

    def _image(self, rays: MirrorRays, traced: Float32Array) -> Float32Array:
        height, width = rays.traced_part.shape
        image = rays.body_part[..., None] * np.array(BODY_BGR, dtype=np.float32)
        flat = image.reshape(height * width, 3)
        flat[rays.pixel_index] += traced * rays.traced_part.reshape(-1, 1)[rays.pixel_index]
        return np.asarray(image)

    def _trace(self, rays: MirrorRays, scene: Scene, pose: Pose2) -> Float32Array:
        """Return the mean light (P, 3) float32 of each traced pixel's rays."""
        x, y = pose.transform(self.camera.offset_m)
        traced = trace_light(rays, scene, Pose2(float(x), float(y), pose.theta_rad))
        lay_nets(traced, scene)
        return traced.per_pixel
