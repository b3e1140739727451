"""The picture of a goal and of points on the floor, with its derivatives by all eight unknowns of the camera.

The order of the unknowns and of the silhouette edges is that of localization/goal/geometry.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import Axis, camera_axes, ideal_pixel, in_camera

# unknowns that move a point of the floor in the picture; the last one, bloom, moves paint's edges only
FLOOR_UNKNOWNS = 7


class GoalScene(NamedTuple):
    """The goal at +x and the camera's ideal view of it.

    Parameters
    ----------
    shape : (4,) float64
        line_x_m, width_m, height_m, radius_m.
    camera : (4,) float64
        Focal lengths and centre, pixels.
    offsets : (K,) float64
        Where a foot is measured, across the post, -1 to 1.
    """

    shape: FloatArray
    camera: FloatArray
    offsets: FloatArray


@compiled
def _turned(ray: Axis, vertical: Axis, roll_rad: float) -> tuple[Axis, Axis, Axis]:
    """Derive a direction in camera axes by heading, tilt and roll: its product with each rotation's axis."""
    a, b, c = ray
    up_a, up_b, up_c = vertical
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    return (
        (b * up_c - c * up_b, c * up_a - a * up_c, a * up_b - b * up_a),
        (b * sr + c * cr, -a * sr, -a * cr),
        (0.0, c, -b),
    )


@compiled
def _edge_normal(scene: GoalScene, p: FloatArray, edge: int) -> tuple[Axis, Axis, Axis, Axis]:
    """Outward normal of the plane through the camera that touches one edge, and its derivatives by x, y and height.

    Such a plane holds the direction to the cylinder's axis, turned by the angle that the radius subtends.
    """
    shape = scene.shape
    dx = shape[0] - p[0]
    is_bar = edge >= 4
    if is_bar:
        ahead, aside = abs(dx), shape[2] - p[5]
    else:
        ahead, aside = dx, (0.5 if edge < 2 else -0.5) * shape[1] - p[1]
    away = math.sqrt(ahead * ahead + aside * aside)
    half = min(1.0, shape[3] / away)
    rest = math.sqrt(1.0 - half * half)
    # +1: the edge to the left of the axis, or above it
    sign = 1.0 if edge == 0 or edge == 2 or edge == 4 else -1.0
    sine, cosine = (aside * rest + sign * ahead * half) / away, (ahead * rest - sign * aside * half) / away
    # the angle's derivatives: the axis turns, and what the radius subtends shrinks with the distance
    shrink = half / (away * rest) if rest > 1e-9 else 0.0
    by_ahead = -aside / away**2 - sign * shrink * ahead / away
    by_aside = ahead / away**2 - sign * shrink * aside / away
    zero = (0.0, 0.0, 0.0)
    if is_bar:
        side = -1.0 if dx < 0 else 1.0
        along, up = -sign * side * cosine, -sign * sine
        # the camera's x and height grow against the axis's distance and rise
        by_x, by_z = -side * by_ahead, -by_aside
        normal = (-sign * side * sine, 0.0, sign * cosine)
        return normal, (along * by_x, 0.0, up * by_x), zero, (along * by_z, 0.0, up * by_z)
    normal = (-sign * sine, sign * cosine, 0.0)
    along, across = -sign * cosine, -sign * sine
    return normal, (-along * by_ahead, -across * by_ahead, 0.0), (-along * by_aside, -across * by_aside, 0.0), zero


