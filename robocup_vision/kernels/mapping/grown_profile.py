"""Compiled growing of free ranges by the robot's radius: the profile in which its centre can move as a point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled

# bins of the grown profile (0.45 to 0.9 degrees), and coarser groups of them for long steps along trajectories;
# constants, so that the compiler divides by shifts
BINS = 512
FINE = 128
COARSE = 32


class Sectors(NamedTuple):
    """Sectors of J bearings, each of which extends half-way to its neighbours.

    units : (J, 4) float64, unit vectors (x, y) of the lower and the upper edge.
    bins : (J, 4) int64, profile bins of the edges, and whether the lower and the upper neighbour follow without a gap.
    """

    units: FloatArray
    bins: Int64Array


class Profile(NamedTuple):
    """A grown profile: how far the robot's centre may move in each direction.

    edges : (BINS + 1, 2) float64, unit vectors of the bins' edges.
    ranges : (BINS,) float64, metres; inf if nothing is ever touched.
    fine, coarse : (FINE,), (COARSE,) float64, smallest range over each group of bins and its two neighbours.
    """

    edges: FloatArray
    ranges: FloatArray
    fine: FloatArray
    coarse: FloatArray


@compiled(error_model="numpy")
def profile_bin(x: float, y: float) -> int:
    """Return the bin of the direction (x, y)."""
    # the diamond angle increases with the bearing and needs only one division
    along = y / (abs(x) + abs(y))
    if x < 0.0:
        along = 2.0 - along
    elif along < 0.0:
        along += 4.0
    index = int(along * (0.25 * BINS))
    return index if index < BINS else index - BINS


@compiled(error_model="numpy")
def measure_sectors(bearing: FloatArray, sectors: Sectors) -> bool:
    """Compute the sector of each bearing (J,), radians; returns False if they do not ascend within one turn.

    In a gap of more than 1.5 times the smallest spacing, a sector extends by half the smallest spacing; the rest of the
    gap is unseen.
    """
    count = bearing.shape[0]
    turn = 2.0 * np.pi
    spacing = turn
    for k in range(count):
        ahead = bearing[k + 1] - bearing[k] if k + 1 < count else bearing[0] + turn - bearing[k]
        if not ahead > 0.0:
            return False
        spacing = min(spacing, ahead)
    for k in range(count):
        for side in range(2):
            if side == 0:
                gap = bearing[k] - bearing[k - 1] if k > 0 else bearing[0] + turn - bearing[count - 1]
            else:
                gap = bearing[k + 1] - bearing[k] if k + 1 < count else bearing[0] + turn - bearing[k]
            joined = gap <= 1.5 * spacing
            half = 0.5 * (gap if joined else spacing)
            angle = bearing[k] - half if side == 0 else bearing[k] + half
            x, y = np.cos(angle), np.sin(angle)
            sectors.units[k, 2 * side] = x
            sectors.units[k, 2 * side + 1] = y
            sectors.bins[k, side] = profile_bin(x, y)
            sectors.bins[k, 2 + side] = 1 if joined else 0
    return True


@compiled(error_model="numpy")
def _widen(lows: FloatArray, count: int, out: FloatArray) -> None:
    """Write the smallest of each of the first `count` values and its two neighbours, cyclically."""
    for k in range(count):
        out[k] = min(lows[k], min(lows[k - 1 if k > 0 else count - 1], lows[k + 1 if k + 1 < count else 0]))


@compiled(error_model="numpy")
def grow_profile(range_m: FloatArray, sectors: Sectors, radius_m: float, profile: Profile) -> float:
    """Fill the grown profile: for each bin the least range of the centre at which a disc touches a sector or its end.

    range_m : (J,) metres; NaN is unseen: its own bins become 0, and nothing grows from it.
    radius_m : radius of the robot.
    profile : edges are read, the rest is written.

    Returns the smallest range of all.
    """
    count = range_m.shape[0]
    ranges = profile.ranges
    squared = radius_m * radius_m
    # bins that no sector covers are unseen; marked by -1 at first
    ranges[:] = -1.0
    for k in range(count):
        index = sectors.bins[k, 0]
        while True:
            ranges[index] = np.inf
            if index == sectors.bins[k, 1]:
                break
            index = index + 1 if index + 1 < BINS else 0
    for index in range(BINS):
        if ranges[index] < 0.0:
            ranges[index] = 0.0
    for k in range(count):
        reach = range_m[k]
        seen = not np.isnan(reach)
        reach = max(reach, radius_m) if seen else radius_m
        index = sectors.bins[k, 0]
        while True:
            ranges[index] = min(ranges[index], reach - radius_m)
            if index == sectors.bins[k, 1]:
                break
            index = index + 1 if index + 1 < BINS else 0
        if not seen or np.isinf(reach):
            continue
        for side in range(2):
            if sectors.bins[k, 2 + side] == 1:
                other = range_m[(k + 1) % count] if side == 1 else range_m[k - 1]
                # this end point is behind the nearer neighbour
                if other <= range_m[k]:
                    continue
            x = reach * sectors.units[k, 2 * side]
            y = reach * sectors.units[k, 2 * side + 1]
            index = sectors.bins[k, side]
            for _ in range(BINS):
                if side == 1:
                    index = index + 1 if index + 1 < BINS else 0
                    edge = index
                else:
                    edge = index
                    index = index - 1 if index > 0 else BINS - 1
                ahead = profile.edges[edge, 0] * x + profile.edges[edge, 1] * y
                beside = profile.edges[edge, 0] * y - profile.edges[edge, 1] * x
                rest = squared - beside * beside
                if ahead <= 0.0 or rest < 0.0:
                    break
                touch = ahead - np.sqrt(rest)
                if touch < ranges[index]:
                    ranges[index] = max(touch, 0.0)
    lows = np.empty(FINE)
    for group in range(FINE):
        low = np.inf
        for index in range(group * (BINS // FINE), (group + 1) * (BINS // FINE)):
            low = min(low, ranges[index])
        lows[group] = low
    _widen(lows, FINE, profile.fine)
    for group in range(COARSE):
        low = np.inf
        for index in range(group * (FINE // COARSE), (group + 1) * (FINE // COARSE)):
            low = min(low, lows[index])
        lows[group] = low
    _widen(lows, COARSE, profile.coarse)
    smallest = np.inf
    for group in range(COARSE):
        smallest = min(smallest, lows[group])
    return smallest
