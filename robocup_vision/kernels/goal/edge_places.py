"""Places at which a goal's edges are measured: along posts and bar, and at the feet."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera
from robocup_vision.kernels.goal.picture import GoalScene


class EdgePlaces(NamedTuple):
    """Places at which edges and feet are measured; `expected` aside, one entry a place.

    Parameters
    ----------
    starts, normals : (N, 2) float64
        Pixels, and unit directions that point out of the object.
    edge : (N,) int64
        Which edge; 6: a foot.
    inside : (N,) float64
        How far the object goes on behind its edge, pixels.
    expected : (6,) int64
        Places on each edge that lie inside the image.
    """

    starts: FloatArray
    normals: FloatArray
    edge: Int64Array
    inside: FloatArray
    expected: Int64Array


@compiled
def goal_outline(scene: GoalScene, x_m: float, y_m: float, height_m: float, outline: FloatArray) -> None:
    """Points of a goal's outline as a camera at a place sees it: both ends of each free edge, and its feet.

    Parameters
    ----------
    scene : GoalScene
        The goal at +x.
    x_m, y_m, height_m : float
        The camera's place, field frame.
    outline : (12 + 4 * K, 3) float64
        Results, field frame, from the camera: ends of the six edges, the feet of the left, then of the right post, and
        as many half a radius higher.
    """
    shape, offsets = scene.shape, scene.offsets
    line_x, half, top, radius = shape[0], 0.5 * shape[1], shape[2], shape[3]
    dx, dz = line_x - x_m, top - height_m
    side = -1.0 if dx < 0 else 1.0
    elevation, bar_half = math.atan2(dz, abs(dx)), math.asin(min(1.0, radius / math.hypot(dx, dz)))
    count = offsets.shape[0]
    for n in range(12 + 4 * count):
        x, y, z = line_x, 0.0, 0.0
        if n < 8:
            e = n // 2
            y = half if e < 2 else -half
            z = 0.7 * radius if n % 2 == 0 else (top + 0.5 * radius if e == 0 or e == 3 else top - 2.0 * radius)
            bearing = math.atan2(y - y_m, dx)
            wide = math.asin(min(1.0, radius / math.hypot(dx, y - y_m)))
            if e == 0 or e == 2:
                x -= radius * math.sin(bearing + wide)
                y += radius * math.cos(bearing + wide)
            else:
                x += radius * math.sin(bearing - wide)
                y -= radius * math.cos(bearing - wide)
        elif n < 12:
            trim = 0.0 if n < 10 else 2.0 * radius
            y = half - trim if n % 2 == 0 else trim - half
            if n < 10:
                x -= side * radius * math.sin(elevation + bar_half)
                z = top + radius * math.cos(elevation + bar_half)
            else:
                x += side * radius * math.sin(elevation - bar_half)
                z = top - radius * math.cos(elevation - bar_half)
        else:
            k = (n - 12) % (2 * count)
            post_y = half if k < count else -half
            offset = offsets[k % count]
            along = math.sqrt(1.0 - offset**2)
            distance = math.hypot(dx, post_y - y_m)
            ux, uy = dx / distance, (post_y - y_m) / distance
            x = line_x + radius * (offset * uy - along * ux)
            y = post_y + radius * (-offset * ux - along * uy)
            z = 0.0 if n < 12 + 2 * count else 0.5 * radius
        outline[n, 0], outline[n, 1], outline[n, 2] = x - x_m, y - y_m, z - height_m


@compiled
def project_outline(
    outline: FloatArray, view: FloatArray, heading_rad: float, tilt_rad: float, roll_rad: float, points: FloatArray
) -> bool:
    """Ideal pixels (N, 2) of an outline (N, 3), see `goal_outline`; whether all of it is in front of the camera."""
    axes = camera_axes(heading_rad, tilt_rad, roll_rad)
    for n in range(outline.shape[0]):
        depth, left, up = in_camera(axes, outline[n, 0], outline[n, 1], outline[n, 2])
        if depth <= 0.05:
            return False
        points[n, 0], points[n, 1] = ideal_pixel(view[0], view[1], view[2], view[3], depth, left, up)
    return True


@compiled
def goal_points(scene: GoalScene, p: FloatArray, points: FloatArray) -> bool:
    """Ideal pixels (12 + 4 * K, 2) of where to measure, see `goal_outline`; whether all is in front of the camera.

    Parameters
    ----------
    scene, p
        See `kernels.goal.picture.predict_goal`; the stated focal length counts.
    points : (12 + 4 * K, 2) float64
        Results.
    """
    outline = np.empty((points.shape[0], 3))
    goal_outline(scene, p[0], p[1], p[5], outline)
    return project_outline(outline, scene.camera, p[2], p[3], p[4], points)


@compiled
def spread_samples(
    points: FloatArray, feet: int, size: tuple[int, int], spacing: float, max_count: int, places: EdgePlaces
) -> int:
    """Places along the edges and at the feet, with outward normals.

    Parameters
    ----------
    points : (12 + 2 * feet, 2) float64
        Of `goal_points`, in image pixels.
    feet : int
        How many of them are feet.
    size : (int, int)
        Width and height of the image, pixels.
    spacing, max_count : float, int
        Pixels between places on an edge, and their greatest number.
    places : EdgePlaces
        Results, with room for 6 * max_count + feet.

    Returns
    -------
    int
        How many places there are; the last `feet` are the feet.
    """
    width, height = size
    starts, normals, edge, inside, expected = places
    n = 0
    for e in range(6):
        expected[e] = 0
        ax, ay, bx, by = points[2 * e, 0], points[2 * e, 1], points[2 * e + 1, 0], points[2 * e + 1, 1]
        length = math.hypot(bx - ax, by - ay)
        if not (1.0 < length < 1e4):
            continue
        partner = e ^ 1
        px = 0.5 * (points[2 * partner, 0] + points[2 * partner + 1, 0]) - ax
        py = 0.5 * (points[2 * partner, 1] + points[2 * partner + 1, 1]) - ay
        nx, ny = (by - ay) / length, -(bx - ax) / length
        across = nx * px + ny * py
        if across > 0:
            nx, ny = -nx, -ny
        count = int(min(max(length / spacing, 4.0), max_count))
        for k in range(count):
            t = (k + 0.5) / count
            u, v = ax + t * (bx - ax), ay + t * (by - ay)
            if 3 < u < width - 4 and 3 < v < height - 4:
                starts[n, 0], starts[n, 1], normals[n, 0], normals[n, 1] = u, v, nx, ny
                edge[n] = e
                inside[n] = 0.5 * abs(across)
                expected[e] += 1
                n += 1
    for k in range(feet):
        u, v = points[12 + k, 0], points[12 + k, 1]
        du, dv = u - points[12 + feet + k, 0], v - points[12 + feet + k, 1]
        length = max(math.hypot(du, dv), 1e-9)
        starts[n, 0], starts[n, 1], normals[n, 0], normals[n, 1] = u, v, du / length, dv / length
        edge[n] = 6
        inside[n] = 4.0
        n += 1
    return n