@compiled
def predict_goal(scene: GoalScene, p: FloatArray, lines: FloatArray, feet: FloatArray) -> None:
    """Silhouette lines and feet of the goal at +x in the ideal image.

    Parameters
    ----------
    scene : GoalScene
        Goal and camera.
    p : (8,) float64
        The unknowns.
    lines : (6, 3) float64
        Result: a u + b v + c is the distance outside each edge, pixels, bloom included.
    feet : (2, K, 2) float64
        Result: pixels of each post's foot; NaN behind the camera.
    """
    view, axes = scene.camera, camera_axes(p[2], p[3], p[4])
    scale = math.exp(p[6])
    for e in range(6):
        normal, _, _, _ = _edge_normal(scene, p, e)
        n0, n1, n2 = in_camera(axes, *normal)
        a, b = -n1 / (view[0] * scale), -n2 / (view[1] * scale)
        norm = math.sqrt(a * a + b * b)
        lines[e, 0], lines[e, 1] = a / norm, b / norm
        lines[e, 2] = (n0 - a * view[2] - b * view[3]) / norm - p[7]
    for post in range(2):
        for k in range(scene.offsets.shape[0]):
            point, _, _ = _foot_point(scene, p, post, scene.offsets[k])
            feet[post, k, 0], feet[post, k, 1] = _pixel(in_camera(axes, *point), view, scale)


@compiled
def _foot_point(scene: GoalScene, p: FloatArray, post: int, offset: float) -> tuple[Axis, Axis, Axis]:
    """Where the near half of a post meets the floor, from the camera, and its derivatives by the camera's x and y."""
    radius = scene.shape[3]
    dx, dy = scene.shape[0] - p[0], (0.5 if post == 0 else -0.5) * scene.shape[1] - p[1]
    away = math.sqrt(dx * dx + dy * dy)
    ux, uy = dx / away, dy / away
    along = math.sqrt(1.0 - offset**2)
    point = (dx + radius * (offset * uy - along * ux), dy + radius * (-offset * ux - along * uy), -p[5])
    # the side that faces the camera turns with it
    turn_x, turn_y = uy / away, -ux / away
    across_x, across_y = radius * (offset * ux + along * uy), radius * (offset * uy - along * ux)
    return (
        point,
        (across_x * turn_x - 1.0, across_y * turn_x, 0.0),
        (across_x * turn_y, across_y * turn_y - 1.0, 0.0),
    )


@compiled
def _pixel(ray: Axis, view: FloatArray, scale: float) -> tuple[float, float]:
    """Pixel of a direction in camera axes; NaN behind the camera."""
    if not ray[0] > 1e-6:
        return np.nan, np.nan
    return ideal_pixel(view[0] * scale, view[1] * scale, view[2], view[3], ray[0], ray[1], ray[2])


@compiled
def _pixel_moves(ray: Axis, moved: Axis, view: FloatArray, scale: float) -> tuple[float, float]:
    """Derive the pixel of a direction that changes."""
    a, b = ray[1] / ray[0], ray[2] / ray[0]
    return -view[0] * scale * (moved[1] - a * moved[0]) / ray[0], -view[1] * scale * (moved[2] - b * moved[0]) / ray[0]


