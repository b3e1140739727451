"""Parts of a hall: textured rectangles, and boxes and prisms made of them. Field frame, metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from sim2d.kernels.panels import Panels

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle with a texture on its front: corner, two unit edges (the front is along x up) and their lengths."""

    origin_m: Vector
    along: Vector
    up: Vector
    size_m: tuple[float, float]
    texture: int
    is_poster: bool = False


def panel_arrays(panels: Sequence[Panel]) -> Panels:
    """Return panels in the format of the compiled loops."""
    return Panels(
        np.array([p.origin_m for p in panels], dtype=np.float64).reshape(-1, 3),
        np.array([p.along for p in panels], dtype=np.float64).reshape(-1, 3),
        np.array([p.up for p in panels], dtype=np.float64).reshape(-1, 3),
        np.array([p.size_m for p in panels], dtype=np.float64).reshape(-1, 2),
        np.array([p.texture for p in panels], dtype=np.int64),
    )


def inward(along: Vector, by_m: float) -> Vector:
    """Return a vector of length `by_m` from a wall into the room."""
    return along[1] * by_m, -along[0] * by_m, 0.0


def box(place: Pose2, size_m: Vector, skins: Sequence[int], base_m: float = 0.0) -> list[Panel]:
    """Return the four sides and the top of an upright box; the skins alternate on its sides, and the last is on top.

    Parameters
    ----------
    place : Pose2
        Middle of the box, and direction of its first edge.
    size_m : (float, float, float)
        Size along that edge, across it, and height.
    base_m : float
        Height of its bottom above the floor.
    """
    wide, deep, high = size_m
    corners = place.transform(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (wide / 2, deep / 2))
    sides = _sides(corners, base_m, high, skins)
    c, s = math.cos(place.theta_rad), math.sin(place.theta_rad)
    lid = (float(corners[0][0]), float(corners[0][1]), base_m + high)
    return [*sides, Panel(lid, (c, s, 0.0), (-s, c, 0.0), (wide, deep), skins[-1])]


def prism(
    place: Pose2, radii_m: tuple[float, float], heights_m: tuple[float, float], skins: Sequence[int]
) -> list[Panel]:
    """Return the sides of an upright prism over an ellipse, one skin each, the first in the direction of the heading.

    Parameters
    ----------
    place : Pose2
        Place of its axis, and heading.
    radii_m : (float, float)
        Radii along the heading and across it.
    heights_m : (float, float)
        Heights of bottom and top above the floor.
    """
    angles = (np.arange(len(skins)) - 0.5) * (math.tau / len(skins))
    corners = place.transform(np.column_stack([np.cos(angles), np.sin(angles)]) * radii_m)
    return _sides(corners, heights_m[0], heights_m[1] - heights_m[0], skins)


def swung(panels: Sequence[Panel], pivot_m: Vector, heading_rad: float, angle_rad: float) -> list[Panel]:
    """Return panels rotated forwards about a horizontal axis through a pivot, across a heading."""
    ahead = np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
    upright = np.array([0.0, 0.0, 1.0])
    c, s = math.cos(angle_rad), math.sin(angle_rad)

    def turned(vector: Sequence[float]) -> FloatArray:
        """Rotate a vector; points below the pivot move ahead."""
        v = np.asarray(vector, dtype=np.float64)
        a, b = float(v @ ahead), float(v[2])
        return v + (a * (c - 1) - b * s) * ahead + (a * s + b * (c - 1)) * upright

    def triple(vector: FloatArray) -> Vector:
        x, y, z = vector.tolist()
        return x, y, z

    return [
        replace(
            panel,
            origin_m=triple(np.add(pivot_m, turned(np.subtract(panel.origin_m, pivot_m).tolist()))),
            along=triple(turned(panel.along)),
            up=triple(turned(panel.up)),
        )
        for panel in panels
    ]


def _sides(corners_m: FloatArray, base_m: float, high: float, skins: Sequence[int]) -> list[Panel]:
    """Return upright panels from corner to corner, counter-clockwise from above, with fronts outside."""
    faces = []
    for k, start in enumerate(corners_m):
        end = corners_m[(k + 1) % len(corners_m)]
        length = float(np.hypot(*(end - start)))
        ax, ay = (float(v) for v in (end - start) / length)
        origin = (float(start[0]), float(start[1]), base_m)
        faces.append(Panel(origin, (ax, ay, 0.0), (0.0, 0.0, 1.0), (length, high), skins[k % len(skins)]))
    return faces
