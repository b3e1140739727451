"""Systems of three equations by cofactors, which are faster in a loop than calls of LAPACK."""

from __future__ import annotations

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled


@compiled
def adjugate_3x3(matrix: FloatArray, out: FloatArray) -> float:
    """Write the adjugate (3, 3) of a matrix (3, 3), its inverse times its determinant; returns the determinant."""
    for i in range(3):
        for j in range(3):
            r0, r1, c0, c1 = (j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3
            out[i, j] = matrix[r0, c0] * matrix[r1, c1] - matrix[r0, c1] * matrix[r1, c0]
    return float(matrix[0, 0] * out[0, 0] + matrix[0, 1] * out[1, 0] + matrix[0, 2] * out[2, 0])


@compiled
def solve_3x3(matrix: FloatArray, right: FloatArray, work: FloatArray, out: FloatArray) -> bool:
    """Solve a symmetric positive definite system by Cramer's rule.

    matrix, right, work, out : (3, 3), (3,), (3, 3) overwritten, (3,) the result.

    Returns False if the determinant is not positive; then `out` is not written.
    """
    determinant = adjugate_3x3(matrix, work)
    if not determinant > 0.0:
        return False
    for k in range(3):
        out[k] = (right[0] * work[0, k] + right[1] * work[1, k] + right[2] * work[2, k]) / determinant
    return True
