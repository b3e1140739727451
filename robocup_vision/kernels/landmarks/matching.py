"""Compiled matching of expected landmarks with an image's features, landmark by landmark."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array


@njit(cache=True, nogil=True)
def best_two(
    first: Float32Array,
    first_px: FloatArray,
    first_size: FloatArray,
    second: Float32Array,
    second_px: FloatArray,
    second_size: FloatArray,
    gate_u: float,
    gate_v: float,
    size_ratio: float,
) -> tuple[Int64Array, Float32Array, Float32Array]:
    """Find each landmark's nearest and second nearest descriptor in a window around where it is expected.

    Parameters
    ----------
    first, second : (N, D), (M, D) float32
        Unit descriptors of landmarks and of features.
    first_px, second_px : (N, 2), (M, 2) float64
        Where they are expected, and where they are.
    first_size, second_size : (N,), (M,) float64
        Their diameters, pixels.
    gate_u, gate_v : float
        Half the window, pixels.
    size_ratio : float
        Diameters may differ by this factor.

    Returns
    -------
    (N,) int64, (N,) float32, (N,) float32
        The nearest, its inner product and that of the second nearest; -1 where there is none.
    """
    count, length = first.shape[0], first.shape[1]
    best = np.zeros(count, dtype=np.int64)
    nearest = np.full(count, -1.0, dtype=np.float32)
    runner_up = np.full(count, -1.0, dtype=np.float32)
    for n in range(count):
        low, high = first_size[n] / size_ratio, first_size[n] * size_ratio
        for m in range(second.shape[0]):
            if math.fabs(first_px[n, 0] - second_px[m, 0]) > gate_u:
                continue
            if math.fabs(first_px[n, 1] - second_px[m, 1]) > gate_v:
                continue
            if second_size[m] < low or second_size[m] > high:
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
