"""Compiled matching of expected landmarks with the features of an image."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled


class Described(NamedTuple):
    """Descriptors, pixels and sizes of landmarks or features.

    descriptors, pixels, size_px : (N, D) unit vectors, (N, 2) measured or expected pixels, (N,) diameters.
    """

    descriptors: Float32Array
    pixels: FloatArray
    size_px: FloatArray


@compiled
def best_two(
    landmarks: Described, features: Described, gate_px: tuple[float, float], size_ratio: float
) -> tuple[Int64Array, Float32Array, Float32Array]:
    """Find the nearest and second nearest descriptor of each landmark, in a window around its expected pixel.

    gate_px : half sizes of the window along u and v.
    size_ratio : greatest ratio of their diameters.

    Returns (N,) of each landmark: index of the nearest, its inner product and that of the second nearest; products are
    -1 if there is none.
    """
    first, second = landmarks.descriptors, features.descriptors
    count, length = first.shape[0], first.shape[1]
    best = np.zeros(count, dtype=np.int64)
    nearest = np.full(count, -1.0, dtype=np.float32)
    runner_up = np.full(count, -1.0, dtype=np.float32)
    for n in range(count):
        low, high = landmarks.size_px[n] / size_ratio, landmarks.size_px[n] * size_ratio
        for m in range(second.shape[0]):
            if math.fabs(landmarks.pixels[n, 0] - features.pixels[m, 0]) > gate_px[0]:
                continue
            if math.fabs(landmarks.pixels[n, 1] - features.pixels[m, 1]) > gate_px[1]:
                continue
            if features.size_px[m] < low or features.size_px[m] > high:
                continue
            product = np.float32(0.0)
            for k in range(length):
                product += first[n, k] * second[m, k]
            if product > nearest[n]:
                runner_up[n] = nearest[n]
                nearest[n] = product
                best[n] = m
            elif product > runner_up[n]:
                runner_up[n] = product
    return best, nearest, runner_up
