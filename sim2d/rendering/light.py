"""Computes the light along the rays of any camera: paint, shade, lamps, the room behind the field, and nets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES
from robocup_vision.arrays import Float32Array, Int32Array
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from sim2d.kernels.floor_paint import SHADE_REACH
from sim2d.kernels.ray_casting import MAX_FLOOR_M, cross_net, first_things, paint_floor
from sim2d.kernels.things import rows_from_eye
from sim2d.rendering.backdrop import ROOM_HEIGHT_M, ROOM_ROWS_PER_M, room_panorama, sample_at
from sim2d.rendering.rays import RaySet
from sim2d.rendering.scene import GROUND_BGR, LAMP_DIRECTION_RAD, Light, Scene
from sim2d.rendering.scene_table import ThingTable, floor_paint, nets_of

# surface numbers of the carpet and of the ground around it
FLOOR, GROUND = range(2)
SMOOTH_TEXTURE_M, FINE_TEXTURE_M = 0.15, 0.012  # cell sizes of the two noises of the carpet's texture
_LAMP = np.array([math.cos(LAMP_DIRECTION_RAD), math.sin(LAMP_DIRECTION_RAD)], dtype=np.float32)


@dataclass(frozen=True, eq=False)
class TracedLight:
    """The light of N rays, and the surfaces they meet."""

    #: The rays; position of the viewpoint and heading of the robot, field frame.
    rays: RaySet
    eye: Pose2
    #: (3, N) float32: horizontal directions and slopes of the rays, field axes.
    directions: Float32Array
    #: (N,) float32: horizontal length of the rays, metres.
    distance_m: Float32Array
    #: (N,) int32: `FLOOR`, `GROUND` or an object's colour.
    surface: Int32Array
    #: (M,) intp: rays that end on the room's wall.
    in_room: npt.NDArray[np.intp]
    #: (N, 3) float32: BGR; 255 is a sensor's white, higher values are possible.
    light: Float32Array

    @property
    def x_m(self) -> Float32Array:
        """(N,) float32: x of the ends, field frame, metres."""
        return np.asarray(self.distance_m * self.directions[0] + np.float32(self.eye.x_m))

    @property
    def y_m(self) -> Float32Array:
        """(N,) float32: y of the ends, field frame, metres."""
        return np.asarray(self.distance_m * self.directions[1] + np.float32(self.eye.y_m))

    @property
    def z_m(self) -> Float32Array:
        """(N,) float32: height of the ends, metres."""
        return np.asarray(self.distance_m * self.rays.slope + np.float32(self.rays.height_m))

    @property
    def per_pixel(self) -> Float32Array:
        """(P, 3) float32: mean light of each pixel's rays."""
        samples = self.light.reshape(-1, self.rays.samples, 3)
        total = samples[:, 0].copy()
        for k in range(1, samples.shape[1]):  # much faster than a mean over a short axis
            total += samples[:, k]
        return np.asarray(total / np.float32(samples.shape[1]))


def trace_light(rays: RaySet, scene: Scene, eye: Pose2) -> TracedLight:
    """Trace rays into a scene.

    Parameters
    ----------
    rays : RaySet
        Rays in the robot's frame.
    eye : Pose2
        Position of the viewpoint and heading of the robot, field frame.
    """
    prepare("pictures", "sim2d")
    c, s = np.float32(math.cos(eye.theta_rad)), np.float32(math.sin(eye.theta_rad))
    directions = np.stack([rays.cos * c - rays.sin * s, rays.cos * s + rays.sin * c, rays.slope])
    things = ThingTable((*scene.fixed(), *scene.robots, *(() if scene.ball is None else (scene.ball,))), GROUND + 1)
    distance_m, surface = rays.floor_m.copy(), np.full(len(rays.cos), FLOOR, dtype=np.int32)
    shade = np.ones(len(surface), dtype=np.float32)
    rows = rows_from_eye(things.values, float(eye.x_m), float(eye.y_m))
    first_things(rows, directions, np.float32(rays.height_m), _LAMP, distance_m, surface, shade)
    in_room, room_light = _room_light(scene, eye, rays.height_m, directions, distance_m)
    traced = TracedLight(rays, eye, directions, distance_m, surface, in_room, np.empty((len(surface), 3), np.float32))

    floor, covered = _paint(traced, scene)
    colors = np.array([COLOR_NAMES["green"], GROUND_BGR, *things.colors], dtype=np.float32)
    light = np.take(colors, surface, axis=0, out=traced.light)
    step = np.subtract(COLOR_NAMES[scene.field.line_color], COLOR_NAMES["green"]).astype(np.float32)
    painted = np.flatnonzero(covered)
    light[floor[painted]] += covered[painted, None] * step
    x_m, y_m = traced.x_m[floor], traced.y_m[floor]
    if scene.light.texture:
        light[floor] *= _carpet_texture(scene.light, x_m, y_m, rays.patch_m[:, floor].max(axis=0))[:, None]
    if scene.ball is not None:
        away2 = (x_m - np.float32(scene.ball.x_m)) ** 2 + (y_m - np.float32(scene.ball.y_m)) ** 2
        near = np.flatnonzero(away2 < np.float32((SHADE_REACH * scene.ball.radius_m) ** 2))
        gone = np.float32(0.55) * np.exp(-away2[near] * np.float32(1 / scene.ball.radius_m**2))
        light[floor[near]] *= (1 - gone)[:, None]
    illuminate(light, shade, scene, traced.x_m, traced.y_m)
    light[in_room] = room_light
    return traced


