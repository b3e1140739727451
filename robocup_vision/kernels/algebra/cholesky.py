"""Solution and inversion of small positive definite systems by Cholesky's factorisation, in place."""

from __future__ import annotations

import math

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


@compiled
def factor(matrix: FloatArray, n: int) -> bool:
    """Factor the leading (n, n) block in place, lower triangle; returns False if it is not positive definite."""
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] ** 2
        if not matrix[j, j] > 0.0:
            return False
        matrix[j, j] = math.sqrt(matrix[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    return True


@compiled
def substitute(lower: FloatArray, n: int, right: FloatArray) -> None:
    """Solve in place with the factor in the leading (n, n) block of `lower`."""
    for i in range(n):
        for k in range(i):
            right[i] -= lower[i, k] * right[k]
        right[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= lower[k, i] * right[k]
        right[i] /= lower[i, i]


@compiled
def solve_symmetric(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve a small positive definite system in place; returns False if the matrix is not positive definite."""
    n = right.shape[0]
    if not factor(matrix, n):
        return False
    substitute(matrix, n, right)
    return True


@compiled
def invert(matrix: FloatArray, inverse: FloatArray) -> bool:
    """Write the inverse of a small positive definite matrix, overwritten by its factor; returns False on failure."""
    n = matrix.shape[0]
    if not factor(matrix, n):
        return False
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 1.0 if i == j else 0.0
        substitute(matrix, n, inverse[i])
    return True
