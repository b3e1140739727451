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
            expected = bank[p, count - b : 2 * count - b]
            for shift in range(count):
                row[shift] += part[b] * min(abs(radius[b] - expected[shift]), width_px)


@compiled
def is_apart(pose: FloatArray, others: FloatArray, apart: float) -> bool:
    """Whether a pose (3,) differs from all others (N, 3), and their half turns, by more than `apart`.

    The difference is the distance, metres, and the angle, radians, added.
    """
    for n in range(others.shape[0]):
        turned = abs(_wrapped(pose[2] - others[n, 2]))
        here = math.hypot(pose[0] - others[n, 0], pose[1] - others[n, 1]) + turned
        there = math.hypot(pose[0] + others[n, 0], pose[1] + others[n, 1]) + (math.pi - turned)
        if min(here, there) <= apart:
            return False
    return True


@compiled
def _wrapped(angle: float) -> float:
    """Return the same direction within half a turn of 0."""
    return float(angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi)))


@compiled
def spread_starts(places: FloatArray, best: Int64Array, bearings: int, apart: float, out: FloatArray) -> int:
    """Take the best places and headings that are apart from those taken before.

    Parameters
    ----------
    places : (P, 2) float64
        Of the bank, metres.
    best : (N,) int64
        Indices into the costs of `score_bank`, the best first.
    bearings : int
        Number B of the bank's bearings.
    apart : float
        See `is_apart`.
    out : (M, 3) float64
        Filled with x, y and theta of up to M poses.

    Returns
    -------
    int
        How many.
    """
    count = 0
    for n in range(best.shape[0]):
        if count == out.shape[0]:
            break
        place, shift = best[n] // bearings, best[n] % bearings
        out[count, 0], out[count, 1] = places[place, 0], places[place, 1]
        out[count, 2] = -shift * (2.0 * math.pi) / bearings
        if is_apart(out[count], out[:count], apart):
            count += 1
    return count


@compiled
def spread_poses(poses: FloatArray, apart: float, out: FloatArray) -> int:
    """Take the best poses (N, 3), which come first, that are apart from those taken before; see `spread_starts`."""
    count = 0
    for n in range(poses.shape[0]):
        if count == out.shape[0]:
            break
        if is_apart(poses[n], out[:count], apart):
            copy_vector(poses[n], out[count])
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
