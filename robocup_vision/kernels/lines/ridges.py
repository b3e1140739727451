"""Compiled detection of line points: the floor's mask, the expected width of a line, and ridges of that width."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array, UInt8Array, UInt16Array
from robocup_vision.compiling.loops import compiled, variable

_DIAGONAL = math.sqrt(0.5)


@compiled
def least_of_red_and_blue(frame: UInt8Array, least: UInt8Array) -> None:
    """Set (H, W) uint8 to the lesser of each pixel's red and blue, in which carpet is dark, of (H, W, 3) uint8."""
    # flat, because loops over three indices do not vectorise
    flat, out = frame.reshape(-1), least.reshape(-1)
    for i in range(out.shape[0]):
        out[i] = min(flat[3 * i], flat[3 * i + 2])


@compiled
def floor_mask_by_tone(smooth: UInt8Array, seen: UInt8Array, cell_bits: int, tone: Float32Array) -> UInt8Array:
    """Mark the pixels that have the floor's tone. Returns (H, W) uint8 of 0 and 1.

    seen is non-zero for the cells to use, of 2^cell_bits pixels to a side. tone is (7,): least and greatest R/G, B/G
    and G, then the slack of each channel in grey levels.
    """
    height, width = smooth.shape[:2]
    out = np.zeros((height, width), dtype=np.uint8)
    shown = np.zeros(width, dtype=np.uint8)
    is_any = False
    for y in range(height):
        row = y >> cell_bits
        if y == row << cell_bits:
            is_any = False
            for x in range(width):
                shown[x] = seen[row, x >> cell_bits] != 0
                is_any |= shown[x] != 0
        if not is_any:
            continue
        # without branches, so that the loop vectorises
        pixels, marks = smooth[y].reshape(-1), out[y]
        for x in range(width):
            b, g, r = np.float32(pixels[3 * x]), np.float32(pixels[3 * x + 1]), np.float32(pixels[3 * x + 2])
            is_bright = (g >= tone[4]) & (g <= tone[5])
            is_red = (r >= tone[0] * g - tone[6]) & (r <= tone[1] * g + tone[6])
            is_blue = (b >= tone[2] * g - tone[6]) & (b <= tone[3] * g + tone[6])
            marks[x] = shown[x] & (is_bright & is_red & is_blue)
    return out


@compiled
def line_widths(
    floor_m: FloatArray, seen: UInt8Array, line_width_m: float, range_px: tuple[float, float], width_units: UInt16Array
) -> None:
    """Compute the width of a line in the image if it is crossed along each axis of `line_ridge_points`.

    Parameters
    ----------
    floor_m : (R, C, 2) float64
        Floor positions of the cells, robot frame, in metres divided by the pixels from cell to cell.
    seen : (R, C) uint8
        Non-zero for cells to use.
    line_width_m : float
        Width of the paint, in the same unit.
    range_px : (float, float)
        Bounds of the widths that are used.
    width_units : (4, R, C) uint16
        Filled with the widths, 1/16 px; 0 for cells that are not used.
    """
    rows, columns = seen.shape
    for y in range(rows):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        for x in range(columns):
            width_units[:, y, x] = 0
            if seen[y, x] == 0:
                continue
            before, after = max(x - 1, 0), min(x + 1, columns - 1)
            ux = (floor_m[y, after, 0] - floor_m[y, before, 0]) / (after - before)
            uy = (floor_m[y, after, 1] - floor_m[y, before, 1]) / (after - before)
            vx = (floor_m[below, x, 0] - floor_m[above, x, 0]) / (below - above)
            vy = (floor_m[below, x, 1] - floor_m[above, x, 1]) / (below - above)
            area = abs(ux * vy - uy * vx)
            if not area > 0.0:
                continue
            scale = line_width_m / area
            for k in range(4):
                # direction of the line, across the axis
                du, dv = (0.0, 1.0) if k == 0 else ((-_DIAGONAL, _DIAGONAL) if k == 1 else (-1.0, 0.0))
                if k == 3:
                    du, dv = -_DIAGONAL, -_DIAGONAL
                along_x, along_y = ux * du + vx * dv, uy * du + vy * dv
                width_px = scale * math.sqrt(along_x * along_x + along_y * along_y)
                if range_px[0] <= width_px <= range_px[1]:
                    width_units[k, y, x] = round(width_px * 16.0)


