"""Rendering of a hall with walls, posters and furniture around a field, for a pinhole camera or a rig of three.

All surfaces are textured opaque rectangles. Field frame, metres; the hall is centred on the field.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from sim2d.kernels.panels import PanelHits, Panels, Pyramids, RayFan, first_panel, shade_panels
from sim2d.rendering.hall import textures as hall_textures
from sim2d.rendering.hall.solids import Panel, Vector, box, inward, panel_arrays
from sim2d.rendering.rays import sample_offsets

_LEVELS = 9
_NEAREST_M = 0.02
# size of the hall along x, along y, and its height
SIZE_M: Vector = (9.0, 7.0, 3.0)
# length of one turn of `loop_path`
_LOOP_M = 10.0
# numbers of posters on the walls, of shelves and cupboards in front of them, and of crates in the middle
_POSTERS, _FURNITURE, _CRATES = 44, 18, 4


@dataclass(frozen=True, slots=True)
class HallLight:
    """Light in the hall."""

    #: Factor of all light.
    level: float = 1.0
    #: Ambient light.
    ambient: float = 0.55
    #: x, y, z of each lamp, field frame, and its strength: the light on a surface that faces the lamp at 1 m.
    lamps: tuple[tuple[float, float, float, float], ...] = ((-2.2, 0.0, 2.8, 2.5), (2.2, 0.0, 2.8, 2.5))

    def __post_init__(self) -> None:
        if not self.level >= 0 or not self.ambient >= 0:
            raise ArgumentError(f"light must not be negative, got level {self.level}, ambient {self.ambient}")


@dataclass(frozen=True, eq=False)
class Hall:
    """A hall as a set of textured panels."""

    #: Walls, posters, furniture.
    panels: tuple[Panel, ...]
    #: tuple of (rows, columns, 3) uint8: BGR under light of level 1, rows from the top down.
    textures: tuple[UInt8Array, ...]

    @property
    def arrays(self) -> Panels:
        """The panels in the format of the compiled loops."""
        return panel_arrays(self.panels)

    @cached_property
    def pyramids(self) -> Pyramids:
        """All textures at all scales (mipmaps)."""
        texels: list[UInt8Array] = []
        levels = np.zeros((len(self.textures), _LEVELS, 3), dtype=np.int64)
        first = 0
        for index, texture in enumerate(self.textures):
            picture = texture.astype(np.float32)
            for level in range(_LEVELS):
                rows, columns = picture.shape[:2]
                levels[index, level] = first, rows, columns
                texels.append(np.rint(picture).astype(np.uint8).reshape(-1, 3))
                first += rows * columns
                smaller = (max(columns // 2, 1), max(rows // 2, 1))
                reduced = cv2.resize(picture, smaller, interpolation=cv2.INTER_AREA)
                picture = np.asarray(reduced, dtype=np.float32).reshape(*smaller[::-1], 3)
        return Pyramids(np.concatenate(texels), levels)

    def rearranged(self, fraction: float, rng: np.random.Generator) -> Hall:
        """Return the hall with this fraction of its posters moved along their wall or covered, alternately."""
        if not 0 <= fraction <= 1:
            raise ArgumentError(f"fraction must be within 0 to 1, got {fraction}")
        posters = [i for i, panel in enumerate(self.panels) if panel.is_poster]
        chosen = rng.permutation(posters)[: math.ceil(fraction * len(posters))]
        panels, textures = list(self.panels), list(self.textures)
        for turn, index in enumerate(chosen):
            panel = panels[index]
            if turn % 2:
                textures.append(hall_textures.sheet(rng))
                panels[index] = replace(panel, texture=len(textures) - 1)
                continue
            by_m = rng.uniform(0.25, 0.8) * rng.choice([-1.0, 1.0])
            x, y, z = (o + a * by_m for o, a in zip(panel.origin_m, panel.along, strict=True))
            panels[index] = replace(panel, origin_m=(float(x), float(y), float(z)))
        return Hall(tuple(panels), tuple(textures))


class HallBuilder:
    """A hall in construction: its panels and textures so far.

    Attributes
    ----------
    walls : list of (corner, direction, width)
        Left corner of each wall as seen from inside, direction to the right, width.
    """

    def __init__(self, size_m: Vector) -> None:
        self._length, self._depth, self._height = length, depth, _ = size_m
        self.panels: list[Panel] = []
        self._textures: list[UInt8Array] = []
        self.walls: list[tuple[Vector, Vector, float]] = [
            ((length / 2, depth / 2, 0.0), (0.0, -1.0, 0.0), depth),
            ((length / 2, -depth / 2, 0.0), (-1.0, 0.0, 0.0), length),
            ((-length / 2, -depth / 2, 0.0), (0.0, 1.0, 0.0), depth),
            ((-length / 2, depth / 2, 0.0), (1.0, 0.0, 0.0), length),
        ]

    def wear(self, texture: UInt8Array) -> int:
        """Add a texture; return its number."""
        self._textures.append(texture)
        return len(self._textures) - 1

    def add_wall(self, number: int, texture: int) -> None:
        """Add one of the walls."""
        corner, along, width = self.walls[number]
        self.panels.append(Panel(corner, along, (0.0, 0.0, 1.0), (width, self._height), texture))

    def add_floor(self, texture: int) -> None:
        """Add the floor."""
        corner = -self._length / 2, -self._depth / 2, 0.0
        self.panels.append(Panel(corner, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (self._length, self._depth), texture))

    def add_ceiling(self, texture: int) -> None:
        """Add the ceiling."""
        corner = -self._length / 2, self._depth / 2, self._height
        self.panels.append(Panel(corner, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (self._length, self._depth), texture))

    @property
    def hall(self) -> Hall:
        """The hall as built so far."""
        return Hall(tuple(self.panels), tuple(self._textures))


def make_hall(seed: int) -> Hall:
    """Build a hall; the same seed gives the same hall."""
    rng = np.random.default_rng([seed, 0x4A11])
    length, depth, height = SIZE_M
    built = HallBuilder(SIZE_M)
    panels, walls, wear = built.panels, built.walls, built.wear
    for number, (_, _, width) in enumerate(walls):
        built.add_wall(number, wear(hall_textures.wall(rng, width, height, bricks=number % 2 == 1)))
    built.add_floor(wear(hall_textures.floor(rng, length, depth, (0.6 * length, 0.515 * depth))))
    built.add_ceiling(wear(hall_textures.ceiling(rng, length, depth)))

    pictures = hall_textures.bundled_pictures()
    order = rng.permutation(len(pictures))
    widths = np.array([wall[2] for wall in walls])
    for number in range(_POSTERS):
        corner, along, width = walls[int(rng.choice(4, p=widths / widths.sum()))]
        # every third is a picture, while there are any
        is_picture = number % 3 == 0 and number // 3 < len(pictures)
        drawn = pictures[order[number // 3]] if is_picture else hall_textures.notice(rng)
        wide = float(rng.uniform(0.45, 1.3))
        high = min(wide * drawn.shape[0] / drawn.shape[1], 0.9 * height)
        start = float(rng.uniform(0.05, width - wide - 0.05))
        low = float(rng.uniform(0.15, max(height - high - 0.1, 0.16)))
        # posters overlap, so each is slightly in front of the previous one
        before = inward(along, 0.004 + 0.0005 * number)
        x, y, _ = (float(c + a * start + n) for c, a, n in zip(corner, along, before, strict=True))
        panels.append(Panel((x, y, low), along, (0.0, 0.0, 1.0), (wide, high), wear(drawn), is_poster=True))
    for _ in range(_FURNITURE):
        corner, along, width = walls[int(rng.choice(4, p=widths / widths.sum()))]
        wide, deep, high = float(rng.uniform(0.35, 1.0)), float(rng.uniform(0.25, 0.6)), float(rng.uniform(0.4, 1.7))
        middle = float(rng.uniform(wide / 2, width - wide / 2))
        standing_off = deep / 2 + float(rng.uniform(0.02, 0.35))
        off = inward(along, standing_off)
        x, y = (corner[k] + along[k] * middle + off[k] for k in range(2))
        yaw = math.atan2(along[1], along[0]) + float(rng.normal(0, 0.05))
        skins = [wear(hall_textures.shelf(rng) if high > 0.9 else hall_textures.crate(rng)) for _ in range(2)]
        panels += box(Pose2(x, y, yaw), (wide, deep, high), skins)
    for _ in range(_CRATES):
        x, y = rng.uniform(-0.14, 0.14) * length / 2, rng.uniform(-0.12, 0.12) * depth / 2
        size = tuple(float(v) for v in rng.uniform(0.18, 0.4, 3))
        skins = [wear(hall_textures.crate(rng)) for _ in range(2)]
        lies = Pose2(float(x), float(y), float(rng.uniform(0, math.pi)))
        panels += box(lies, (size[0], size[1], size[2]), skins)
    return built.hall


class HallCamera:
    """Renders a hall for one pinhole camera, whose rays are computed once.

    Parameters
    ----------
    camera : PinholeCamera
        Its tilt must be known.
    """

    def __init__(self, camera: PinholeCamera, supersample: int = 3) -> None:
        if supersample < 1:
            raise ArgumentError(f"supersample must be at least 1, got {supersample}")
        prepare("hall", "sim2d")
        self.camera = camera
        width, height = camera.size_px
        rows, columns = np.mgrid[:height, :width]
        centers = np.stack([columns, rows], axis=-1).astype(np.float64)
        rays = camera.pixel_to_camera_ray(centers[:, :, None, :] + sample_offsets(supersample))
        if not np.isfinite(rays).all():
            raise ArgumentError("the camera's lens distortion leaves part of the image without rays")
        self._directions = ((rays / rays[..., :1]) @ camera.camera_to_robot.T).astype(np.float32)
        self._ray_rad = 1.0 / (math.sqrt(camera.focal_px[0] * camera.focal_px[1]) * supersample)
        shape = self._directions.shape[:3]
        self._hits = PanelHits(np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.int16))

    def render(
        self, hall: Hall, pose: Pose2, light: HallLight | None = None, passers: Sequence[Panel] = ()
    ) -> Float32Array:
        """Render the hall from a pose of the robot, or of the camera itself if its offset and pan are 0.

        Parameters
        ----------
        passers : sequence of Panel
            Additional panels, such as passers-by, with textures of the hall.

        Returns
        -------
        (H, W, 3) float32
            Linear light, BGR; 255 is a sensor's white.
        """
        light = light or HallLight()
        eye = np.append(pose.transform(self.camera.viewpoint_m[:2]), self.camera.height_m)
        lamps = np.array(light.lamps, dtype=np.float64).reshape(-1, 4) * (1, 1, 1, light.level)
        cos, sin = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        rays = RayFan(self._directions, cos, sin, eye, self._ray_rad)
        panels = hall.arrays
        if passers:
            panels = Panels(*(np.concatenate(parts) for parts in zip(panels, panel_arrays(passers), strict=True)))
        first_panel(rays, panels, self._windows(panels, pose), self._hits)
        image = np.empty((*self._hits.depth.shape[:2], 3), dtype=np.float32)
        shade_panels(rays, panels, hall.pyramids, light.ambient * light.level, lamps, self._hits, image)
        return image

    def depths_m(self) -> Float32Array:
        """Return (H, W) float32: depth along the optical axis of each pixel of the last picture."""
        return np.asarray(self._hits.depth.min(axis=2), dtype=np.float32)

    def _windows(self, panels: Panels, pose: Pose2) -> npt.NDArray[np.int64]:
        """Return rows from, to, columns from, to (P, 4) of each panel's part of the image; all if it reaches behind."""
        origin = panels.origin
        width, height = self.camera.size_px
        a, b = panels.along * panels.size[:, :1], panels.up * panels.size[:, 1:]
        corners = np.stack([origin, origin + a, origin + b, origin + a + b], axis=1)
        robot = np.concatenate([pose.inverse().transform(corners[..., :2]), corners[..., 2:]], axis=-1)
        camera = (robot - self.camera.viewpoint_m) @ self.camera.camera_to_robot
        window = np.tile(np.array([0, height, 0, width], dtype=np.int64), (len(origin), 1))
        pixels = self.camera.camera_ray_to_pixel(camera)
        whole = (camera[..., 0] > _NEAREST_M).all(axis=1) & np.isfinite(pixels).all(axis=(1, 2))
        # distortion bends edges beyond their corners
        margin = 2 + 0.05 * max(width, height) * self.camera.is_bent
        low, high = pixels[whole].min(axis=1) - margin, pixels[whole].max(axis=1) + margin
        window[whole] = np.stack([low[:, 1], high[:, 1] + 1, low[:, 0], high[:, 0] + 1], axis=1).astype(np.int64)
        window[:, :2] = np.clip(window[:, :2], 0, height)
        window[:, 2:] = np.clip(window[:, 2:], 0, width)
        window[(camera[..., 0] <= _NEAREST_M).all(axis=1)] = 0
        return window


def loop_path(count: int, *, shift_m: float = 0.0, turns: float = 1.0) -> list[Pose2]:
    """Return poses along an oval of 10 m about the hall's middle, looking ahead.

    Parameters
    ----------
    shift_m : float
        Offset outwards from the oval.
    turns : float
        Number of turns.
    """
    ratio = 0.75
    angles = np.linspace(0, math.tau, 4097)
    unit = np.hypot(np.sin(angles), ratio * np.cos(angles))
    run = np.append(0, np.cumsum((unit[1:] + unit[:-1]) / 2 * np.diff(angles)))
    semi = _LOOP_M / run[-1]
    at = np.interp(np.remainder(np.linspace(0, turns, count), 1.0 + 1e-12) * run[-1], run, angles)
    poses = []
    for angle in at:
        heading = math.atan2(ratio * math.cos(angle), -math.sin(angle))
        x = semi * math.cos(angle) + shift_m * math.sin(heading)
        y = ratio * semi * math.sin(angle) - shift_m * math.cos(heading)
        poses.append(Pose2(float(x), float(y), heading))
    return poses
