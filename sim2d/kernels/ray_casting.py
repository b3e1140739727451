"""Compiled ray casting for exact pictures: the first thing on a ray, the paint on its patch of floor, the nets on it.

A ray has a horizontal direction of length 1 and a slope, so distances are horizontal.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import BoolArray, Float32Array, FloatArray, Int32Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.floor_paint import is_inside, share_of_arc, share_of_line
from sim2d.kernels.frame_values import FloorPaint, Nets
from sim2d.kernels.nets import cover_patch, from_eye
from sim2d.kernels.things import ID_BITS, KIND, foot_circle, meet_grid, meet_thing, row_of

LEVEL = -1e-7  # slope above which a ray never meets the floor
MIN_RUN = 1e-9
MAX_FLOOR_M = 1e3
_BLOCK = 1024  # rays that are processed together; things beside all of their bearings are skipped


@compiled(error_model="numpy")
def first_things(
    rows: Float32Array,
    directions: Float32Array,
    height: np.float32,
    lamp: Float32Array,
    distance_m: Float32Array,
    surface: Int32Array,
    shade: Float32Array,
) -> None:
    """Find the thing each ray meets first.

    Parameters
    ----------
    rows : (T, 10) float32
        As `UprightThings.rows`, with the origin at the eye's foot.
    directions : (3, N) float32
        Horizontal direction and slope, field axes; neighbours should have nearly the same bearing.
    height : float32
        Height of the eye, metres.
    lamp : (2,) float32
        Unit direction towards the light, field axes.
    distance_m : (N,) float32
        Length of each ray, metres; reduced to the distance of the thing that it meets.
    surface : (N,) int32
        Set to the thing's colour for each ray that meets one.
    shade : (N,) float32
        Set to the thing's shade for each ray that meets one.
    """
    ids = np.empty(directions.shape[1], dtype=np.int32)
    for start in range(0, len(ids), _BLOCK):
        stop = min(start + _BLOCK, len(ids))
        ids[start:stop] = -1
        middle = math.atan2(directions[1, start:stop].sum(), directions[0, start:stop].sum())
        c, s, least = np.float32(math.cos(middle)), np.float32(math.sin(middle)), np.float32(1.0)
        for i in range(start, stop):
            least = min(least, c * directions[0, i] + s * directions[1, i])
        half_rad = math.acos(least) + 1e-3
        for k in range(len(rows)):
            x, y, radius = foot_circle(rows[k])
            away = math.hypot(x, y)
            if away > radius:
                off_rad = abs(math.atan2(c * y - s * x, c * x + s * y))
                if off_rad > half_rad + math.asin(radius / away):
                    continue
            part = (0, 1, start, stop)
            meet_grid(rows[k], np.int32(k << ID_BITS), directions, part, 0, height, lamp, distance_m, ids)
        for i in range(start, stop):
            if ids[i] >= 0:
                row = row_of(rows, np.uintp(ids[i] >> ID_BITS))
                dx, dy, dz = directions[0, i], directions[1, i], directions[2, i]
                _, surface[i], shade[i] = meet_thing(row[KIND], row, dx, dy, dz, height, lamp)


@compiled(error_model="numpy")
def paint_floor(
    paint: FloorPaint,
    places_m: Float32Array,
    directions: Float32Array,
    sizes_m: Float32Array,
    covered: Float32Array,
    on_carpet: BoolArray,
) -> None:
    """Fill in which fraction of each ray's patch of floor is painted, and whether the patch lies on the carpet.

    Parameters
    ----------
    places_m : (2, N) float32
        Middles of the patches, field frame, metres.
    directions : (2, N) float32
        Unit directions of the patches' radial sides, field frame.
    sizes_m : (2, N) float32
        Radial and tangential sizes of the patches, metres.
    covered : (N,) float32
        Filled.
    on_carpet : (N,) bool
        Filled.
    """
    half = np.float32(paint.half_m)
    x, y, cos, sin = places_m[0], places_m[1], directions[0], directions[1]
    radial, tangential = sizes_m[0], sizes_m[1]
    for i in range(len(covered)):
        covered[i], on_carpet[i] = np.float32(0.0), is_inside(paint.edges, x[i], y[i])
    for k in range(len(paint.lines)):
        x0, y0, t_x, t_y, length = paint.lines[k]
        middle_x, middle_y = np.float32(x0 + length / 2 * t_x), np.float32(y0 + length / 2 * t_y)
        line = np.float32(t_x), np.float32(t_y), np.float32(length / 2), half
        for i in range(len(covered)):
            along, across = abs(cos[i] * line[0] + sin[i] * line[1]), abs(sin[i] * line[0] - cos[i] * line[1])
            fraction = share_of_line(x[i] - middle_x, y[i] - middle_y, line, along, across, radial[i], tangential[i])
            covered[i] = max(covered[i], fraction)
    for k in range(len(paint.arcs)):
        row = paint.arcs[k]
        center_x, center_y = np.float32(row[0]), np.float32(row[1])
        arc = np.float32(row[2]), np.float32(row[3]), np.float32(row[4]), np.float32(row[5]), half
        for i in range(len(covered)):
            fraction = share_of_arc(x[i] - center_x, y[i] - center_y, arc, cos[i], sin[i], radial[i], tangential[i])
            covered[i] = max(covered[i], fraction)


@compiled(error_model="numpy")
def cross_net(
    nets: Nets,
    which: int,
    eye_m: Float32Array,
    directions: Float32Array,
    steps: Float32Array,
    distance_m: Float32Array,
    covered: Float32Array,
) -> None:
    """Fill in where rays cross a net, and the fraction of their patches that its cords cover.

    Parameters
    ----------
    which : int
        Row of the net.
    eye_m : (3,) float32
        Start of all rays, field frame, metres.
    directions : (3, N) float32
        As in `first_things`.
    steps : (2, N) float32
        Angle to the ray beside each ray, radians, and difference of slope to the ray above it.
    distance_m, covered : (N,) float32
        Filled.
    """
    axes, start, sizes = from_eye(nets.rows[which], eye_m)
    for i in range(len(covered)):
        ray = directions[0, i], directions[1, i], directions[2, i], steps[0, i], steps[1, i]
        distance_m[i], covered[i] = cover_patch(axes, start, sizes, ray)


@compiled(error_model="numpy")
def pinhole_patches(
    height_m: float,
    rays_per_rad: float,
    along_axis: FloatArray,
    directions: FloatArray,
    radial_m: FloatArray,
    tangential_m: FloatArray,
) -> None:
    """Fill in the sizes of the patches of floor that a pinhole camera's rays represent.

    Parameters
    ----------
    rays_per_rad : float
        Rays per radian on the optical axis; there are 1 / c^2 times as many where the cosine of the angle to it is c.
    along_axis : (P, samples) float64
        Cosine between each ray and the optical axis.
    directions : (P, samples, 3) float64
        Unit directions, robot frame.
    radial_m, tangential_m : (P, samples) float64
        Filled: sizes along and across the ray, metres.
    """
    for pixel in range(directions.shape[0]):
        for sample in range(directions.shape[1]):
            x, y, z = directions[pixel, sample, 0], directions[pixel, sample, 1], directions[pixel, sample, 2]
            floor = height_m * max(math.hypot(x, y), MIN_RUN) / -z if z < LEVEL else MAX_FLOOR_M
            ray_m = math.hypot(min(floor, MAX_FLOOR_M), height_m)
            angle = along_axis[pixel, sample] * along_axis[pixel, sample] / rays_per_rad
            radial_m[pixel, sample] = ray_m * ray_m / height_m * angle
            tangential_m[pixel, sample] = ray_m * angle
