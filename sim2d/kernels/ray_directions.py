"""Compiled part of a camera's rays: from directions to what the renderer asks of each ray, in one pass over them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled

LEVEL = -1e-7  # slope above which a ray never meets the floor
MIN_RUN = 1e-9
MAX_FLOOR_M = 1e3


class FlatRays(NamedTuple):
    """Where the results go: (N,) float32 each, the rays of one pixel after one another."""

    #: (N,) float32: horizontal direction, and rise over run.
    cos: Float32Array
    sin: Float32Array
    slope: Float32Array
    #: (N,) float32: horizontal distance at which a ray meets the floor, metres; inf from the horizon on.
    floor_m: Float32Array
    #: (N,) float32: size on the floor of the patch a ray stands for, metres.
    radial_m: Float32Array
    tangential_m: Float32Array


@compiled(error_model="numpy")
def flatten_rays(
    height_m: float,
    order: npt.NDArray[np.intp],
    directions: FloatArray,
    radial_m: FloatArray,
    tangential_m: FloatArray,
    rays: FlatRays,
) -> float:
    """Write the rays of all pixels, sorted, and return how far bearings stray from their pixel's first one.

    Parameters
    ----------
    order : (P,) intp
        Index of the pixel that comes first, second, ...
    directions : (P, samples, 3) float64
        Unit directions, robot frame.
    radial_m, tangential_m : (P, samples) float64
        Sizes of patches, metres.
    rays : FlatRays
        Filled.

    Returns
    -------
    float
        Greatest angle between the bearings of a pixel's first ray and of another one, radians; pi if it is over pi/2.
    """
    samples = directions.shape[1]
    max_sine = 0.0
    is_ahead = True
    k = 0
    for pixel in order:
        first_x, first_y = directions[pixel, 0, 0], directions[pixel, 0, 1]
        first_run = max(math.hypot(first_x, first_y), MIN_RUN)
        for sample in range(samples):
            x, y, z = directions[pixel, sample, 0], directions[pixel, sample, 1], directions[pixel, sample, 2]
            run = max(math.hypot(x, y), MIN_RUN)
            slope = z / run
            rays.cos[k] = x / run
            rays.sin[k] = y / run
            rays.slope[k] = slope
            rays.floor_m[k] = height_m / -slope if slope < LEVEL else np.inf
            rays.radial_m[k] = radial_m[pixel, sample]
            rays.tangential_m[k] = tangential_m[pixel, sample]
            max_sine = max(max_sine, abs(first_x * y - first_y * x) / (first_run * run))
            is_ahead &= first_x * x + first_y * y > 0
            k += 1
    return math.asin(min(max_sine, 1.0)) if is_ahead else math.pi


@compiled(error_model="numpy")
def pinhole_patches(
    height_m: float,
    rays_per_rad: float,
    along_axis: FloatArray,
    directions: FloatArray,
    radial_m: FloatArray,
    tangential_m: FloatArray,
) -> None:
    """Write the sizes of the floor patches that a pinhole camera's rays stand for.

    Parameters
    ----------
    rays_per_rad : float
        Rays an angle of one radian on the optical axis; where the cosine to it is c there are 1 / c^2 times as many.
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
