"""Aligns proposed poses with the field's lines by robust Gauss-Newton steps; tilt and roll are unknowns, too.

The bank's poses are a quarter of a metre apart and have the tilt at rest. A few steps on the table of distances cost
little, and their costs rank the proposals far better than the scores of the bank.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.algebra.order import sort
from robocup_vision.kernels.model_edges.find import Bank

SIZE = 5  # x, y, heading, tilt, roll
FAR = 1e3  # residual in pixels of a point that lies beside the table of distances, or not on the floor
DROPPED = 1e9  # cost of a dropped pose; fast mathematics has no infinity


class Alignment(NamedTuple):
    """What poses are aligned with, and how.

    Parameters
    ----------
    rays : (N, 3) float64
        Unit vectors to the line points, ahead, left and up along the axes of the mounting.
    tilt_rad, roll_rad, height_m : float
        Tilt, roll and height of the camera at rest.
    std : (5,) float64
        Standard deviations of x, y, heading about a proposal, and of tilt and roll about rest.
    pixel_rad : float
        Angle of one pixel.
    gates_px : (G,) float64
        Scale of the robust weight in each step; the last one is that of the score too.
    uprights : (S, 8) float64
        Beacons and posts, see `sightings.sightings`; bearings and sizes are residuals like those of line points.
    ends : (E, 3) float64
        Where the carpet ends, in the form of `rays`: at the feet of walls, or of what stands before them.
    walls_m : (R, C) float32
        Distances from the walls' feet, in the form of `Bank.distance_m`.
    end_weight : float
        Weight of an end of the carpet, in line points.
    """

    rays: FloatArray
    tilt_rad: float
    roll_rad: float
    height_m: float
    std: FloatArray
    pixel_rad: float
    gates_px: FloatArray
    uprights: FloatArray
    ends: FloatArray
    walls_m: Float32Array
    end_weight: float


@compiled(fastmath=True, error_model="numpy")
def _weigh_points(
    rays: FloatArray,
    distance_m: Float32Array,
    grid: tuple[float, float, float],
    camera: tuple[float, float, float, float],
    pose: FloatArray,
    gate2: float,
    one_weight: float,
    system: FloatArray,
    step: FloatArray,
) -> float:
    """Add the points' normal equations to `system` (lower half) and `step`, and return their robust cost.

    A point costs 0 on a line and up to `one_weight` far from all lines.

    Parameters
    ----------
    rays : (N, 3) float64
        See `Alignment`.
    distance_m : (R, C) float32
        Distances from the nearest line, or wall.
    grid : (float, float, float)
        x and y of cell (0, 0)'s middle, and a cell's side.
    camera : (float, float, float, float)
        Tilt and roll at rest, height, angle of a pixel.
    pose : (5,) float64
        x, y, heading, and tilt and roll less those at rest.
    gate2 : float
        Square of the robust weight's scale, pixels.
    one_weight : float
        Weight of a point.
    system, step : (5, 5), (5,) float64
        Information and gradient, in and out.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ct, st = math.cos(camera[0] + pose[3]), math.sin(camera[0] + pose[3])
    cr, sr = math.cos(camera[1] + pose[4]), math.sin(camera[1] + pose[4])
    height, pixel = camera[2], camera[3]
    inverse, cell2 = 1.0 / grid[2], grid[2] * grid[2]
    px, py = (pose[0] - grid[0]) * inverse + 0.5, (pose[1] - grid[1]) * inverse + 0.5
    last_column, last_row = distance_m.shape[1] - 2, distance_m.shape[0] - 2
    far2 = FAR * FAR / gate2
    total = 0.0
    s00, s10, s11, s20, s21, s22, s30, s31 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    s32, s33, s40, s41, s42, s43, s44 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t0, t1, t2, t3, t4 = 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(rays.shape[0]):
        forward, a, b = rays[n, 0], rays[n, 1], rays[n, 2]
        left = cr * a - sr * b
        over = sr * a + cr * b
        ahead, up = ct * forward - st * over, st * forward + ct * over
        if up > -0.01:
            total += one_weight * far2 / (1.0 + far2)
            continue
        scale = -height / up
        x, y = ahead * scale, left * scale
        column, row = int(px + (c * x - s * y) * inverse), int(py + (s * x + c * y) * inverse)
        if column < 1 or row < 1 or column > last_column or row > last_row:
            total += one_weight * far2 / (1.0 + far2)
            continue
        u, v = np.uintp(column), np.uintp(row)
        one_cell = np.uintp(1)
        gx = 0.5 * inverse * (distance_m[v, u + one_cell] - distance_m[v, u - one_cell])
        gy = 0.5 * inverse * (distance_m[v + one_cell, u] - distance_m[v - one_cell, u])
        # the gradient in the robot's frame
        rx, ry = c * gx + s * gy, c * gy - s * gx
        # squared size on the floor of one pixel upwards and one pixel sideways
        away2 = x * x + y * y
        slant2 = away2 + height * height
        along, across = rx * x + ry * y, ry * x - rx * y
        upward2 = pixel * pixel * slant2 * slant2 / (height * height)
        aside2 = pixel * pixel * slant2
        px_per_m = 1.0 / math.sqrt((along * along * upward2 + across * across * aside2) / away2 + cell2)
        off = distance_m[v, u] * px_per_m
        root_weight = 1.0 / (1.0 + off * off / gate2)
        total += one_weight * (1.0 - root_weight)
        weight = one_weight * root_weight * root_weight
        factor2 = height / (up * up)
        r0, r1, r2 = gx * px_per_m, gy * px_per_m, (ry * x - rx * y) * px_per_m
        r3 = (rx * (up * up + ahead * ahead) + ry * left * ahead) * factor2 * px_per_m
        d_ahead, d_left, d_up = -st * left, -over, ct * left
        r4 = -(rx * (d_ahead * up - ahead * d_up) + ry * (d_left * up - left * d_up)) * factor2 * px_per_m
        w0, w1, w2, w3, w4 = weight * r0, weight * r1, weight * r2, weight * r3, weight * r4
        s00 += w0 * r0
        s10 += w1 * r0
        s11 += w1 * r1
        s20 += w2 * r0
        s21 += w2 * r1
        s22 += w2 * r2
        s30 += w3 * r0
        s31 += w3 * r1
        s32 += w3 * r2
        s33 += w3 * r3
        s40 += w4 * r0
        s41 += w4 * r1
        s42 += w4 * r2
        s43 += w4 * r3
        s44 += w4 * r4
        t0 += w0 * off
        t1 += w1 * off
        t2 += w2 * off
        t3 += w3 * off
        t4 += w4 * off
    system[0, 0] += s00
    system[1, 0] += s10
    system[1, 1] += s11
    system[2, 0] += s20
    system[2, 1] += s21
    system[2, 2] += s22
    system[3, 0] += s30
    system[3, 1] += s31
    system[3, 2] += s32
    system[3, 3] += s33
    system[4, 0] += s40
    system[4, 1] += s41
    system[4, 2] += s42
    system[4, 3] += s43
    system[4, 4] += s44
    step[0] -= t0
    step[1] -= t1
    step[2] -= t2
    step[3] -= t3
    step[4] -= t4
    return total