def _paint(traced: TracedLight, scene: Scene) -> tuple[npt.NDArray[np.intp], Float32Array]:
    """Return the rays that end on the carpet and the painted fraction of each; set the surface of those on ground."""
    on_floor = traced.surface == FLOOR
    on_floor[traced.in_room] = False
    floor = np.flatnonzero(on_floor)
    places, directions = np.stack([traced.x_m[floor], traced.y_m[floor]]), traced.directions[:2, floor]
    covered, on_carpet = np.empty(len(floor), dtype=np.float32), np.empty(len(floor), dtype=np.bool_)
    paint_floor(floor_paint(scene), places, directions, traced.rays.patch_m[:, floor], covered, on_carpet)
    traced.surface[floor[~on_carpet]] = GROUND
    return floor[on_carpet], covered[on_carpet]


def _room_light(
    scene: Scene, eye: Pose2, height_m: float, directions: Float32Array, distance_m: Float32Array
) -> tuple[npt.NDArray[np.intp], Float32Array]:
    """Return the rays that end on the room's round wall, and their light; set their distances."""
    radius, away = scene.room_radius_m, math.hypot(eye.x_m, eye.y_m)
    far = np.flatnonzero(distance_m > max(radius - away, 0.0))
    x, y = np.float32(eye.x_m), np.float32(eye.y_m)
    cos, sin, slope = directions[:, far]
    toward = -(cos * x + sin * y)
    distance = toward + np.sqrt(np.maximum(toward**2 + np.float32(radius**2 - away**2), 0))
    behind = distance < distance_m[far]
    far, distance, cos, sin, slope = (values[behind] for values in (far, distance, cos, sin, slope))
    distance_m[far] = distance
    panorama = room_panorama(scene.room.seed)
    columns = panorama.shape[1]
    row = np.clip(height_m + distance * slope, 0, ROOM_HEIGHT_M - 0.01) * np.float32(ROOM_ROWS_PER_M)
    turn = np.arctan2(distance * sin + y, distance * cos + x) * np.float32(columns / math.tau)
    light = panorama[row.astype(np.intp), turn.astype(np.intp) % columns]
    return far, np.asarray(light * np.float32(scene.light.level))


def _carpet_texture(light: Light, x: Float32Array, y: Float32Array, patch_m: Float32Array) -> Float32Array:
    """Return the relative brightness of carpet: two octaves of value noise, the fine one averaged over a patch."""
    rng = np.random.default_rng([light.texture_seed, 0xCA57])
    tiles = rng.standard_normal((2, 256, 256), dtype=np.float32)
    smooth = _noise(tiles[0], x, y, SMOOTH_TEXTURE_M)
    fine = _noise(tiles[1], x, y, FINE_TEXTURE_M) * np.minimum(1, np.float32(FINE_TEXTURE_M) / patch_m)
    # bilinear interpolation keeps 4/9 of the variance
    return np.asarray(1 + np.float32(light.texture * math.sqrt(0.5) * 1.5) * (smooth + fine))


def _noise(tile: Float32Array, x: Float32Array, y: Float32Array, cell_m: float) -> Float32Array:
    cells = np.stack([x, y]) * np.float32(1 / cell_m)
    # the remainder; exact because the size is a power of 2, and much faster than np.mod
    cells -= np.floor(cells * np.float32(1 / tile.shape[0])) * np.float32(tile.shape[0])
    return sample_at(tile, cells[0], cells[1], cv2.BORDER_WRAP)


def illuminate(light: Float32Array, shade: Float32Array, scene: Scene, x: Float32Array, y: Float32Array) -> None:
    """Convert paint (N, 3) with shade (N,) at places x, y (m) to light, in place."""
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


def lay_nets(traced: TracedLight, scene: Scene) -> None:
    """Mix the light of nets into rays that cross them, in place.

    A net covers the fraction of a ray's patch that is cord. With cords of width d and meshes of width s that is
    1 - (1 - d / s)^2 if a patch is wider than many meshes; nearer cords are drawn as lines. The order of two nets on a
    ray does not matter, because their cords have the same colour and nearly the same light.
    """
    rays, nets = traced.rays, nets_of(scene.field)
    if not len(nets.rows):
        return
    eye_m = np.array([traced.eye.x_m, traced.eye.y_m, rays.height_m], dtype=np.float32)
    floor_m = np.minimum(rays.floor_m, np.float32(MAX_FLOOR_M))
    radial_m, tangential_m = rays.patch_m
    steps = np.stack([tangential_m / floor_m, radial_m * np.float32(rays.height_m) / floor_m**2])
    distance_m, covered = np.empty((2, len(floor_m)), dtype=np.float32)
    for which in range(len(nets.rows)):
        cross_net(nets, which, eye_m, traced.directions, steps, distance_m, covered)
        met = np.flatnonzero((covered > 0) & (distance_m < traced.distance_m))
        x, y = (eye_m[k] + distance_m[met] * traced.directions[k, met] for k in (0, 1))
        light = np.tile(nets.color, (len(met), 1))
        illuminate(light, np.ones(len(met), dtype=np.float32), scene, x, y)
        traced.light[met] += covered[met, None] * (light - traced.light[met])
