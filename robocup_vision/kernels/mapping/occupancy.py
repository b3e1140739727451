"""Compiled loops of the free-space map: evidence of a range profile for each cell, and free ranges."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, Float32Array, FloatArray, Int8Array, Int32Array
from robocup_vision.compiling.loops import compiled

# evidence for a cell: none; a hit (the paper's event O); crossed (not O)
SILENT, HIT, CROSSED = 0, 1, 2
_TURN = 2.0 * math.pi
# cones closer together than this join without a gap, radians
_JOINED_RAD = 1e-9


class SensorInGrid(NamedTuple):
    """A grid of cells and the sensor in it, both in the map's frame.

    corner_x, corner_y, cell_m : lowest corner of cell (0, 0) and side of a cell, metres.
    x_m, y_m, theta_rad : the sensor.
    """

    corner_x: float
    corner_y: float
    cell_m: float
    x_m: float
    y_m: float
    theta_rad: float


class ProfileArrays(NamedTuple):
    """A range profile in the sensor's frame.

    bearing, lower, upper : (J,) float64, middle and edges of each bearing's cone, ascending within one turn, radians.
    range_m, depth_m : (J,) float64; obstacles extend from range to range + depth; a NaN range is no measurement.
    hit : (J,) bool, whether there is an obstacle at the range; otherwise the floor is free up to the range.
    """

    bearing: FloatArray
    lower: FloatArray
    upper: FloatArray
    range_m: FloatArray
    depth_m: FloatArray
    hit: BoolArray


@compiled
def _span(dx: float, dy: float, half: float) -> tuple[float, float, float, float, float]:
    """Return nearest and farthest range of a cell, direction of its middle, and lowest and highest direction from that.

    The middle (dx, dy) must be at least one cell away.
    """
    ax, ay = abs(dx), abs(dy)
    short_x, short_y = max(ax - half, 0.0), max(ay - half, 0.0)
    near = math.sqrt(short_x * short_x + short_y * short_y)
    far = math.sqrt((ax + half) * (ax + half) + (ay + half) * (ay + half))
    low, high = 0.0, 0.0
    for sx in (-half, half):
        for sy in (-half, half):
            slope = (dx * sy - dy * sx) / (dx * (dx + sx) + dy * (dy + sy))
            low, high = min(low, slope), max(high, slope)
    return near, far, math.atan2(dy, dx), math.atan(low), math.atan(high)


@compiled
def _first_cone(direction: float, lower: FloatArray, upper: FloatArray) -> tuple[int, float]:
    """Return the cone that contains a direction, or the next one after a gap, and the angle from there to its start."""
    offset = (direction - lower[0]) % _TURN
    first, last = 0, lower.shape[0]
    while last - first > 1:
        middle = (first + last) // 2
        if lower[middle] - lower[0] <= offset:
            first = middle
        else:
            last = middle
    if offset <= upper[first] - lower[0] + _JOINED_RAD:
        return first, lower[first] - lower[0] - offset
    after = first + 1 if first + 1 < lower.shape[0] else 0
    return after, (lower[after] - lower[0] - offset) % _TURN


@compiled
def gather_evidence(
    sensor: SensorInGrid, profile: ProfileArrays, nearest_m: float, reach_m: float, discs: FloatArray, out: Int8Array
) -> None:
    """Write the evidence of one range profile for each cell: HIT, CROSSED or SILENT.

    A cell is hit by a bearing whose ray ends in it, or whose cone contains its middle at that range. It is crossed if
    the cones of all bearings that touch it end beyond its farthest corner.

    nearest_m, reach_m : ranges between which the sensor measures.
    discs : (D, 3) x, y, radius in the map's frame; cells that touch a disc get no evidence.
    out : (N, N); written; first index along x.
    """
    corner_x, corner_y, cell_m, x_m, y_m, theta_rad = sensor
    bearing, lower, upper, range_m, depth_m, hit = profile
    count, size = bearing.shape[0], out.shape[0]
    half = 0.5 * cell_m
    out[:] = SILENT
    # no cell beyond the longest ray is hit or crossed
    longest = 0.0
    for k in range(count):
        if range_m[k] > 0.0:
            longest = max(longest, range_m[k] + (depth_m[k] if hit[k] else 0.0))
    reach_m = min(reach_m, longest + 2.0 * cell_m)
    first_i = max(int(math.floor((x_m - reach_m - corner_x) / cell_m)), 0)
    last_i = min(int(math.ceil((x_m + reach_m - corner_x) / cell_m)), size)
    first_j = max(int(math.floor((y_m - reach_m - corner_y) / cell_m)), 0)
    last_j = min(int(math.ceil((y_m + reach_m - corner_y) / cell_m)), size)
    for i in range(first_i, last_i):
        dx = corner_x + (i + 0.5) * cell_m - x_m
        for j in range(first_j, last_j):
            dy = corner_y + (j + 0.5) * cell_m - y_m
            away = math.sqrt(dx * dx + dy * dy)
            if away < cell_m or away > reach_m + cell_m:
                continue
            near, far, middle, low, high = _span(dx, dy, half)
            if near < nearest_m or far > reach_m or _touches(dx + x_m, dy + y_m, half, discs):
                continue
            k, begin = _first_cone(middle + low - theta_rad, lower, upper)
            width = high - low
            crossed, is_hit = begin <= 0.0, False
            # each cone that touches the cell; `begin` is its start relative to the cell's lowest direction
            for _ in range(count):
                if begin > width:
                    break
                if not range_m[k] >= far:
                    crossed = False
                    if hit[k] and range_m[k] >= nearest_m:
                        if begin <= -low <= begin + upper[k] - lower[k]:
                            is_hit |= range_m[k] - half <= away <= range_m[k] + depth_m[k] + half
                        ray = begin + bearing[k] - lower[k]
                        if 0.0 <= ray <= width:
                            direction = middle + low + ray
                            c, s = math.cos(direction), math.sin(direction)
                            enter, leave = _chord(dx, dy, half, c, s)
                            is_hit |= enter <= leave and enter <= range_m[k] + depth_m[k] and leave >= range_m[k]
                end = begin + upper[k] - lower[k]
                if end >= width:
                    break
                after = k + 1 if k + 1 < count else 0
                gap = lower[after] - upper[k] + (_TURN if after == 0 else 0.0)
                if gap > _JOINED_RAD:
                    crossed = False
                begin = end + gap
                k = after
            if is_hit:
                out[i, j] = HIT
            elif crossed:
                out[i, j] = CROSSED


@compiled
def _chord(dx: float, dy: float, half: float, c: float, s: float) -> tuple[float, float]:
    """Return where a ray from the origin along (c, s) enters and leaves a cell at (dx, dy); enter > leave is a miss."""
    enter, leave = 0.0, np.inf
    if c != 0.0:
        a, b = (dx - half) / c, (dx + half) / c
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    elif abs(dx) > half:
        return 1.0, 0.0
    if s != 0.0:
        a, b = (dy - half) / s, (dy + half) / s
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    elif abs(dy) > half:
        return 1.0, 0.0
    return enter, leave


@compiled
def _touches(x: float, y: float, half: float, discs: FloatArray) -> bool:
    """Whether the cell at (x, y) touches one of the discs."""
    for d in range(discs.shape[0]):
        ax = max(abs(discs[d, 0] - x) - half, 0.0)
        ay = max(abs(discs[d, 1] - y) - half, 0.0)
        if ax * ax + ay * ay <= discs[d, 2] * discs[d, 2]:
            return True
    return False


@compiled
def add_evidence(
    evidence: Int8Array,
    hit_step: float,
    crossed_step: float,
    max_odds: float,
    log_odds: Float32Array,
    observations: Int32Array,
) -> None:
    """Apply Bayes' rule to each cell with evidence: add to its log-odds, clipped at +-`max_odds`, and count it."""
    for i in range(evidence.shape[0]):
        for j in range(evidence.shape[1]):
            if evidence[i, j] == SILENT:
                continue
            step = hit_step if evidence[i, j] == HIT else crossed_step
            log_odds[i, j] = min(max(log_odds[i, j] + step, -max_odds), max_odds)
            observations[i, j] += 1


