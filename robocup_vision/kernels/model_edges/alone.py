"""What a frame alone says of a pose that was fitted with a prior: the prior's part taken out again."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

SWEEPS = 6  # of Jacobi's rotations: what is left beside the diagonal of three rows is then below rounding


@compiled(error_model="numpy")
def eigen_3x3(matrix: FloatArray, vectors: FloatArray) -> None:
    """Diagonalise a symmetric matrix (3, 3) in place by Jacobi's rotations; `vectors` takes its axes as columns."""
    for i in range(3):
        for j in range(3):
            vectors[i, j] = 1.0 if i == j else 0.0
    for turn in range(3 * SWEEPS):
        p, q = (0, 1) if turn % 3 == 0 else (0, 2) if turn % 3 == 1 else (1, 2)
        if matrix[p, q] == 0.0:
            continue
        half = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
        t = math.copysign(1.0, half) / (abs(half) + math.sqrt(half * half + 1.0))
        c = 1.0 / math.sqrt(t * t + 1.0)
        s = t * c
        for k in range(3):
            a, b = matrix[k, p], matrix[k, q]
            matrix[k, p], matrix[k, q] = c * a - s * b, s * a + c * b
        for k in range(3):
            a, b = matrix[p, k], matrix[q, k]
            matrix[p, k], matrix[q, k] = c * a - s * b, s * a + c * b
            a, b = vectors[k, p], vectors[k, q]
            vectors[k, p], vectors[k, q] = c * a - s * b, s * a + c * b


@compiled(error_model="numpy")
def frame_alone(
    information: FloatArray, gradient: FloatArray, open_std: float, covariance: FloatArray
) -> tuple[float, float, float]:
    """Return the step from a fit to where the frame alone has it; a direction left open stays where it is.

    Parameters
    ----------
    information : (3, 3) float64
        Of x (m), y (m) and heading (rad), without the prior; may be singular.
    gradient : (3,) float64
        Of the log-likelihood at the fit.
    open_std : float
        A direction known to no less than this is open; a turn of one radian counts as a way of one metre.
    covariance : (3, 3) float64
        Result: of the frame alone, open directions with that error.

    Returns
    -------
    float, float, float
        Steps of x, y and heading.
    """
    left, axes, step = np.empty((3, 3)), np.empty((3, 3)), np.zeros(3)
    least = 1.0 / (open_std * open_std)
    for i in range(3):
        for j in range(3):
            left[i, j] = 0.5 * (information[i, j] + information[j, i])
            covariance[i, j] = 0.0
    eigen_3x3(left, axes)
    for k in range(3):
        value, slope = max(left[k, k], least), 0.0
        if left[k, k] >= least:
            for i in range(3):
                slope += axes[i, k] * gradient[i]
        for i in range(3):
            step[i] += axes[i, k] * slope / value
            for j in range(3):
                covariance[i, j] += axes[i, k] * axes[j, k] / value
    return step[0], step[1], step[2]
