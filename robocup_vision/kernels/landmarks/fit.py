"""Compiled pose fit to a few landmarks' pixels, and the greedy choice of the most informative ones."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array


@njit(cache=True, nogil=True)
def linearise(
    pose: FloatArray,
    turn: FloatArray,
    viewpoint: FloatArray,
    focal: FloatArray,
    center: FloatArray,
    landmark: FloatArray,
    covariance: FloatArray,
    std_px: float,
    predicted: FloatArray,
    jacobian: FloatArray,
    weight: FloatArray,
) -> bool:
    """Write a landmark's pixel (2,), its derivative by the pose (2, 3) and its inverse covariance (2, 2).

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta of the robot.
    turn : (3, 3) float64
        Robot to camera frame.
    viewpoint : (3,) float64
        Of the camera in the robot frame.
    focal, center : (2,) float64
    landmark, covariance : (3,), (3, 3) float64
        In the field frame.
    std_px : float
        Noise of the pixel.
    predicted, jacobian, weight
        Written.

    Returns
    -------
    bool
        False if the landmark is behind the camera.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = landmark[0] - pose[0], landmark[1] - pose[1]
    rx, ry, rz = c * dx + s * dy, c * dy - s * dx, landmark[2]
    px, py, pz = rx - viewpoint[0], ry - viewpoint[1], rz - viewpoint[2]
    x = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
    y = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
    z = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
    if x < 0.05:
        return False
    predicted[0] = center[0] - focal[0] * y / x
    predicted[1] = center[1] - focal[1] * z / x
    by_world = np.empty((2, 3))
    for k in range(3):
        # derivative of the camera point by world coordinate k
        if k == 0:
            wx, wy, wz = c, -s, 0.0
        elif k == 1:
            wx, wy, wz = s, c, 0.0
        else:
            wx, wy, wz = 0.0, 0.0, 1.0
        cx = turn[0, 0] * wx + turn[0, 1] * wy + turn[0, 2] * wz
        cy = turn[1, 0] * wx + turn[1, 1] * wy + turn[1, 2] * wz
        cz = turn[2, 0] * wx + turn[2, 1] * wy + turn[2, 2] * wz
        by_world[0, k] = focal[0] * (y * cx / x - cy) / x
        by_world[1, k] = focal[1] * (z * cx / x - cz) / x
    for i in range(2):
        jacobian[i, 0] = -by_world[i, 0]
        jacobian[i, 1] = -by_world[i, 1]
        jacobian[i, 2] = by_world[i, 0] * dy - by_world[i, 1] * dx
    a = b = d = 0.0
    for j in range(3):
        for k in range(3):
            a += by_world[0, j] * covariance[j, k] * by_world[0, k]
            b += by_world[0, j] * covariance[j, k] * by_world[1, k]
            d += by_world[1, j] * covariance[j, k] * by_world[1, k]
    a += std_px * std_px
    d += std_px * std_px
    det = a * d - b * b
    weight[0, 0], weight[1, 1] = d / det, a / det
    weight[0, 1] = weight[1, 0] = -b / det
    return True


