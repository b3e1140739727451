"""Computes the light along each ray: paint, shade, lamps and the room behind, the same for every camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import Float32Array
from robocup_vision.geometry import Pose2
from sim2d.rendering.backdrop import ROOM_HEIGHT_M, ROOM_ROWS_PER_M, room_panorama
from sim2d.rendering.paint import LinePaint
from sim2d.rendering.rays import RaySet
from sim2d.rendering.scene import SHADE_REACH, Ball, Light, Scene
from sim2d.rendering.surfaces import FLOOR, FirstHits

SMOOTH_TEXTURE_M, FINE_TEXTURE_M = 0.15, 0.012  # cells of the carpet's two noises


@dataclass(frozen=True, eq=False)
class TracedLight:
    """The light of N rays."""

    #: (N, 3) float32: BGR; 255 is a sensor's white, more is possible.
    light: Float32Array
    #: The surfaces they met.
    hits: FirstHits
    #: (N,) float32: where, field frame, metres.
    x_m: Float32Array
    y_m: Float32Array
    #: (M,) intp: those that ended on the room's wall.
    in_room: npt.NDArray[np.intp]

    @property
    def per_pixel(self) -> Float32Array:
        """(P, 3) float32: mean light of each pixel's rays."""
        samples = self.light.reshape(-1, self.hits.rays.samples, 3)
        total = samples[:, 0].copy()
        for k in range(1, samples.shape[1]):  # many times faster than a mean over so short an axis
            total += samples[:, k]
        return np.asarray(total / np.float32(samples.shape[1]))


def trace_light(rays: RaySet, scene: Scene, eye: Pose2) -> TracedLight:
    """Follow rays into a scene.

    Parameters
    ----------
    rays : RaySet
        In the robot's frame.
    eye : Pose2
        The viewpoint's place and the robot's heading, field frame.
    """
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
    where, covered_ratio = _line_paint(scene.field).coverage(
        hit_x[floor], hit_y[floor], cos[floor], sin[floor], rays.radial_m[floor], rays.tangential_m[floor]
    )
    painted = floor[where]
    step = np.subtract(COLOR_NAMES[scene.field.line_color], COLOR_NAMES["green"]).astype(np.float32)
    light[painted] += covered_ratio[:, None] * step
    if scene.light.texture and len(floor):
        patch = np.maximum(rays.radial_m[floor], rays.tangential_m[floor])
        light[floor] *= _carpet_texture(scene.light, hit_x[floor], hit_y[floor], patch)[:, None]
    if scene.ball is not None:
        _shade_under_ball(light, hits, scene.ball, eye)
    illuminate(light, hits.shade, scene, hit_x, hit_y)
    light[in_room] = room_light
    return TracedLight(light, hits, hit_x, hit_y, in_room)


@lru_cache(maxsize=16)
def _line_paint(field: Field) -> LinePaint:
    return LinePaint(field)


def _room_light(
    scene: Scene, hits: FirstHits, cos: Float32Array, sin: Float32Array
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float32]]:
    """Rays that end on the room's round wall, and the light from there; their distances are set."""
    radius = scene.room_radius_m
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
    row = np.clip(up, 0, ROOM_HEIGHT_M - 0.01) * np.float32(ROOM_ROWS_PER_M)
    turn = np.arctan2(distance * sin[far] + y, distance * cos[far] + x) * np.float32(columns / math.tau)
    light = panorama[row.astype(np.intp), turn.astype(np.intp) % columns]
    return far, np.asarray(light * np.float32(scene.light.level))


def _carpet_texture(light: Light, x: Float32Array, y: Float32Array, patch_m: Float32Array) -> Float32Array:
    """Relative brightness of carpet at floor points: two octaves of value noise, the fine one averaged over a patch."""
    rng = np.random.default_rng([light.texture_seed, 0xCA57])
    tiles = rng.standard_normal((2, 256, 256), dtype=np.float32)
    smooth = _noise(tiles[0], x, y, SMOOTH_TEXTURE_M)
    fine = _noise(tiles[1], x, y, FINE_TEXTURE_M) * np.minimum(1, np.float32(FINE_TEXTURE_M) / patch_m)
    # bilinear interpolation keeps 4/9 of the variance
    return np.asarray(1 + np.float32(light.texture * math.sqrt(0.5) * 1.5) * (smooth + fine))


def _noise(tile: Float32Array, x: Float32Array, y: Float32Array, cell_m: float) -> Float32Array:
    width = 1024  # OpenCV's maps may not be longer than 32767 along one side
    padding = -len(x) % width
    maps: list[Float32Array] = []
    for v in (x, y):
        cells = np.pad(v, (0, padding)) * np.float32(1 / cell_m)
        # the remainder, bit for bit because the size is a power of 2, and many times faster than np.mod
        cells -= np.floor(cells * np.float32(1 / tile.shape[0])) * np.float32(tile.shape[0])
        maps.append(cells.reshape(-1, width))
    found = cv2.remap(tile, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(found.ravel()[: len(x)])


def _shade_under_ball(light: Float32Array, hits: FirstHits, ball: Ball, eye: Pose2) -> None:
    """Darken the floor around a ball's foot, softly."""
    x, y = eye.inverse().transform([ball.x_m, ball.y_m])
    reach = SHADE_REACH * ball.radius_m
    away = math.hypot(x, y)
    half = math.asin(reach / away) if away > reach else math.pi
    bearing = math.atan2(y, x)
    for part in hits.rays.window(bearing - half, bearing + half):
        dx = hits.distance_m[part] * hits.rays.cos[part] - np.float32(x)
        dy = hits.distance_m[part] * hits.rays.sin[part] - np.float32(y)
        gone = np.float32(0.55) * np.exp(-(dx * dx + dy * dy) * np.float32(1 / ball.radius_m**2))
        gone[hits.surface[part] != FLOOR] = 0
        light[part] *= (1 - gone)[:, None]


def illuminate(light: Float32Array, shade: Float32Array, scene: Scene, x: Float32Array, y: Float32Array) -> None:
    """Turn paint (N, 3) of given shade (N,) at places x, y (m) into light, in place."""
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
