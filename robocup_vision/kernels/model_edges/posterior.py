"""Converts a fit into the unknowns' own units: its covariance, and the pose's information by the frame alone.

A fit is made in standard normal unknowns z: unknowns p = mean + root z, with the lower triangular root of the prior.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.model_edges.tables import UNKNOWNS, FloatArray

POSE = 3  # x, y and heading lead the unknowns
REST = UNKNOWNS - POSE
SWEEPS = 6  # sweeps of Jacobi rotations: the rest beside the diagonal of a 3 x 3 matrix is then below rounding


@compiled(fastmath=True, error_model="numpy")
def covariance_with_prior(root: FloatArray, information: FloatArray, covariance: FloatArray) -> bool:
    """Fill in root (I + information)^-1 root^T; returns whether the system is positive definite.

    Parameters
    ----------
    root : (7, 7) float64
        Root of the prior's covariance; only its lower triangle is read.
    information : (7, 7) float64
        Information about z by the measurements alone.
    covariance : (7, 7) float64
        Result: covariance of the unknowns.
    """
    size = UNKNOWNS
    system, column = np.empty((size, size)), np.empty(size)
    for i in range(size):
        for j in range(size):
            system[i, j] = information[i, j]
        system[i, i] += 1.0
    if not factor(system, size):
        return False
    for i in range(size):
        for j in range(size):
            column[j] = root[i, j] if j <= i else 0.0
        substitute(system, size, column)
        for k in range(size):
            total = 0.0
            for j in range(k + 1):
                total += root[k, j] * column[j]
            covariance[k, i] = total
    return True


@compiled(fastmath=True, error_model="numpy")
def pose_alone(
    root: FloatArray,
    z: FloatArray,
    information: FloatArray,
    gradient: FloatArray,
    pose_information: FloatArray,
    pose_gradient: FloatArray,
) -> bool:
    """Fill in information and gradient of x, y and heading by the measurements alone; the rest keeps its prior.

    Returns whether the system of the other unknowns is positive definite.

    Parameters
    ----------
    root : (7, 7) float64
        Root of the prior's covariance, lower triangular.
    z : (7,) float64
        The fit.
    information : (7, 7) float64
        Information about z by the measurements alone.
    gradient : (7,) float64
        Gradient of the measurements' log-likelihood by z, at the fit.
    pose_information : (3, 3) float64
        Result: information about x, y and heading.
    pose_gradient : (3,) float64
        Result: gradient of that log-likelihood by them.
    """
    marginal, slope = np.empty((POSE, POSE)), np.empty(POSE)
    if not _leave_out_rest(z, information, gradient, marginal, slope):
        return False
    # z = root^-1 (p - prior): rows of root^-T from the pose's block, which is the leading one
    inverse = np.zeros((POSE, POSE))
    for j in range(POSE):
        for i in range(j, POSE):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= root[i, k] * inverse[k, j]
            inverse[i, j] = total / root[i, i]
    cross = np.empty((POSE, POSE))
    for i in range(POSE):
        total = 0.0
        for k in range(POSE):
            total += inverse[k, i] * slope[k]
        pose_gradient[i] = total
        for j in range(POSE):
            cross[i, j] = 0.0
            for k in range(POSE):
                cross[i, j] += marginal[i, k] * inverse[k, j]
    for i in range(POSE):
        for j in range(POSE):
            total = 0.0
            for k in range(POSE):
                total += inverse[k, i] * cross[k, j]
            pose_information[i, j] = total
    return True


@compiled(fastmath=True, error_model="numpy")
def _leave_out_rest(
    z: FloatArray, information: FloatArray, gradient: FloatArray, marginal: FloatArray, slope: FloatArray
) -> bool:
    """Fill in information (3, 3) and gradient (3,) of the pose's z by Schur's complement; the rest's prior stays in."""
    rest, part = np.empty((REST, REST)), np.empty(REST)
    for i in range(REST):
        for j in range(REST):
            rest[i, j] = information[POSE + i, POSE + j]
        rest[i, i] += 1.0
    if not factor(rest, REST):
        return False
    for i in range(POSE):
        for k in range(REST):
            part[k] = information[i, POSE + k]
        substitute(rest, REST, part)
        for j in range(POSE):
            total = information[i, j]
            for k in range(REST):
                total -= part[k] * information[j, POSE + k]
            marginal[i, j] = total
        total = gradient[i]
        for k in range(REST):
            total -= part[k] * (gradient[POSE + k] - z[POSE + k])
        slope[i] = total
    return True


@compiled(fastmath=True, error_model="numpy")
def position_std(information: FloatArray) -> float:
    """Return the greatest standard deviation (m) of the position by an information matrix (3, 3); at most 9.

    The heading is marginalised without a prior.
    """
    turn = max(information[2, 2], 1e-9)
    a = information[0, 0] - information[0, 2] * information[0, 2] / turn
    b = information[0, 1] - information[0, 2] * information[1, 2] / turn
    c = information[1, 1] - information[1, 2] * information[1, 2] / turn
    least = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
    return 1.0 / math.sqrt(max(least, 1.0 / 81.0))


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
    """Return the step from a fit to the estimate by the frame alone; an open direction keeps the fit's value.

    Parameters
    ----------
    information : (3, 3) float64
        Information about x (m), y (m) and heading (rad) without the prior; may be singular.
    gradient : (3,) float64
        Gradient of the log-likelihood at the fit.
    open_std : float
        A direction with a greater standard deviation is open; one radian counts as one metre.
    covariance : (3, 3) float64
        Result: covariance by the frame alone; open directions have this standard deviation.

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