@compiled
def free_ranges(
    sensor: SensorInGrid, lower: FloatArray, upper: FloatArray, nearest_m: float, is_free: BoolArray, out: FloatArray
) -> None:
    """Compute the range of each cone to the first cell that touches it and is not free, or to the map's end.

    lower, upper : (J,) edges of each cone, sensor frame, ascending within one turn, radians.
    nearest_m : cells with a point nearer than this are ignored.
    is_free : (N, N); out : (J,); written, metres.
    """
    corner_x, corner_y, cell_m, x_m, y_m, theta_rad = sensor
    count, size = lower.shape[0], is_free.shape[0]
    half, side = 0.5 * cell_m, size * cell_m
    for k in range(count):
        out[k] = np.inf
        for angle in (lower[k], 0.5 * (lower[k] + upper[k]), upper[k]):
            c, s = math.cos(theta_rad + angle), math.sin(theta_rad + angle)
            _, leave = _chord(corner_x + 0.5 * side - x_m, corner_y + 0.5 * side - y_m, 0.5 * side, c, s)
            out[k] = min(out[k], leave)
    for i in range(size):
        dx = corner_x + (i + 0.5) * cell_m - x_m
        for j in range(size):
            if is_free[i, j]:
                continue
            dy = corner_y + (j + 0.5) * cell_m - y_m
            if math.hypot(dx, dy) < cell_m:
                if nearest_m <= 0.0:
                    out[:] = 0.0
                continue
            near, _, middle, low, high = _span(dx, dy, half)
            if near < nearest_m:
                continue
            k, begin = _first_cone(middle + low - theta_rad, lower, upper)
            for _ in range(count):
                if begin > high - low:
                    break
                out[k] = min(out[k], near)
                after = k + 1 if k + 1 < count else 0
                begin += lower[after] - lower[k] + (_TURN if after == 0 else 0.0)
                k = after