@compiled
def goal_derivatives(scene: GoalScene, p: FloatArray, by_lines: FloatArray, by_feet: FloatArray) -> None:
    """Derive what `predict_goal` gives by the unknowns.

    Parameters
    ----------
    scene, p
        See `predict_goal`.
    by_lines : (8, 6, 3) float64
        Result.
    by_feet : (8, 2, K, 2) float64
        Result; bloom is no part of it. NaN behind the camera.
    """
    view, axes = scene.camera, camera_axes(p[2], p[3], p[4])
    scale, vertical = math.exp(p[6]), axes[2]
    fu, fv = view[0] * scale, view[1] * scale
    for e in range(6):
        normal, by_x, by_y, by_height = _edge_normal(scene, p, e)
        n = in_camera(axes, *normal)
        by_heading, by_tilt, by_roll = _turned(n, vertical, p[4])
        a, b = -n[1] / fu, -n[2] / fv
        norm = math.sqrt(a * a + b * b)
        c = n[0] - a * view[2] - b * view[3]
        moves = (
            in_camera(axes, *by_x),
            in_camera(axes, *by_y),
            by_heading,
            by_tilt,
            by_roll,
            in_camera(axes, *by_height),
            (0.0, -n[1], -n[2]),  # a longer focal length is a direction nearer to the axis
        )
        for k in range(FLOOR_UNKNOWNS):
            m0, m1, m2 = moves[k]
            da, db = -m1 / fu, -m2 / fv
            dc = m0 - da * view[2] - db * view[3]
            shrink = (a * da + b * db) / norm**2
            by_lines[k, e, 0] = (da - a * shrink) / norm
            by_lines[k, e, 1] = (db - b * shrink) / norm
            by_lines[k, e, 2] = (dc - c * shrink) / norm
        by_lines[7, e, 0], by_lines[7, e, 1], by_lines[7, e, 2] = 0.0, 0.0, -1.0
    by_feet[:] = 0.0
    for post in range(2):
        for k in range(scene.offsets.shape[0]):
            point, by_x, by_y = _foot_point(scene, p, post, scene.offsets[k])
            ray = in_camera(axes, *point)
            if not ray[0] > 1e-6:
                by_feet[:, post, k] = np.nan
                continue
            by_heading, by_tilt, by_roll = _turned(ray, vertical, p[4])
            moves = (
                in_camera(axes, *by_x),
                in_camera(axes, *by_y),
                by_heading,
                by_tilt,
                by_roll,
                (-vertical[0], -vertical[1], -vertical[2]),
                (0.0, ray[1], ray[2]),
            )
            for i in range(FLOOR_UNKNOWNS):
                by_feet[i, post, k, 0], by_feet[i, post, k, 1] = _pixel_moves(ray, moves[i], view, scale)


@compiled
def floor_residuals(
    view: FloatArray, p: FloatArray, floor_m: FloatArray, uv: FloatArray, direction: FloatArray, residual: FloatArray
) -> None:
    """Signed pixel residuals, along a direction each, of floor points; NaN behind the camera.

    Parameters
    ----------
    view : (4,) float64
        Focal lengths and centre, pixels.
    p : (8,) float64
        The unknowns.
    floor_m : (N, 2) float64
        Points of the floor, field frame, metres.
    uv, direction : (N, 2) float64
        Where each was seen, and along which direction that was measured, pixels.
    residual : (N,) float64
        Result.
    """
    axes, scale = camera_axes(p[2], p[3], p[4]), math.exp(p[6])
    for n in range(floor_m.shape[0]):
        u, v = _pixel(in_camera(axes, floor_m[n, 0] - p[0], floor_m[n, 1] - p[1], -p[5]), view, scale)
        residual[n] = (uv[n, 0] - u) * direction[n, 0] + (uv[n, 1] - v) * direction[n, 1]


@compiled
def floor_derivatives(
    view: FloatArray, p: FloatArray, floor_m: FloatArray, direction: FloatArray, jacobian: FloatArray
) -> None:
    """Derive `floor_residuals` by the unknowns that move the floor, (N, 7); NaN behind the camera."""
    axes, scale = camera_axes(p[2], p[3], p[4]), math.exp(p[6])
    for n in range(floor_m.shape[0]):
        ray = in_camera(axes, floor_m[n, 0] - p[0], floor_m[n, 1] - p[1], -p[5])
        if not ray[0] > 1e-6:
            jacobian[n] = np.nan
            continue
        by_heading, by_tilt, by_roll = _turned(ray, axes[2], p[4])
        moves = (
            (-axes[0][0], -axes[0][1], -axes[0][2]),
            (-axes[1][0], -axes[1][1], -axes[1][2]),
            by_heading,
            by_tilt,
            by_roll,
            (-axes[2][0], -axes[2][1], -axes[2][2]),
            (0.0, ray[1], ray[2]),
        )
        for k in range(FLOOR_UNKNOWNS):
            du, dv = _pixel_moves(ray, moves[k], view, scale)
            jacobian[n, k] = -du * direction[n, 0] - dv * direction[n, 1]