@compiled
def _half_crossing(whiteness: UInt8Array, x: int, y: int, dx: int, dy: int, reach: int, level: float) -> float:
    """Count the steps from (x, y) along (dx, dy) until whiteness falls to the level; -1 if not within reach."""
    before = float(whiteness[y, x])
    for step in range(1, reach + 1):
        here = float(whiteness[y + step * dy, x + step * dx])
        if here <= level:
            return step - (level - here) / (before - here)
        before = here
    return -1.0


@compiled
def _stretches(reach_px: UInt8Array, found: Int64Array) -> int:
    """Find runs of cells with the same non-zero reach in a row (4, C), along each axis.

    Fills found (4 * C, 4) with axis, reach, first cell and the one after the last. Returns the number of runs.
    """
    count = variable(0)
    for k in range(4):
        last = variable(0)
        while last < reach_px.shape[1]:
            first, reach = last, reach_px[k, last]
            last += 1
            while last < reach_px.shape[1] and reach_px[k, last] == reach:
                last += 1
            if reach > 0:
                found[count, 0], found[count, 1], found[count, 2], found[count, 3] = k, reach, first, last
                count += 1
    return count


@compiled
def _mark_ridges(
    whiteness: UInt8Array,
    floor: UInt8Array,
    y: int,
    stretches: Int64Array,
    cell_bits: int,
    level: UInt8Array,
    may_be: UInt8Array,
) -> None:
    """Mark pixels of a row in may_be (W,), one bit for each axis: both sides at most level (W,), floor on one side.

    The pixels of a stretch, see `_stretches`, are compared in one vectorised loop.
    """
    height, width = whiteness.shape
    for i in range(stretches.shape[0]):
        k, reach = stretches[i, 0], stretches[i, 1]
        dx = 1 if k < 2 else (0 if k == 2 else -1)
        down = 0 if k == 0 else reach
        aside = 0 if k == 2 else reach
        first = max(stretches[i, 2] << cell_bits, aside)
        size = min(stretches[i, 3] << cell_bits, width - aside) - first
        if size <= 0 or y < down or y + down >= height:
            continue
        a, b = first + reach * dx, first - reach * dx
        side_a, side_b = whiteness[y + down, a : a + size], whiteness[y - down, b : b + size]
        floor_a, floor_b = floor[y + down, a : a + size], floor[y - down, b : b + size]
        highest, marks = level[first : first + size], may_be[first : first + size]
        bit = np.uint8(1 << k)
        for n in range(size):
            is_ridge = (side_a[n] <= highest[n]) & (side_b[n] <= highest[n]) & ((floor_a[n] | floor_b[n]) != 0)
            marks[n] |= bit if is_ridge else np.uint8(0)