@njit(cache=True, nogil=True)
def descend(
    start: FloatArray,
    turn: FloatArray,
    viewpoint: FloatArray,
    focal: FloatArray,
    center: FloatArray,
    landmarks: FloatArray,
    covariances: FloatArray,
    pixels: FloatArray,
    std_px: FloatArray,
    widths: FloatArray,
    bound: float,
    pose: FloatArray,
    squared: FloatArray,
) -> FloatArray:
    """Fit the pose by Gauss-Newton with redescending weights; `pose_fit.fit_pixels` is its plain twin.

    Parameters
    ----------
    start : (3,) float64
    turn, viewpoint, focal, center
        As in `linearise`.
    landmarks, covariances : (N, 3), (N, 3, 3) float64
    pixels, std_px : (N, 2), (N,) float64
    widths : (I,) float64
        Of the weights in each iteration, standard deviations.
    bound : float
        Squared distances up to this are inliers.
    pose, squared : (3,), (N,) float64
        Written: the pose and the squared Mahalanobis distances there.

    Returns
    -------
    (3, 3) float64
        The inliers' normal matrix.
    """
    predicted, jacobian, weight = np.empty(2), np.empty((2, 3)), np.empty((2, 2))
    pose[:] = start
    normal = np.zeros((3, 3))
    for step in range(len(widths) + 1):
        final = step == len(widths)
        normal[:] = 0.0
        gradient = np.zeros(3)
        for n in range(landmarks.shape[0]):
            ahead = linearise(
                pose,
                turn,
                viewpoint,
                focal,
                center,
                landmarks[n],
                covariances[n],
                std_px[n],
                predicted,
                jacobian,
                weight,
            )
            if not ahead:
                squared[n] = np.inf
                continue
            ru, rv = pixels[n, 0] - predicted[0], pixels[n, 1] - predicted[1]
            wu, wv = weight[0, 0] * ru + weight[0, 1] * rv, weight[1, 0] * ru + weight[1, 1] * rv
            squared[n] = ru * wu + rv * wv
            if final:
                share = 1.0 if squared[n] <= bound else 0.0
            else:
                share = 1.0 / (1.0 + squared[n] / widths[step] ** 2) ** 2
            for i in range(3):
                gradient[i] += share * (jacobian[0, i] * wu + jacobian[1, i] * wv)
                bu = share * (jacobian[0, i] * weight[0, 0] + jacobian[1, i] * weight[1, 0])
                bv = share * (jacobian[0, i] * weight[0, 1] + jacobian[1, i] * weight[1, 1])
                for j in range(3):
                    normal[i, j] += bu * jacobian[0, j] + bv * jacobian[1, j]
        for i in range(3):
            normal[i, i] += 1e-9
        if not final:
            pose += np.linalg.solve(normal, gradient)
    return normal


@njit(cache=True, nogil=True)
def most_informative(
    pose: FloatArray,
    turn: FloatArray,
    viewpoint: FloatArray,
    focal: FloatArray,
    center: FloatArray,
    landmarks: FloatArray,
    covariances: FloatArray,
    std_px: FloatArray,
    success: FloatArray,
    information: FloatArray,
    count: int,
) -> Int64Array:
    """Choose landmarks greedily: each adds the most to the log determinant of the pose's information.

    Parameters
    ----------
    pose, turn, viewpoint, focal, center
        As in `linearise`.
    landmarks, covariances, std_px : (N, 3), (N, 3, 3), (N,) float64
    success : (N,) float64
        Chance that each is observed: what it would add counts by as much.
    information : (3, 3) float64
        What is known of the pose beforehand.
    count : int
        At most this many.

    Returns
    -------
    (K,) int64
        In the order chosen.
    """
    total = landmarks.shape[0]
    predicted, jacobian, weight = np.empty(2), np.empty((2, 3)), np.empty((2, 2))
    rows = np.zeros((total, 2, 3))
    left = np.ones(total, dtype=np.bool_)
    for n in range(total):
        left[n] = linearise(
            pose, turn, viewpoint, focal, center, landmarks[n], covariances[n], std_px[n], predicted, jacobian, weight
        )
        if not left[n]:
            continue
        # whitened by the Cholesky factor of the weight
        l00 = math.sqrt(weight[0, 0])
        l10 = weight[1, 0] / l00
        l11 = math.sqrt(max(weight[1, 1] - l10 * l10, 0.0))
        chance = math.sqrt(success[n])
        for j in range(3):
            rows[n, 0, j] = chance * (l00 * jacobian[0, j] + l10 * jacobian[1, j])
            rows[n, 1, j] = chance * l11 * jacobian[1, j]
    known = information.copy()
    chosen = np.empty(min(count, total), dtype=np.int64)
    found = 0
    for _ in range(len(chosen)):
        inverse = np.linalg.inv(known)
        best, most = -1, 0.0
        for n in range(total):
            if not left[n]:
                continue
            a = b = d = 0.0
            for i in range(3):
                for j in range(3):
                    a += rows[n, 0, i] * inverse[i, j] * rows[n, 0, j]
                    b += rows[n, 0, i] * inverse[i, j] * rows[n, 1, j]
                    d += rows[n, 1, i] * inverse[i, j] * rows[n, 1, j]
            gain = (1.0 + a) * (1.0 + d) - b * b
            if gain > most:
                best, most = n, gain
        if best < 0:
            break
        left[best] = False
        chosen[found] = best
        found += 1
        for k in range(2):
            for i in range(3):
                for j in range(3):
                    known[i, j] += rows[best, k, i] * rows[best, k, j]
    return chosen[:found]
