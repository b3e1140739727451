"""Compiled loops of the search for a floor outline over the whole field: a bank of places, and starts spread apart."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    WallScene,
    cost_of,
    room_for,
    settle,
    thinned,
)


@compiled(fastmath={"contract"})
def score_bank(
    bank: Float32Array, radius: Float32Array, weight: Float32Array, width_px: np.float32, out: Float32Array
) -> None:
    """Compare a measured outline with the outlines expected at many places, at every heading.

    Parameters
    ----------
    bank : (P, 2 B) float32
        Expected image radius at B evenly spaced bearings from 0 on clockwise, for heading 0, twice over.
    radius : (B,) float32
        Measured image radius, bearings from 0 on counter-clockwise; any finite number where there is none.
    weight : (B,) float32
        One over the number of measured bearings where there is one, 0 elsewhere.
    width_px : float32
        Differences beyond this count as this.
    out : (P, B) float32
        Filled with the mean cost, 0 to 1, of place p with the heading of minus shift times the bearings' step.
    """
    count = radius.shape[0]
    part = weight / width_px
    for p in range(bank.shape[0]):
        row = out[p]
        for shift in range(count):
            row[shift] = np.float32(0.0)
        # headings side by side: the processor adds eight at once
        for b in range(count):
            if part[b] == 0.0:
                continue
            expected = bank[p, count - b : 2 * count - b]
            for shift in range(count):
                row[shift] += part[b] * min(abs(radius[b] - expected[shift]), width_px)


@compiled
def spread_poses(poses: FloatArray, apart: float, out: Int64Array) -> int:
    """Pick the best poses that are apart from those picked before, and from their half turns.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y, theta, the best first; metres, radians.
    apart : float
        Poses differ by more than this: by the distance, metres, and the angle, radians, added.
    out : (M,) int64
        Filled with the indices of up to M poses.

    Returns
    -------
    int
        How many.
    """
    count, turn = 0, 2.0 * math.pi
    for n in range(poses.shape[0]):
        if count == out.shape[0]:
            break
        x, y, theta = poses[n, 0], poses[n, 1], poses[n, 2]
        nearest = np.inf
        for k in range(count):
            other = out[k]
            turned = theta - poses[other, 2]
            turned = abs(turned - turn * np.rint(turned / turn))
            here = math.hypot(x - poses[other, 0], y - poses[other, 1]) + turned
            there = math.hypot(x + poses[other, 0], y + poses[other, 1]) + (math.pi - turned)
            nearest = min(here, there)
            if nearest <= apart:
                break
        if nearest > apart:
            out[count] = n
            count += 1
    return count


@compiled
def fit_each(
    poses: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    out_poses: FloatArray,
    out_costs: FloatArray,
) -> None:
    """Fit each start by itself, as `settle` does; fills out_poses (N, 3) and out_costs (N,)."""
    fine = Comparison(scene, outline, room_for(scene))
    thin = thinned(fine)
    for n in range(poses.shape[0]):
        copy_vector(poses[n], out_poses[n])
        settle(out_poses[n], fine, thin)
        out_costs[n] = cost_of(fine)
