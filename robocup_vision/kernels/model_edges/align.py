"""Moves proposed poses to where the line points lie on the field's lines, tilt and roll included.

A bank's poses are a quarter of a metre apart and know nothing of the nod. A few robust steps on the table of distances
cost little, and order the proposals far better than the bank alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.model_edges.find import Bank, upright_mismatch

SIZE = 5  # x, y, heading, tilt, roll
FAR = 1e3  # pixels, of a point beside the field


class Alignment(NamedTuple):
    """How poses are moved.

    Parameters
    ----------
    slopes : (N, 2) float64
        Line points as left and up of the optical axis, over the depth.
    tilt_rad, roll_rad, height_m : float
        Of the camera at rest.
    std : (5,) float64
        Of x, y, heading about a proposal, of tilt and roll about rest.
    pixel_rad : float
        Angle of one pixel.
    gates_px : (G,) float64
        Scale of the robust weight in each step; the last one is that of the score too.
    """

    slopes: FloatArray
    tilt_rad: float
    roll_rad: float
    height_m: float
    std: FloatArray
    pixel_rad: float
    gates_px: FloatArray


@compiled(fastmath=True, error_model="numpy", inline="always")
def _residual(
    bank: Bank, how: Alignment, pose: FloatArray, turned: FloatArray, n: int, row: FloatArray
) -> tuple[float, bool]:
    """Distance of a line point from the nearest line in pixels of the picture, and its derivatives."""
    c, s, ct, st, cr, sr = turned[0], turned[1], turned[2], turned[3], turned[4], turned[5]
    a, b = how.slopes[n, 0], how.slopes[n, 1]
    left = cr * a - sr * b
    over = sr * a + cr * b
    ahead, up = ct - st * over, st + ct * over
    if up > -0.01:
        return FAR, False
    scale = -how.height_m / up
    x, y = ahead * scale, left * scale
    away2 = x * x + y * y
    fx, fy = pose[0] + c * x - s * y, pose[1] + s * x + c * y
    inverse = 1.0 / bank.cell_m
    column = int((fx - bank.origin_m[0]) * inverse + 0.5)
    line = int((fy - bank.origin_m[1]) * inverse + 0.5)
    if column < 1 or line < 1 or column > bank.distance_m.shape[1] - 2 or line > bank.distance_m.shape[0] - 2:
        return FAR, False
    away = float(bank.distance_m[line, column])
    gx = 0.5 * inverse * (bank.distance_m[line, column + 1] - bank.distance_m[line, column - 1])
    gy = 0.5 * inverse * (bank.distance_m[line + 1, column] - bank.distance_m[line - 1, column])
    # the same in the robot's frame
    rx, ry = c * gx + s * gy, c * gy - s * gx
    # one pixel up and one aside on the floor
    distance = math.sqrt(away2)
    along = (rx * x + ry * y) / distance
    across = (ry * x - rx * y) / distance
    slant2 = away2 + how.height_m * how.height_m
    upward = how.pixel_rad * slant2 / how.height_m
    aside = how.pixel_rad * math.sqrt(slant2)
    one = math.sqrt((along * upward) ** 2 + (across * aside) ** 2 + bank.cell_m * bank.cell_m)
    row[0], row[1] = gx / one, gy / one
    row[2] = (rx * -y + ry * x) / one
    factor2 = how.height_m / (up * up)
    row[3] = (rx * (up * up + ahead * ahead) + ry * left * ahead) * factor2 / one
    d_ahead, d_left, d_up = -st * left, -over, ct * left
    row[4] = -(rx * (d_ahead * up - ahead * d_up) + ry * (d_left * up - left * d_up)) * factor2 / one
    return away / one, True


@compiled(fastmath=True, error_model="numpy", inline="always")
def _turned(how: Alignment, pose: FloatArray, out: FloatArray) -> None:
    out[0], out[1] = math.cos(pose[2]), math.sin(pose[2])
    out[2], out[3] = math.cos(how.tilt_rad + pose[3]), math.sin(how.tilt_rad + pose[3])
    out[4], out[5] = math.cos(how.roll_rad + pose[4]), math.sin(how.roll_rad + pose[4])


@compiled(fastmath=True, error_model="numpy")
def align(bank: Bank, how: Alignment, start: FloatArray, pose: FloatArray) -> float:
    """Move one pose to the line points.

    Parameters
    ----------
    bank : Bank
        Its table of distances from lines.
    how : Alignment
        Points and numbers.
    start : (3,) float64
        x, y, heading.
    pose : (5,) float64
        Result: x, y, heading, and tilt and roll less those at rest.

    Returns
    -------
    float
        Points that are off, each up to 1, and half of the squared distance of tilt and roll from rest.
    """
    number = how.slopes.shape[0]
    for j in range(SIZE):
        pose[j] = start[j] if j < 3 else 0.0
    row, turned = np.zeros(SIZE), np.empty(6)
    system, step = np.empty((SIZE, SIZE)), np.empty(SIZE)
    for turn in range(how.gates_px.shape[0]):
        gate2 = how.gates_px[turn] ** 2
        _turned(how, pose, turned)
        for i in range(SIZE):
            at = pose[i] - (start[i] if i < 3 else 0.0)
            for j in range(SIZE):
                system[i, j] = 0.0
            system[i, i] = 1.0 / (how.std[i] * how.std[i])
            step[i] = -at * system[i, i]
        for n in range(number):
            off, counts = _residual(bank, how, pose, turned, n, row)
            if not counts:
                continue
            weight = 1.0 / (1.0 + off * off / gate2) ** 2
            for i in range(SIZE):
                part = weight * row[i]
                step[i] -= part * off
                for j in range(i + 1):
                    system[i, j] += part * row[j]
        for i in range(SIZE):
            for j in range(i):
                system[j, i] = system[i, j]
        if not factor(system, SIZE):
            break
        substitute(system, SIZE, step)
        for i in range(SIZE):
            pose[i] += step[i]
    gate2 = how.gates_px[how.gates_px.shape[0] - 1] ** 2
    _turned(how, pose, turned)
    cost = 0.5 * ((pose[3] / how.std[3]) ** 2 + (pose[4] / how.std[4]) ** 2)
    for n in range(number):
        off, _ = _residual(bank, how, pose, turned, n, row)
        square = off * off / gate2
        cost += square / (1.0 + square)
    return float(cost)


@compiled(fastmath=True, error_model="numpy")
def align_all(
    bank: Bank,
    how: Alignment,
    seen: FloatArray,
    upright_weight: float,
    starts: FloatArray,
    poses: FloatArray,
    costs: FloatArray,
) -> None:
    """Move poses and score them; the smaller the cost the better.

    Parameters
    ----------
    bank, how
        See `align`.
    seen : (K, BINS + 1) float64
        As `find.upright_bins` returns.
    upright_weight : float
        Of a bearing bin that is wrong, in line points.
    starts : (M, 3) float64
        x, y, heading.
    poses : (M, 5) float64
        Result, see `align`.
    costs : (M,) float64
        Result.
    """
    for m in range(starts.shape[0]):
        costs[m] = align(bank, how, starts[m], poses[m])
        costs[m] += upright_weight * upright_mismatch(bank, seen, poses[m, 0], poses[m, 1], poses[m, 2])


def slopes_of(rows: FloatArray, tilt_rad: float, roll_rad: float, height_m: float) -> FloatArray:
    """Return the line points that lie at places of the floor as `Alignment` takes them.

    Parameters
    ----------
    rows : (N, 3) float64
        Forward and left of the camera's foot, metres, as `find.floor_places` returns them.
    tilt_rad, roll_rad, height_m : float
        Of the camera that they were worked out for.
    """
    ct, st, cr, sr = math.cos(tilt_rad), math.sin(tilt_rad), math.cos(roll_rad), math.sin(roll_rad)
    depth = ct * rows[:, 0] - st * height_m
    left, over = rows[:, 1], -st * rows[:, 0] - ct * height_m
    return np.ascontiguousarray(np.stack([(cr * left + sr * over) / depth, (cr * over - sr * left) / depth], axis=1))
