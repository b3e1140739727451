"""The mirror camera's picture of a scene, ray by ray, as linear light before the sensor sees it."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.paint import LinePaint
from sim2d.rendering.rays import Floats, RaySet
from sim2d.rendering.room import HEIGHT_M, ROWS_PER_M, room_panorama
from sim2d.rendering.scene import Ball, Light, Scene
from sim2d.rendering.surfaces import FLOOR, FirstHits

BODY_BGR = (30.0, 28.0, 28.0)
SPIN_POSES = 5
SMOOTH_TEXTURE_M, FINE_TEXTURE_M = 0.15, 0.012  # cells of the carpet's two noises


class MirrorRenderer:
    """Renders what one camera sees.

    Parameters
    ----------
    camera : OmniCamera
        The true camera, with a known viewpoint height.
    supersample : int
        Rays a pixel along each image axis.

    Raises
    ------
    ArgumentError
        If the viewpoint's height is unknown or `supersample` is not positive.
    """

    def __init__(self, camera: OmniCamera, supersample: int = 3) -> None:
        self.camera = camera
        self._rays = RaySet(camera, supersample)

    @cached_property
    def _coarse_rays(self) -> RaySet:
        return RaySet(self.camera, 2)

    def render(self, scene: Scene, pose: Pose2, *, spin_rad: float = 0.0) -> Floats:
        """Render a frame.

        Parameters
        ----------
        scene : Scene
            What is there.
        pose : Pose2
            The robot in the field frame; in the middle of the exposure if it spins.
        spin_rad : float
            Angle it turns by during the exposure.

        Returns
        -------
        (H, W, 3) float32
            Linear light, BGR; 255 is a sensor's white, more is possible.
        """
        if not spin_rad:
            return self._image(self._rays, self._trace(self._rays, scene, pose))
        rays = self._coarse_rays
        shares = (np.arange(SPIN_POSES) + 0.5) / SPIN_POSES - 0.5
        poses = [Pose2(pose.x_m, pose.y_m, pose.theta_rad + share * spin_rad) for share in shares]
        total = self._trace(rays, scene, poses[0])
        for turned in poses[1:]:
            total += self._trace(rays, scene, turned)
        return self._image(rays, total / np.float32(SPIN_POSES))

    def _image(self, rays: RaySet, traced: Floats) -> Floats:
        height, width = rays.traced_share.shape
        image = rays.body_share[..., None] * np.array(BODY_BGR, dtype=np.float32)
        flat = image.reshape(height * width, 3)
        flat[rays.pixel_index] += traced * rays.traced_share.reshape(-1, 1)[rays.pixel_index]
        return np.asarray(image)

    def _trace(self, rays: RaySet, scene: Scene, pose: Pose2) -> Floats:
        """(P, 3) float32: mean light of each traced pixel's rays."""
        x, y = pose.transform(self.camera.offset_m)
        eye = Pose2(float(x), float(y), pose.theta_rad)
        hits = FirstHits(rays, eye, COLOR_NAMES["green"])
        outside = hits.crosses(scene.carpet_polygon)
        hits.add_scene(scene)
        ground = hits.add_surface(scene.room.floor_bgr)
        np.copyto(hits.surface, np.uint16(ground), where=outside & (hits.surface == FLOOR))

        c, s = np.float32(math.cos(eye.theta_rad)), np.float32(math.sin(eye.theta_rad))
        cos, sin = rays.cos * c - rays.sin * s, rays.cos * s + rays.sin * c
        in_room, room_light = _room_light(scene, hits, cos, sin)
        hit_x = hits.distance_m * cos + np.float32(eye.x_m)
        hit_y = hits.distance_m * sin + np.float32(eye.y_m)

        light = np.take(np.array(hits.colors, dtype=np.float32), hits.surface, axis=0)
        floor = np.flatnonzero(hits.surface == FLOOR)
        where, share = _line_paint(scene.field).coverage(
            hit_x[floor], hit_y[floor], cos[floor], sin[floor], rays.radial_m[floor], rays.tangential_m[floor]
        )
        painted = floor[where]
        step = np.subtract(COLOR_NAMES[scene.field.line_color], COLOR_NAMES["green"]).astype(np.float32)
        light[painted] += share[:, None] * step
        if scene.light.texture:
            patch = np.maximum(rays.radial_m[floor], rays.tangential_m[floor])
            light[floor] *= _carpet_texture(scene.light, hit_x[floor], hit_y[floor], patch)[:, None]
        if scene.ball is not None:
            _shade_under_ball(light, hits, scene.ball, eye)
        _illuminate(light, hits.shade, scene, hit_x, hit_y)
        light[in_room] = room_light
        return np.asarray(light.reshape(-1, rays.samples, 3).mean(axis=1))


@lru_cache(maxsize=16)
def _line_paint(field: Field) -> LinePaint:
    return LinePaint(field)


