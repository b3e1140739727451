"""Compiled rendering of goal nets: where a ray crosses one, how much of its patch is cord, nets in mirror frames."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import EDGE, FAR, HIGH, NEAR, THING
from sim2d.kernels.floor_lines import GAIN, SLOPE_HIGH, SLOPE_LOW, TANGENTIAL, X, Y, bearings_of
from sim2d.kernels.frame_values import Bearings, MirrorView, PixelRays, UprightThings
from sim2d.kernels.things import BALL, HEIGHT, KIND

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_MIN_WIDTH_M, _FARTHEST = np.float32(1e-4), np.float32(1e6)
# columns of `Nets.rows`
SIZE, MESH, CORD = 9, 11, 13
Vector = tuple[np.float32, np.float32, np.float32]
Sizes = tuple[np.float32, np.float32, np.float32, np.float32, np.float32]
Ray = tuple[np.float32, np.float32, np.float32, np.float32, np.float32]


@compiled(error_model="numpy", inline="always")
def cords_until(meshes: np.float32, thickness: np.float32) -> np.float32:
    """Return the length covered by cords from half a mesh before 0 to a place; all lengths in meshes."""
    meshes += _HALF
    whole: np.float32 = np.floor(meshes)
    covered: np.float32 = whole * thickness + min(max(meshes - whole - _HALF + thickness * _HALF, _ZERO), thickness)
    return covered


@compiled(error_model="numpy", inline="always")
def cover_axis(
    at_m: np.float32, wide_m: np.float32, size_m: np.float32, mesh_m: np.float32, cord_m: np.float32
) -> tuple[np.float32, np.float32]:
    """Return the fraction of an interval within a net's edge of length `size_m`, and the fraction between its cords."""
    per_mesh, per_wide = _ONE / mesh_m, _ONE / wide_m
    thickness = cord_m * per_mesh
    low = min(max(at_m - wide_m * _HALF, _ZERO), size_m)
    high = min(max(at_m + wide_m * _HALF, _ZERO), size_m)
    inside = high - low
    free = inside - mesh_m * (cords_until(high * per_mesh, thickness) - cords_until(low * per_mesh, thickness))
    return inside * per_wide, free * per_wide


@compiled(error_model="numpy")
def from_eye(row: FloatArray, eye: Float32Array) -> tuple[Float32Array, Float32Array, Sizes]:
    """Return a net's axes (3, 3): first edge, second edge, normal; its corner's coordinates along them; and its sizes.

    The corner is relative to the eye; the sizes are the edges' lengths, a mesh's widths along them, a cord's thickness.
    """
    axes, start = np.empty((3, 3), dtype=np.float32), np.zeros(3, dtype=np.float32)
    for k in range(3):
        following, last = (k + 1) % 3, (k + 2) % 3
        axes[0, k], axes[1, k] = np.float32(row[3 + k]), np.float32(row[6 + k])
        axes[2, k] = np.float32(row[3 + following] * row[6 + last] - row[3 + last] * row[6 + following])
    for axis in range(3):
        for k in range(3):
            start[axis] += axes[axis, k] * (np.float32(row[k]) - eye[k])
    lengths = np.float32(row[SIZE]), np.float32(row[SIZE + 1])
    return axes, start, (*lengths, np.float32(row[MESH]), np.float32(row[MESH + 1]), np.float32(row[CORD]))


@compiled(error_model="numpy", inline="always")
def along_axes(axes: Float32Array, x: np.float32, y: np.float32, z: np.float32) -> Vector:
    """Return a vector's components along a net's axes."""
    a = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
    b = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    return a, b, axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z


@compiled(error_model="numpy", inline="always")
def cover(start: Float32Array, sizes: Sizes, ray: Vector, by_u: Vector, by_v: Vector) -> tuple[np.float32, np.float32]:
    """Return the multiple of a ray at which it meets a net, and the fraction of its pixel that cords cover.

    Parameters
    ----------
    start, sizes
        As `from_eye` returns them.
    ray, by_u, by_v : (float32, float32, float32)
        The ray, and its differences to the ray beside and to the one above, along the net's axes.
    """
    # without branches, so that the compiler can vectorise over several pixels
    along, up, facing = ray
    per_facing = _ONE / facing
    t = start[2] * per_facing
    is_met = (t > _ZERO) & (t < _FARTHEST)
    t = t if is_met else _ONE
    du, dv = by_u[2] * per_facing, by_v[2] * per_facing
    wide_u, wide_v = t * (by_u[0] - along * du), t * (by_v[0] - along * dv)
    tall_u, tall_v = t * (by_u[1] - up * du), t * (by_v[1] - up * dv)
    wide = max(np.float32(math.sqrt(wide_u * wide_u + wide_v * wide_v)), _MIN_WIDTH_M)
    tall = max(np.float32(math.sqrt(tall_u * tall_u + tall_v * tall_v)), _MIN_WIDTH_M)
    inside_a, free_a = cover_axis(t * along - start[0], wide, sizes[0], sizes[2], sizes[4])
    inside_b, free_b = cover_axis(t * up - start[1], tall, sizes[1], sizes[3], sizes[4])
    return t, inside_a * inside_b - free_a * free_b if is_met else _ZERO


@compiled(error_model="numpy")
def _hidden_until(
    crossings: Bearings, things: UprightThings, bearing: int, distance_m: float, height_m: float
) -> float:
    """Return the slope up to which objects nearer than a distance hide what is behind them."""
    hidden = -math.inf
    for e in range(crossings.lengths[bearing]):
        entry = crossings.entries[bearing, e]
        if entry[NEAR] >= distance_m:
            break
        thing = int(entry[THING])
        if thing != EDGE and things.rows[thing, KIND] == BALL:
            hidden = max(hidden, float(entry[HIGH]))
            continue
        rise = (0.0 if thing == EDGE else things.rows[thing, HEIGHT]) - height_m
        hidden = max(hidden, rise / entry[NEAR], rise / entry[FAR])
    return hidden