@compiled(fastmath=True, error_model="numpy", inline="always")
def _upright_residuals(how: Alignment, pose: FloatArray, n: int, rows: FloatArray) -> tuple[float, float]:
    """Bearing and size of a sighting less what a pose predicts, both in pixels, and their derivatives (2, 5)."""
    uprights = how.uprights
    best, dx, dy = 9.0, 0.0, 0.0
    for k in range(2):
        if k == 1 and uprights[n, 2] == uprights[n, 0] and uprights[n, 3] == uprights[n, 1]:
            break
        ex, ey = uprights[n, 2 * k] - pose[0], uprights[n, 2 * k + 1] - pose[1]
        turn = math.atan2(ey, ex) - pose[2] - uprights[n, 4]
        turn -= math.tau * math.floor((turn + math.pi) / math.tau)
        if abs(turn) < abs(best):
            best, dx, dy = turn, ex, ey
    away2 = max(dx * dx + dy * dy, 0.01)
    away = math.sqrt(away2)
    size = uprights[n, 5] / (how.pixel_rad * away * math.cos(uprights[n, 4]))
    for j in range(SIZE):
        rows[0, j], rows[1, j] = 0.0, 0.0
    rows[0, 0], rows[0, 1] = dy / (away2 * how.pixel_rad), -dx / (away2 * how.pixel_rad)
    rows[0, 2] = -1.0 / how.pixel_rad
    rows[1, 0], rows[1, 1] = size * dx / away2, size * dy / away2
    return best / how.pixel_rad, size - uprights[n, 6]