@compiled
def line_ridge_points(
    whiteness: UInt8Array,
    green: UInt8Array,
    floor: UInt8Array,
    width_units: UInt16Array,
    reach_px: UInt8Array,
    cell_bits: int,
    threshold: int,
    limit: int,
) -> FloatArray:
    """Find ridges that have the width of a line, with floor beside them.

    Parameters
    ----------
    whiteness, green : (H, W) uint8
        min(R, B) and G.
    floor : (H, W) uint8
        1 where a pixel has the floor's tone.
    width_units : (4, R, C) uint16
        Expected width along the axes (1, 0), (1, 1), (0, 1), (-1, 1), in 1/16 px.
    reach_px : (4, R, C) uint8
        Steps along each axis to the floor beside such a line; 0 for cells that are not used.
    cell_bits : int
        Size of the cells of both: 2^cell_bits pixels to a side.
    threshold : int
        Least height of a ridge above both sides, grey levels.
    limit : int
        Greatest number of points.

    Returns
    -------
    (N, 4) float64
        Sub-pixel u, v, contrast (height divided by the floor's G), and 1 for floor on both sides, 0 for one.
    """
    height, width = whiteness.shape
    out = np.empty((limit, 4))
    count = 0
    level, may_be = np.empty(width, np.uint8), np.empty(width, np.uint8)
    stretches = np.empty((4 * reach_px.shape[2], 4), np.int64)
    shown = variable(0)
    for y in range(height):
        row = y >> cell_bits
        if y == row << cell_bits:
            # nothing to do in rows above the horizon
            shown = _stretches(reach_px[:, row], stretches)
        if shown == 0:
            continue
        for x in range(width):
            level[x] = max(np.int16(whiteness[y, x]) - np.int16(threshold), np.int16(0))
            may_be[x] = 0
        _mark_ridges(whiteness, floor, y, stretches[:shown], cell_bits, level, may_be)
        for x in range(width):
            if may_be[x] == 0:
                continue
            value = np.int64(whiteness[y, x])
            best, best_axis, best_reach, best_two = np.int64(0), -1, variable(0), np.int64(0)
            for k in range(4):
                if may_be[x] >> k & 1 == 0:
                    continue
                reach = int(reach_px[k, row, x >> cell_bits])
                dx = 1 if k < 2 else (0 if k == 2 else -1)
                dy = 0 if k == 0 else 1
                xa, ya, xb, yb = x + reach * dx, y + reach * dy, x - reach * dx, y - reach * dy
                rise = value - max(np.int64(whiteness[ya, xa]), np.int64(whiteness[yb, xb]))
                # `_mark_ridges` clipped the level of dark pixels at 0
                if rise < threshold:
                    continue
                two = np.int64(floor[ya, xa]) + np.int64(floor[yb, xb])
                # floor on both sides has priority over height
                if two < best_two or (two == best_two and rise <= best):
                    continue
                best, best_axis, best_reach, best_two = rise, k, reach, two
            if best_axis < 0:
                continue
            k, reach = best_axis, best_reach
            dx = 1 if k < 2 else (0 if k == 2 else -1)
            dy = 0 if k == 0 else 1
            side_a = np.int64(whiteness[y + reach * dy, x + reach * dx])
            side_b = np.int64(whiteness[y - reach * dy, x - reach * dx])
            to_a = _half_crossing(whiteness, x, y, dx, dy, reach, 0.5 * (value + side_a))
            to_b = _half_crossing(whiteness, x, y, -dx, -dy, reach, 0.5 * (value + side_b))
            if to_a < 0.0 or to_b < 0.0:
                continue
            shift = 0.5 * (to_a - to_b)
            if shift > 0.5 or shift <= -0.5:
                continue
            step_px = 1.0 if k == 0 or k == 2 else 1.4142135623730951
            seen_px = (to_a + to_b) * step_px
            expected_px = width_units[k, y >> cell_bits, x >> cell_bits] / 16.0
            if seen_px < 0.5 * expected_px or seen_px > 1.5 * expected_px + 1.5:
                continue
            if count == limit:
                return out[:count]
            ground = 0.0
            if floor[y + reach * dy, x + reach * dx]:
                ground = float(green[y + reach * dy, x + reach * dx])
            if floor[y - reach * dy, x - reach * dx]:
                ground = max(ground, float(green[y - reach * dy, x - reach * dx]))
            out[count, 0] = x + shift * dx
            out[count, 1] = y + shift * dy
            out[count, 2] = best / max(ground, 1.0)
            out[count, 3] = 1.0 if best_two == 2 else 0.0
            count += 1
    return out[:count]