@compiled(error_model="numpy")
def lay_nets(view: MirrorView, crossings: Bearings, out: UInt8Array) -> None:
    """Draw nets over a mirror camera's frame (H * W, 3)."""
    nets, pixels, eye, light = view.nets, view.pixels, view.eye, view.light
    bearings = len(pixels.first) - 1
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    here = np.array([eye.x_m, eye.y_m, eye.height_m], dtype=np.float32)
    step, corners = np.float32(math.tau / bearings), np.empty((2, 4))
    low_of, high_of, gain_of = pixels.rays[SLOPE_LOW], pixels.rays[SLOPE_HIGH], pixels.rays[GAIN]
    for which in range(len(nets.rows)):
        row = nets.rows[which]
        axes, start, sizes = from_eye(row, here)
        for corner in range(4):
            first, second = row[SIZE] if corner & 1 else 0.0, row[SIZE + 1] if corner & 2 else 0.0
            corners[0, corner] = row[0] + first * row[3] + second * row[6] - eye.x_m
            corners[1, corner] = row[1] + first * row[4] + second * row[7] - eye.y_m
        from_k, until_k = bearings_of(corners[0], corners[1], -eye.heading_rad, bearings)
        for turned in range(from_k, until_k + 1):
            k = turned % bearings
            cos = c * pixels.directions[k, 1] - s * pixels.directions[k, 2]
            sin = s * pixels.directions[k, 1] + c * pixels.directions[k, 2]
            x, y = np.float32(cos), np.float32(sin)
            lowest, highest = _slopes_of(row, axes, start, x, y, here)
            if lowest >= highest:
                continue
            is_upright, hidden = axes[2, 2] == _ZERO, _ZERO
            if is_upright:
                away = start[2] / along_axes(axes, x, y, _ZERO)[2]
                hidden = np.float32(_hidden_until(crossings, view.things, k, float(away), eye.height_m))
            for i in range(pixels.first[k], pixels.first[k + 1]):
                if high_of[i] < lowest or low_of[i] > highest:
                    continue
                ray = _ray_of(pixels, i, step, np.float32(c), np.float32(s))
                t, covered = cover_patch(axes, start, sizes, ray)
                if covered <= _ZERO:
                    continue
                if not is_upright:
                    hidden = np.float32(_hidden_until(crossings, view.things, k, float(t), eye.height_m))
                covered *= min(max((high_of[i] - hidden) / ray[4], _ZERO), _ONE)
                bright = light.level + light.per_m_x * (eye.x_m + t * ray[0])
                bright += light.per_m_y * (eye.y_m + t * ray[1])
                tone, pixel = np.float32(max(float(bright), light.min_level)) * gain_of[i], pixels.pixels[i]
                for channel in range(3):
                    behind_it = np.float32(out[pixel, channel])
                    cord = min(tone * nets.color[channel], np.float32(255.0))
                    out[pixel, channel] = np.uint8(behind_it + covered * (cord - behind_it) + _HALF)


@compiled(error_model="numpy", inline="always")
def _ray_of(pixels: PixelRays, i: int, step: np.float32, c: np.float32, s: np.float32) -> Ray:
    """Return a pixel's ray: direction x, y and slope, its angular width across the bearing, and its range of slopes."""
    ahead, left = pixels.rays[X, i], pixels.rays[Y, i]
    floor_m = np.float32(math.sqrt(ahead * ahead + left * left))
    low, high = pixels.rays[SLOPE_LOW, i], pixels.rays[SLOPE_HIGH, i]
    # beyond the horizon a pixel is about as wide as the step between bearings
    angle = pixels.rays[TANGENTIAL, i] / floor_m if high < _ZERO else step
    x, y = (c * ahead - s * left) / floor_m, (s * ahead + c * left) / floor_m
    return x, y, (low + high) * _HALF, angle, high - low


@compiled(error_model="numpy", inline="always")
def cover_patch(axes: Float32Array, start: Float32Array, sizes: Sizes, ray: Ray) -> tuple[np.float32, np.float32]:
    """Return the horizontal distance at which a ray meets a net, and the fraction of its pixel that cords cover.

    `ray`: horizontal direction and slope, field axes, angle to the ray beside it, difference of slope to the one above.
    """
    x, y, z, angle, tall = ray
    by_side, by_up = along_axes(axes, -angle * y, angle * x, _ZERO), along_axes(axes, _ZERO, _ZERO, tall)
    return cover(start, sizes, along_axes(axes, x, y, z), by_side, by_up)


@compiled(error_model="numpy")
def _slopes_of(
    row: FloatArray, axes: Float32Array, start: Float32Array, x: np.float32, y: np.float32, here: Float32Array
) -> tuple[np.float32, np.float32]:
    """Return the smallest and greatest slope at which a ray of one bearing may meet a net's rectangle."""
    nothing = np.float32(math.inf), np.float32(-math.inf)
    if axes[2, 2] == _ZERO:  # upright
        t = start[2] / along_axes(axes, x, y, _ZERO)[2]
        if not (t > _ZERO and t < _FARTHEST):
            return nothing
        return -here[2] / t, (np.float32(row[SIZE + 1]) - here[2]) / t
    farthest = np.float32(math.hypot(row[0] - here[0], row[1] - here[1]) + math.hypot(row[SIZE], row[SIZE + 1]))
    rise = np.float32(row[2]) - here[2]
    if rise > _ZERO:
        return rise / farthest, np.float32(math.inf)
    return np.float32(-math.inf), rise / farthest
