"""Compiled pose fit to the pixels of landmarks, and greedy choice of the most informative landmarks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import invert, solve_symmetric
from robocup_vision.kernels.algebra.copies import copy_matrix, copy_vector
from robocup_vision.kernels.algebra.pinhole import PinholeView, ideal_pixel, point_in_camera


class LandmarkPixels(NamedTuple):
    """Landmarks and their pixels in a frame.

    positions_m, covariances : (N, 3), (N, 3, 3) float64, field frame.
    pixels, std_px : (N, 2), (N,) float64, ideal pixels and their standard deviations.
    """

    positions_m: FloatArray
    covariances: FloatArray
    pixels: FloatArray
    std_px: FloatArray


class Linearised(NamedTuple):
    """A landmark's predicted pixel (2,), its derivative (2, 3) by the pose, and the residual's inverse covariance."""

    pixel: FloatArray
    jacobian: FloatArray
    weight: FloatArray


@compiled
def linearise(
    view: PinholeView,
    pose: FloatArray,
    landmark: FloatArray,
    covariance: FloatArray,
    std_px: float,
    out: Linearised,
) -> bool:
    """Write a landmark's predicted pixel, its derivative by the pose and its inverse covariance.

    pose : (3,) x, y, theta of the robot.
    landmark, covariance : (3,) and (3, 3), field frame.
    std_px : noise of the pixel.

    Returns False if the landmark is behind the camera.
    """
    turn, focal = view.robot_to_camera, view.focal_px
    jacobian, weight = out.jacobian, out.weight
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = landmark[0] - pose[0], landmark[1] - pose[1]
    x, y, z = point_in_camera(view, c, s, dx, dy, landmark[2])
    if x < 0.05:
        return False
    out.pixel[0], out.pixel[1] = ideal_pixel(focal[0], focal[1], view.center_px[0], view.center_px[1], x, y, z)
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


@compiled
def fit_pose(
    view: PinholeView,
    start: FloatArray,
    matches: LandmarkPixels,
    widths: FloatArray,
    bound: float,
    pose: FloatArray,
    squared: FloatArray,
) -> FloatArray:
    """Fit the pose by Gauss-Newton with redescending weights (Ogawa et al. 2011, eqs. 14 to 19).

    start : (3,) pose to start from.
    widths : (I,) widths of the weight function in each iteration, standard deviations.
    bound : greatest squared Mahalanobis distance of an inlier.
    pose, squared : (3,) and (N,); written: the pose, and the squared Mahalanobis distances there.

    Returns the inliers' normal matrix (3, 3).
    """
    out = Linearised(np.empty(2), np.empty((2, 3)), np.empty((2, 2)))
    jacobian, weight = out.jacobian, out.weight
    copy_vector(start, pose)
    normal = np.zeros((3, 3))
    for step in range(len(widths) + 1):
        final = step == len(widths)
        normal[:] = 0.0
        gradient = np.zeros(3)
        for n in range(matches.positions_m.shape[0]):
            if not linearise(view, pose, matches.positions_m[n], matches.covariances[n], matches.std_px[n], out):
                squared[n] = np.inf
                continue
            ru, rv = matches.pixels[n, 0] - out.pixel[0], matches.pixels[n, 1] - out.pixel[1]
            wu, wv = weight[0, 0] * ru + weight[0, 1] * rv, weight[1, 0] * ru + weight[1, 1] * rv
            squared[n] = ru * wu + rv * wv
            if final:
                counts = 1.0 if squared[n] <= bound else 0.0
            else:
                counts = 1.0 / (1.0 + squared[n] / widths[step] ** 2) ** 2
            for i in range(3):
                gradient[i] += counts * (jacobian[0, i] * wu + jacobian[1, i] * wv)
                bu = counts * (jacobian[0, i] * weight[0, 0] + jacobian[1, i] * weight[1, 0])
                bv = counts * (jacobian[0, i] * weight[0, 1] + jacobian[1, i] * weight[1, 1])
                for j in range(3):
                    normal[i, j] += bu * jacobian[0, j] + bv * jacobian[1, j]
        for i in range(3):
            normal[i, i] += 1e-9
        if not final and solve_symmetric(normal, gradient):
            for i in range(3):
                pose[i] += gradient[i]
    return normal


@compiled
def _whitened(
    view: PinholeView,
    pose: FloatArray,
    positions_m: FloatArray,
    covariances: FloatArray,
    std_px: FloatArray,
    success: FloatArray,
    rows: FloatArray,
) -> Int64Array:
    """Write whitened derivatives (N, 2, 3), weighted by the landmarks' probabilities; return the visible landmarks."""
    out = Linearised(np.empty(2), np.empty((2, 3)), np.empty((2, 2)))
    jacobian, weight = out.jacobian, out.weight
    seen = np.empty(positions_m.shape[0], dtype=np.int64)
    count = 0
    for n in range(positions_m.shape[0]):
        if not linearise(view, pose, positions_m[n], covariances[n], std_px[n], out):
            continue
        seen[count] = n
        count += 1
        # whitened by the Cholesky factor of the weight
        l00 = math.sqrt(weight[0, 0])
        l10 = weight[1, 0] / l00
        l11 = math.sqrt(max(weight[1, 1] - l10 * l10, 0.0))
        chance = math.sqrt(success[n])
        for j in range(3):
            rows[n, 0, j] = chance * (l00 * jacobian[0, j] + l10 * jacobian[1, j])
            rows[n, 1, j] = chance * l11 * jacobian[1, j]
    return seen[:count]


@compiled
def most_informative(
    view: PinholeView,
    pose: FloatArray,
    positions_m: FloatArray,
    covariances: FloatArray,
    std_px: FloatArray,
    success: FloatArray,
    information: FloatArray,
    count: int,
) -> Int64Array:
    """Choose landmarks greedily, each of which increases the log determinant of the pose's information most.

    pose : (3,) x, y, theta of the robot.
    positions_m, covariances, std_px : (N, 3), (N, 3, 3), (N,): the landmarks, and the noise of their pixels.
    success : (N,) probability that each is observed, by which its information is multiplied.
    information : (3, 3) prior information of the pose.

    Returns the indices (K,) of `count` landmarks at most, in the order of choice.
    """
    total = positions_m.shape[0]
    rows = np.zeros((total, 2, 3))
    left = np.zeros(total, dtype=np.bool_)
    left[_whitened(view, pose, positions_m, covariances, std_px, success, rows)] = True
    known, lower, inverse = information.copy(), np.empty((3, 3)), np.empty((3, 3))
    chosen = np.empty(min(count, total), dtype=np.int64)
    found = 0
    for _ in range(len(chosen)):
        copy_matrix(known, lower)
        if not invert(lower, inverse):
            break
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