def _room_light(
    scene: Scene, hits: FirstHits, cos: Floats, sin: Floats
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float32]]:
    """Rays that end on the room's round wall, and the light from there; their distances are set."""
    radius = float(np.hypot(*scene.carpet_polygon.T).max()) + scene.room.distance_m
    away = math.hypot(hits.eye.x_m, hits.eye.y_m)
    far = np.flatnonzero(hits.distance_m > max(radius - away, 0.0))
    x, y = np.float32(hits.eye.x_m), np.float32(hits.eye.y_m)
    toward = -(cos[far] * x + sin[far] * y)
    distance = toward + np.sqrt(np.maximum(toward**2 + np.float32(radius**2 - away**2), 0))
    behind = distance < hits.distance_m[far]
    far, distance = far[behind], distance[behind]
    hits.distance_m[far] = distance
    panorama = room_panorama(scene.room.seed)
    columns = panorama.shape[1]
    up = hits.rays.height_m + distance * hits.rays.slope[far]
    row = np.clip(up, 0, HEIGHT_M - 0.01) * np.float32(ROWS_PER_M)
    turn = np.arctan2(distance * sin[far] + y, distance * cos[far] + x) * np.float32(columns / math.tau)
    light = panorama[row.astype(np.intp), turn.astype(np.intp) % columns]
    return far, np.asarray(light * np.float32(scene.light.level))


def _carpet_texture(light: Light, x: Floats, y: Floats, patch_m: Floats) -> Floats:
    """Relative brightness of carpet at floor points: two octaves of value noise, the fine one averaged over a patch."""
    rng = np.random.default_rng([light.texture_seed, 0xCA57])
    tiles = rng.standard_normal((2, 256, 256), dtype=np.float32)
    smooth = _noise(tiles[0], x, y, SMOOTH_TEXTURE_M)
    fine = _noise(tiles[1], x, y, FINE_TEXTURE_M) * np.minimum(1, np.float32(FINE_TEXTURE_M) / patch_m)
    # bilinear interpolation keeps 4/9 of the variance
    return np.asarray(1 + np.float32(light.texture * math.sqrt(0.5) * 1.5) * (smooth + fine))


def _noise(tile: Floats, x: Floats, y: Floats, cell_m: float) -> Floats:
    width = 1024  # OpenCV's maps may not be longer than 32767 along one side
    padding = -len(x) % width
    columns, rows = (
        np.mod(np.pad(v, (0, padding)) * np.float32(1 / cell_m), tile.shape[0]).reshape(-1, width) for v in (x, y)
    )
    found = cv2.remap(tile, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(found.ravel()[: len(x)])


def _shade_under_ball(light: Floats, hits: FirstHits, ball: Ball, eye: Pose2) -> None:
    """Darken the floor around a ball's foot, softly."""
    x, y = eye.inverse().transform([ball.x_m, ball.y_m])
    reach = 3 * ball.radius_m
    away = math.hypot(x, y)
    half = math.asin(reach / away) if away > reach else math.pi
    bearing = math.atan2(y, x)
    for part in hits.rays.window(bearing - half, bearing + half):
        dx = hits.distance_m[part] * hits.rays.cos[part] - np.float32(x)
        dy = hits.distance_m[part] * hits.rays.sin[part] - np.float32(y)
        gone = np.float32(0.55) * np.exp(-(dx * dx + dy * dy) * np.float32(1 / ball.radius_m**2))
        gone[hits.surface[part] != FLOOR] = 0
        light[part] *= (1 - gone)[:, None]


def _illuminate(light: Floats, shade: Floats, scene: Scene, x: Floats, y: Floats) -> None:
    lamp = scene.light
    gain = shade * np.float32(lamp.level)
    if lamp.gradient:
        per_m = lamp.level * lamp.gradient / (scene.field.length_m / 2)
        across = x * np.float32(per_m * math.cos(lamp.gradient_direction_rad))
        across += y * np.float32(per_m * math.sin(lamp.gradient_direction_rad))
        gain *= np.maximum(1 + across / np.float32(lamp.level), np.float32(0.05))
    light *= gain[:, None]
    if lamp.shadow is not None:
        direction = lamp.shadow.direction_rad
        along = x * np.float32(math.cos(direction)) + y * np.float32(math.sin(direction))
        dark = np.flatnonzero((along >= lamp.shadow.low_m) & (along <= lamp.shadow.high_m))
        light[dark] *= np.array(lamp.shadow.factor_bgr, dtype=np.float32)
    for spot in lamp.highlights:
        dx, dy = x - np.float32(spot.x_m), y - np.float32(spot.y_m)
        squared = dx * dx + dy * dy
        near = np.flatnonzero(squared < np.float32((4 * spot.sigma_m) ** 2))
        added = np.exp(squared[near] * np.float32(-0.5 / spot.sigma_m**2)) * np.float32(spot.amplitude)
        light[near] += added[:, None]
