"""Compiled copies of arrays, which compile half a second faster than numba's ``a[:] = b``."""

from __future__ import annotations

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


@compiled
def copy_vector(source: FloatArray, target: FloatArray) -> None:
    """Copy a vector into one of the same size."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def copy_matrix(source: FloatArray, target: FloatArray) -> None:
    """Copy a matrix into one of the same shape."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]
