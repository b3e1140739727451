"""Compiled matching of expected landmarks with an image's features, landmark by landmark."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled


class Described(NamedTuple):
    """What matching needs of landmarks or features.

    Parameters
    ----------
    descriptors : (N, D) float32
        Unit vectors.
    pixels : (N, 2) float64
        Where each is, or is expected.
    size_px : (N,) float64
        Diameter.
    """

    descriptors: Float32Array
    pixels: FloatArray
    size_px: FloatArray


@compiled
def best_two(
    landmarks: Described, features: Described, gate_px: tuple[float, float], size_ratio: float
) -> tuple[Int64Array, Float32Array, Float32Array]:
    """Find each landmark's nearest and second nearest descriptor in a window around where it is expected.

    Parameters
    ----------
    landmarks, features : Described
        N landmarks, M features.
    gate_px : (float, float)
        Half the window along u and v.
    size_ratio : float
        Diameters may differ by this factor.

    Returns
    -------
    (N,) int64, (N,) float32, (N,) float32
        The nearest, its inner product and that of the second nearest; -1 where there is none.
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
