"""Renders a scene for a pinhole camera, ray by ray, as linear light before the sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.kernels.ray_casting import pinhole_patches
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.goal.surroundings import Glare, SunPatch
from sim2d.rendering.light import TracedLight, lay_nets, trace_light
from sim2d.rendering.rays import RaySet, sample_offsets
from sim2d.rendering.scene import Scene

COARSE = 2  # rays for each pixel along each axis, before edges are known
RAYS_AT_ONCE = 1 << 14  # fits into the processor's cache
EDGE_CONTRAST = 8.0  # least difference of neighbouring rays, grey levels, that counts as an edge


class PinholeRays(RaySet):
    """Rays of some pixels of a pinhole camera.

    Parameters
    ----------
    camera : PinholeCamera
        Must have a known tilt.
    supersample : int
        Rays for each pixel along each image axis.
    pixel_index : (P,) intp, optional
        Flat indices of the pixels; all by default.
    turn_rad : float
        Pan of the camera from the first row to the last (a rolling shutter); the camera's own pan is that of the middle
        row.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        supersample: int,
        pixel_index: npt.NDArray[np.intp] | None = None,
        turn_rad: float = 0.0,
    ) -> None:
        width, height = camera.size_px
        index = np.arange(width * height) if pixel_index is None else pixel_index
        centers = np.stack([index % width, index // width], axis=-1)
        offsets = sample_offsets(supersample)
        directions = np.empty((len(index), len(offsets), 3))
        radial, tangential = np.empty((2, *directions.shape[:2]))
        rays_per_rad = math.sqrt(camera.focal_px[0] * camera.focal_px[1]) * supersample
        step = max(1, RAYS_AT_ONCE // len(offsets))
        is_fisheye = isinstance(camera, FisheyeCamera)
        for start in range(0, len(index), step):
            part = slice(start, start + step)
            along_axis = camera.pixel_to_camera_ray(centers[part, None, :] + offsets)
            if is_fisheye:
                # pixels outside the lens circle become black, so any ray will do
                along_axis[np.isnan(along_axis[..., 0])] = (1.0, 0.0, 0.0)
            turned = np.matmul(along_axis, camera.camera_to_robot.T, out=directions[part])
            if turn_rad:
                turn = turn_rad * (centers[part, 1] / (height - 1) - 0.5)
                c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
                x, y = turned[..., 0].copy(), turned[..., 1].copy()
                turned[..., 0], turned[..., 1] = c * x - s * y, s * x + c * y
            patches = radial[part], tangential[part]
            # a fisheye's projection is nearly equidistant
            cosine = np.ones(along_axis.shape[:-1]) if is_fisheye else along_axis[..., 0]
            pinhole_patches(camera.height_m, rays_per_rad, cosine, turned, *patches)
        super().__init__(camera.height_m, index, directions, radial, tangential)


def render_pinhole(
    camera: PinholeCamera,
    scene: Scene,
    pose: Pose2,
    *,
    backdrop: Backdrop | None = None,
    glare: Sequence[Glare] = (),
    sun: Sequence[SunPatch] = (),
    supersample: int = 8,
    turn_rad: float = 0.0,
) -> Float32Array:
    """Render a frame; each pixel is the mean over its area.

    Parameters
    ----------
    camera : PinholeCamera
        Camera with its present orientation: its tilt must be known, an unknown pan or roll is 0.
    pose : Pose2
        Pose of the robot in the field frame (equal to the camera's if its offset and pan are 0).
    backdrop : Backdrop, optional
        Replaces the scene's clutter on the room's wall.
    glare : sequence of Glare
        Reflections of lamps in the goals' paint.
    sun : sequence of SunPatch
        Sunlight through windows.
    supersample : int
        Rays along each axis of a pixel that may contain an edge; others get fewer.
    turn_rad : float
        Pan of the camera from its first row to its last (a rolling shutter).

    Returns
    -------
    (H, W, 3) float32
        Linear light, BGR; the sensor saturates at 255, higher values are possible.

    Raises
    ------
    ArgumentError
        If the camera's tilt is unknown, its lens folds back in the image, or `supersample` is too small.
    """
    if supersample < COARSE:
        raise ArgumentError(f"supersample must be at least {COARSE}, got {supersample}")
    width, height = camera.size_px
    x, y = pose.transform(camera.offset_m)
    eye = Pose2(float(x), float(y), pose.theta_rad)

    def trace(rays: RaySet) -> TracedLight:
        traced = trace_light(rays, scene, eye)
        if backdrop is not None:
            wall = traced.in_room
            colors = backdrop.colors(traced.x_m[wall], traced.y_m[wall], traced.z_m[wall])
            traced.light[wall] = colors * scene.light.level
        for patch in sun:
            patch.shine_on(traced)
        for spot in glare:
            for goal in scene.field.goals:
                if goal.side == spot.goal_side and goal.kind == "posts":
                    spot.add_to(traced, goal)
        lay_nets(traced, scene)
        return traced

    coarse_rays = PinholeRays(camera, COARSE, turn_rad=turn_rad)
    if not np.isfinite(coarse_rays.slope).all():
        raise ArgumentError("the camera's lens distortion leaves part of the image without rays")
    coarse = trace(coarse_rays)
    image = np.empty((height * width, 3), dtype=np.float32)
    image[coarse_rays.pixel_index] = coarse.per_pixel
    edges = _pixels_at_edges(coarse, (height, width))
    if supersample > COARSE and len(edges):
        fine_rays = PinholeRays(camera, supersample, edges, turn_rad)
        image[fine_rays.pixel_index] = trace(fine_rays).per_pixel
    image[dark_pixels(camera).ravel()] = 0.0
    return image.reshape(height, width, 3)


def dark_pixels(camera: PinholeCamera) -> npt.NDArray[np.bool_]:
    """Return a mask (H, W) of the pixels that the lens leaves dark."""
    width, height = camera.size_px
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    return np.asarray(np.isnan(camera.pixel_to_camera_ray(np.stack([u, v], axis=-1))).any(axis=-1))


def _pixels_at_edges(traced: TracedLight, shape: tuple[int, int]) -> npt.NDArray[np.intp]:
    """Return flat indices of pixels whose rays, or neighbours' rays, differ in surface or brightness."""
    rays = traced.rays
    count = rays.samples
    surface = traced.surface.astype(np.float32)
    surface[traced.in_room] = -1.0
    # the room's wall is already blurred, so it has no edges
    light = traced.light.copy()
    light[traced.in_room] = 0.0
    features = np.column_stack([light, surface * np.float32(2 * EDGE_CONTRAST)]).reshape(-1, count, 4)
    of_ray = [features[:, k] for k in range(count)]
    high, low = (np.empty((shape[0] * shape[1], 4), dtype=np.float32) for _ in range(2))
    high[rays.pixel_index], low[rays.pixel_index] = np.maximum.reduce(of_ray), np.minimum.reduce(of_ray)
    around = np.ones((3, 3), dtype=np.uint8)
    spread = cv2.dilate(high.reshape(*shape, 4), around) - cv2.erode(low.reshape(*shape, 4), around)
    return np.flatnonzero((spread > EDGE_CONTRAST).any(axis=2))


def smear(image: Float32Array, length_px: float) -> Float32Array:
    """Blur an image along its rows by a pan of `length_px` pixels during the exposure."""
    if length_px <= 0:
        return image
    # a mixture of the two nearest boxes of odd length, with exactly the motion's variance
    inner = 2 * int((math.sqrt(length_px**2 + 1) - 1) / 2) + 1
    inner_ratio = (length_px**2 - (inner**2 - 1)) / ((inner + 2) ** 2 - inner**2)
    kernel = np.full(inner + 2, inner_ratio / (inner + 2))
    kernel[1:-1] += (1 - inner_ratio) / inner
    return np.asarray(cv2.filter2D(image, -1, kernel[None, :], borderType=cv2.BORDER_REPLICATE))