@compiled(fastmath=True, error_model="numpy", inline="always")
def _work_arrays() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return scratch arrays: derivatives of a sighting's residuals, system and step."""
    return np.zeros((2, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE)


@compiled(fastmath=True, error_model="numpy")
def _advance(
    bank: Bank,
    how: Alignment,
    rays: FloatArray,
    start: FloatArray,
    gate_px: float,
    moves: bool,
    work: tuple[FloatArray, FloatArray, FloatArray],
    pose: FloatArray,
) -> float:
    """Return the cost of a pose for some line points, and then move it by one step in place if `moves` is true."""
    rows, system, step = work
    grid = (bank.origin_m[0], bank.origin_m[1], bank.cell_m)
    camera = (how.tilt_rad, how.roll_rad, how.height_m, how.pixel_rad)
    gate2 = gate_px**2
    for i in range(SIZE):
        at = pose[i] - (start[i] if i < 3 else 0.0)
        for j in range(SIZE):
            system[i, j] = 0.0
        system[i, i] = 1.0 / (how.std[i] * how.std[i])
        step[i] = -at * system[i, i]
    cost = 0.5 * ((pose[3] / how.std[3]) ** 2 + (pose[4] / how.std[4]) ** 2)
    cost += _weigh_points(rays, bank.distance_m, grid, camera, pose, gate2, 1.0, system, step)
    if how.ends.shape[0]:
        cost += _weigh_points(how.ends, how.walls_m, grid, camera, pose, gate2, how.end_weight, system, step)
    for n in range(how.uprights.shape[0]):
        aside, larger = _upright_residuals(how, pose, n, rows)
        for k in range(2):
            off = aside if k == 0 else larger
            root_weight = 1.0 / (1.0 + off * off / gate2)
            cost += how.uprights[n, 7] * (1.0 - root_weight)
            weight = how.uprights[n, 7] * root_weight * root_weight
            for i in range(SIZE):
                step[i] -= weight * rows[k, i] * off
                for j in range(i + 1):
                    system[i, j] += weight * rows[k, i] * rows[k, j]
    if not moves:
        return float(cost)
    for i in range(SIZE):
        for j in range(i):
            system[j, i] = system[i, j]
    if factor(system, SIZE):
        substitute(system, SIZE, step)
        for i in range(SIZE):
            pose[i] += step[i]
    return float(cost)


@compiled(fastmath=True, error_model="numpy")
def align_poses(
    bank: Bank,
    how: Alignment,
    starts: FloatArray,
    likely: int,
    poses: FloatArray,
    costs: FloatArray,
) -> None:
    """Align poses and return their costs; from the second step on, each step drops the costlier half of them.

    Parameters
    ----------
    bank : Bank
        Its table of distances from lines.
    how : Alignment
        Points, and numbers of the fit.
    starts : (M, 3) float64
        x, y, heading.
    poses : (M, 5) float64
        Result: x, y, heading, and tilt and roll less those at rest.
    likely : int
        Number of poses that are never dropped.
    costs : (M,) float64
        Result: robust cost of the points, each up to its weight, plus half of the squared distance of tilt and roll
        from rest in standard deviations; `DROPPED` for dropped poses.
    """
    count, iterations = starts.shape[0], how.gates_px.shape[0]
    work, order = _work_arrays(), np.empty(count)
    for m in range(count):
        for j in range(SIZE):
            poses[m, j] = starts[m, j] if j < 3 else 0.0
        costs[m] = 0.0
    left = count
    for iteration in range(iterations + 1):
        gate_px = how.gates_px[min(iteration, iterations - 1)]
        # every other point is enough for the first step, as their order is random
        rays = how.rays[: (how.rays.shape[0] + 1) // 2] if iteration == 0 else how.rays
        is_halved = 0 < iteration < iterations and left > likely
        number = 0
        for m in range(count):
            if costs[m] == DROPPED:
                continue
            costs[m] = _advance(bank, how, rays, starts[m], gate_px, iteration < iterations, work, poses[m])
            order[number] = costs[m]
            number += 1
        if is_halved:
            sort(order[:number])
            left = max(likely, number // 2)
            limit = order[left - 1]
            for m in range(count):
                if costs[m] > limit:
                    costs[m] = DROPPED


def rays_to(rows: FloatArray, tilt_rad: float, roll_rad: float, height_m: float) -> FloatArray:
    """Return the unit rays (N, 3) of `Alignment` to line points at places on the floor.

    Parameters
    ----------
    rows : (N, 3) float64
        Forward and left of the camera's foot, metres, as `find.floor_places` returns them.
    tilt_rad, roll_rad, height_m : float
        Tilt, roll and height of the camera by which the places were computed.
    """
    ct, st, cr, sr = math.cos(tilt_rad), math.sin(tilt_rad), math.cos(roll_rad), math.sin(roll_rad)
    x, y = rows[:, 0], rows[:, 1]
    over = -st * x - ct * height_m
    rays = np.stack([ct * x - st * height_m, cr * y + sr * over, cr * over - sr * y], axis=1)
    return np.ascontiguousarray(rays / np.sqrt((rays**2).sum(axis=1, keepdims=True)))
