"""Compiled ray casting of textured rectangles: which one each ray meets first, and the light it sends back."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled


class RayFan(NamedTuple):
    """All rays of an image."""

    #: (H, W, S, 3) float32: S rays per pixel, robot frame; their lengths define the unit of `PanelHits.depth`.
    directions: Float32Array
    #: Cosine and sine of the robot's heading.
    cos: float
    sin: float
    #: (3,) float64: centre of projection, field frame, metres.
    eye: FloatArray
    #: Angle between neighbouring rays.
    ray_rad: float


class Panels(NamedTuple):
    """Rectangles, seen from the front only."""

    #: (P, 3) float64, field frame: a corner (m), unit directions of both edges; the front is at ``along x up``.
    origin: FloatArray
    along: FloatArray
    up: FloatArray
    #: (P, 2) float64: lengths of the edges, metres.
    size: FloatArray
    #: (P,) int64: number of each panel's texture.
    texture: Int64Array


class PanelHits(NamedTuple):
    """The first panel that each ray meets."""

    #: (H, W, S) float32: ray parameter of the first hit, inf if there is none.
    depth: Float32Array
    #: (H, W, S) int16: number of the panel, -1 if there is none.
    met: npt.NDArray[np.int16]


class Pyramids(NamedTuple):
    """All textures, each at several scales."""

    #: (N, 3) uint8: one pyramid after another, BGR, rows from the top down.
    texels: npt.NDArray[np.uint8]
    #: (T, L, 3) int64: first texel, rows and columns of each texture's levels.
    levels: Int64Array


@compiled
def first_panel(rays: RayFan, panels: Panels, window: Int64Array, hits: PanelHits) -> None:
    """Find the rectangle each ray meets first.

    Parameters
    ----------
    window : (P, 4) int64
        Rows and columns [r0, r1) x [c0, c1) of the image that may see each panel.
    hits : PanelHits
        Filled.
    """
    directions, cos, sin, eye = rays.directions, rays.cos, rays.sin, rays.eye
    origin, along, up, size = panels.origin, panels.along, panels.up, panels.size
    depth, met = hits.depth, hits.met
    depth[:] = np.inf
    met[:] = -1
    samples = directions.shape[2]
    for p in range(origin.shape[0]):
        nx = along[p, 1] * up[p, 2] - along[p, 2] * up[p, 1]
        ny = along[p, 2] * up[p, 0] - along[p, 0] * up[p, 2]
        nz = along[p, 0] * up[p, 1] - along[p, 1] * up[p, 0]
        ox, oy, oz = origin[p, 0] - eye[0], origin[p, 1] - eye[1], origin[p, 2] - eye[2]
        away = nx * ox + ny * oy + nz * oz
        if away >= 0.0:
            continue
        from_a = along[p, 0] * ox + along[p, 1] * oy + along[p, 2] * oz
        from_b = up[p, 0] * ox + up[p, 1] * oy + up[p, 2] * oz
        for r in range(window[p, 0], window[p, 1]):
            for c in range(window[p, 2], window[p, 3]):
                for k in range(samples):
                    rx, ry, dz = directions[r, c, k, 0], directions[r, c, k, 1], directions[r, c, k, 2]
                    dx, dy = cos * rx - sin * ry, sin * rx + cos * ry
                    facing = nx * dx + ny * dy + nz * dz
                    if facing >= -1e-9:
                        continue
                    t = away / facing
                    if t >= depth[r, c, k]:
                        continue
                    a = t * (along[p, 0] * dx + along[p, 1] * dy + along[p, 2] * dz) - from_a
                    if a < 0.0 or a > size[p, 0]:
                        continue
                    b = t * (up[p, 0] * dx + up[p, 1] * dy + up[p, 2] * dz) - from_b
                    if b < 0.0 or b > size[p, 1]:
                        continue
                    depth[r, c, k] = t
                    met[r, c, k] = p


@compiled
def shade_panels(
    rays: RayFan,
    panels: Panels,
    pyramids: Pyramids,
    ambient: float,
    lamps: FloatArray,
    hits: PanelHits,
    image: Float32Array,
) -> None:
    """Fill in the mean light of each pixel's rays: the panels' textures (trilinear) under ambient light and lamps.

    Parameters
    ----------
    rays, panels, hits
        As in `first_panel`, with `hits` as it leaves them.
    ambient : float
        Light that comes equally from all directions.
    lamps : (K, 4) float64
        Place (field frame, metres) and strength of each lamp: its light on a panel that faces it from 1 m away.
    image : (H, W, 3) float32
        Filled: linear light, BGR.
    """
    directions, cos, sin, eye, ray_rad = rays.directions, rays.cos, rays.sin, rays.eye, rays.ray_rad
    origin, along, up, size, texture = panels.origin, panels.along, panels.up, panels.size, panels.texture
    texels, levels, depth, met = pyramids.texels, pyramids.levels, hits.depth, hits.met
    samples = directions.shape[2]
    deepest = levels.shape[1] - 1
    for r in range(directions.shape[0]):
        for c in range(directions.shape[1]):
            blue, green, red = 0.0, 0.0, 0.0
            for k in range(samples):
                p = met[r, c, k]
                if p < 0:
                    continue
                rx, ry, dz = directions[r, c, k, 0], directions[r, c, k, 1], directions[r, c, k, 2]
                dx, dy = cos * rx - sin * ry, sin * rx + cos * ry
                t = depth[r, c, k]
                hx, hy, hz = eye[0] + t * dx, eye[1] + t * dy, eye[2] + t * dz
                ox, oy, oz = hx - origin[p, 0], hy - origin[p, 1], hz - origin[p, 2]
                a = (along[p, 0] * ox + along[p, 1] * oy + along[p, 2] * oz) / size[p, 0]
                b = 1.0 - (up[p, 0] * ox + up[p, 1] * oy + up[p, 2] * oz) / size[p, 1]
                nx = along[p, 1] * up[p, 2] - along[p, 2] * up[p, 1]
                ny = along[p, 2] * up[p, 0] - along[p, 0] * up[p, 2]
                nz = along[p, 0] * up[p, 1] - along[p, 1] * up[p, 0]
                length = math.sqrt(dx * dx + dy * dy + dz * dz)
                facing = -(nx * dx + ny * dy + nz * dz) / length
                patch_m = t * length * ray_rad / math.sqrt(max(facing, 0.02))
                kind = texture[p]
                per_m = math.sqrt(levels[kind, 0, 1] * levels[kind, 0, 2] / (size[p, 0] * size[p, 1]))
                level = min(max(math.log2(max(patch_m * per_m, 1e-6)), 0.0), float(deepest))
                low = min(int(level), deepest - 1)
                part = level - low
                light = ambient
                for j in range(lamps.shape[0]):
                    lx, ly, lz = lamps[j, 0] - hx, lamps[j, 1] - hy, lamps[j, 2] - hz
                    squared = lx * lx + ly * ly + lz * lz
                    toward = (nx * lx + ny * ly + nz * lz) / math.sqrt(squared)
                    light += lamps[j, 3] * max(toward, 0.0) / max(squared, 0.25)
                for step in range(2):
                    weight = light * (part if step else 1.0 - part)
                    first, rows, columns = levels[kind, low + step]
                    x = min(max(a * columns - 0.5, 0.0), columns - 1.001)
                    y = min(max(b * rows - 0.5, 0.0), rows - 1.001)
                    i, j0 = int(y), int(x)
                    fy, fx = y - i, x - j0
                    i1, j1 = min(i + 1, rows - 1), min(j0 + 1, columns - 1)
                    w00, w01 = weight * (1 - fy) * (1 - fx), weight * (1 - fy) * fx
                    w10, w11 = weight * fy * (1 - fx), weight * fy * fx
                    q00, q01 = first + i * columns + j0, first + i * columns + j1
                    q10, q11 = first + i1 * columns + j0, first + i1 * columns + j1
                    blue += w00 * texels[q00, 0] + w01 * texels[q01, 0] + w10 * texels[q10, 0] + w11 * texels[q11, 0]
                    green += w00 * texels[q00, 1] + w01 * texels[q01, 1] + w10 * texels[q10, 1] + w11 * texels[q11, 1]
                    red += w00 * texels[q00, 2] + w01 * texels[q01, 2] + w10 * texels[q10, 2] + w11 * texels[q11, 2]
            image[r, c, 0] = blue / samples
            image[r, c, 1] = green / samples
            image[r, c, 2] = red / samples
