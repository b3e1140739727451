"""Compiled loops over the grid of ways: marking of a view's cells, prices of cells, and the cheapest way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled

UNSEEN, FREE, BLOCKED = 0, 1, 2

_DIAGONAL = math.sqrt(2.0)


class RangesInGrid(NamedTuple):
    """Free ranges of a view, and the robot in the grid.

    robot_x, robot_y, robot_theta : cells and radians.
    bearing, range_cells : (J,) float64, evenly spaced bearings, robot frame, radians; free ranges, cells. NaN: not
    measured.
    """

    robot_x: float
    robot_y: float
    robot_theta: float
    bearing: FloatArray
    range_cells: FloatArray


class MarkRules(NamedTuple):
    """Rules by which a view marks cells; see `avoidance.wayfinder`.

    fading, overrule_ratio : factor of a free cell's distance with each view that shows it again; greatest ratio of a
    new distance to the old one at which it overrules.
    """

    fading: float
    overrule_ratio: float


class PriceRules(NamedTuple):
    """Prices of cells; see `avoidance.wayfinder`. A price of 2 equals a way of twice the length.

    tight : extra price if the disc just touches a blocked cell.
    shut : price of a cell in which the disc just does not fit.
    maybe_barred, barred : extra price of a blocked cell itself, measured from a large and from a small distance.
    tries, tried, remembered : number of tries without a price; price of each more; fraction kept for the next time.
    """

    tight: float
    shut: float
    maybe_barred: float
    barred: float
    tries: float
    tried: float
    remembered: float


@compiled(error_model="numpy")
def mark_view(
    state: UInt8Array,
    seen_from: Float32Array,
    view: RangesInGrid,
    least: float,
    reach: float,
    thickness: float,
    rules: MarkRules,
) -> None:
    """Mark the cells of a view: free up to each direction's range, blocked over a strip beyond it, others unchanged.

    state : (N, N); changed: UNSEEN, FREE or BLOCKED; rows along y, columns along x.
    seen_from : (N, N); changed: distance from which each cell was measured, cells.
    least, reach : least value of `seen_from`, and distance from the robot up to which cells are marked, cells.
    thickness : of the blocked strip, cells.
    """
    robot_x, robot_y, robot_theta, bearing, range_cells = view
    size = state.shape[0]
    count = bearing.shape[0]
    step = bearing[1] - bearing[0]
    first = bearing[0] - 0.5 * step + robot_theta
    turn = 2.0 * math.pi
    low_x, high_x = max(int(robot_x - reach), 0), min(int(robot_x + reach) + 1, size - 1)
    low_y, high_y = max(int(robot_y - reach), 0), min(int(robot_y + reach) + 1, size - 1)
    for row in range(low_y, high_y + 1):
        y = row - robot_y
        for column in range(low_x, high_x + 1):
            x = column - robot_x
            r = math.sqrt(x * x + y * y)
            if r > reach:
                continue
            angle = math.atan2(y, x) - first
            index = int((angle - turn * math.floor(angle / turn)) / step)
            if index >= count:
                continue
            end = range_cells[index]
            if r < end:
                now = FREE
            elif r < end + thickness:
                now = BLOCKED
            else:
                continue
            r = max(r, least)
            before = state[row, column]
            if before == now:
                # a blocked cell keeps its certainty; other robots may enter a free one
                known = seen_from[row, column] * (rules.fading if now == FREE else 1.0)
                seen_from[row, column] = min(known, r)
            elif now == FREE or before == UNSEEN or r <= rules.overrule_ratio * seen_from[row, column]:
                state[row, column] = now
                seen_from[row, column] = r


@compiled(error_model="numpy")
def split_blocked(
    state: UInt8Array, seen_from: Float32Array, sure: float, open_any: UInt8Array, open_sure: UInt8Array
) -> None:
    """Write 0 for blocked cells, else 1: for all blocked cells, and for those measured from nearer than `sure`."""
    size = state.shape[0]
    for row in range(size):
        for column in range(size):
            blocked = state[row, column] == BLOCKED
            open_any[row, column] = 0 if blocked else 1
            open_sure[row, column] = 0 if blocked and seen_from[row, column] < sure else 1


@compiled(error_model="numpy")
def price_cells(
    away_any: Float32Array,
    away_sure: Float32Array,
    tried: Float32Array,
    radius: float,
    spare: float,
    soft: float,
    rules: PriceRules,
    price: Float32Array,
) -> None:
    """Compute the price of every cell for a disc: 1 on open floor, more near blocked cells and where it does not fit.

    away_any, away_sure : (N, N) distance of each cell from the nearest blocked one, and from the nearest one that is
    certainly blocked, cells.
    tried : (N, N); changed: recent number of tries to reach each cell; fades.
    radius, spare, soft : radius of the disc; additional width of a certain gap on each side; width of the priced
    margin, cells.
    """
    size = price.shape[0]
    wide = radius + spare
    for row in range(size):
        for column in range(size):
            # minus half a cell, because an obstacle may fill its cell
            gap = away_any[row, column] - 0.5
            if gap < radius:
                lack = (radius - gap) / radius
                cost = rules.shut + rules.maybe_barred * lack * lack
            else:
                lack = max((radius + soft - gap) / soft, 0.0)
                cost = 1.0 + rules.tight * lack * lack
            gap = away_sure[row, column] - 0.5
            if gap < wide:
                lack = (wide - gap) / wide
                cost = max(cost, rules.shut + rules.barred * lack * lack)
            price[row, column] = cost + rules.tried * max(tried[row, column] - rules.tries, 0.0)
            tried[row, column] *= rules.remembered


@compiled(error_model="numpy")
def note_try(tried: Float32Array, price: Float32Array, x: float, y: float, radius: float) -> None:
    """Count one more try in each cell of a disc, cells, whose price exceeds that of open floor."""
    size = tried.shape[0]
    for row in range(max(int(y - radius), 0), min(int(y + radius) + 2, size)):
        for column in range(max(int(x - radius), 0), min(int(x + radius) + 2, size)):
            if price[row, column] > 1.0 and (column - x) ** 2 + (row - y) ** 2 <= radius * radius:
                tried[row, column] += 1.0


# binary heap of `cells` ordered by `keys`, of which the first `count` are in use


@compiled(error_model="numpy")
def _push(keys: FloatArray, cells: Int32Array, count: int, key: float, cell: int) -> int:
    place = count
    while place > 0:
        parent = (place - 1) >> 1
        if keys[parent] <= key:
            break
        keys[place], cells[place] = keys[parent], cells[parent]
        place = parent
    keys[place], cells[place] = key, cell
    return count + 1


@compiled(error_model="numpy")
def _drop_least(keys: FloatArray, cells: Int32Array, count: int) -> int:
    count -= 1
    key, cell = keys[count], cells[count]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= count:
            break
        if child + 1 < count and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[place], cells[place] = keys[child], cells[child]
        place = child
    keys[place], cells[place] = key, cell
    return count


@compiled(error_model="numpy")
def find_way(price: Float32Array, start: int, target: int, come_from: Int32Array, cost: Float32Array) -> None:
    """Find the cheapest way between two cells by A*; `come_from` leads back from the target.

    price : (N, N) price of crossing each cell, at least 1; steps lead to the eight neighbours.
    start, target : flat indices.
    come_from, cost : (N * N,); written: predecessor of each cell on its way from the start, and cost of that way.
    """
    size = price.shape[0]
    flat = price.ravel()
    cost[:] = np.inf
    # each cell is entered at most once from each of its eight neighbours
    keys = np.empty(8 * size * size)
    cells = np.empty(8 * size * size, np.int32)
    target_y, target_x = target // size, target % size
    cost[start] = 0.0
    come_from[start] = start
    count = _push(keys, cells, 0, 0.0, start)
    while count > 0:
        key, cell = keys[0], cells[0]
        count = _drop_least(keys, cells, count)
        if cell == target:
            return
        y, x = cell // size, cell % size
        dx, dy = abs(x - target_x), abs(y - target_y)
        if cell != start and key > cost[cell] + max(dx, dy) + (_DIAGONAL - 1.0) * min(dx, dy) + 1e-3:
            continue
        for step_y in range(-1, 2):
            for step_x in range(-1, 2):
                other_x, other_y = x + step_x, y + step_y
                if not (0 <= other_x < size and 0 <= other_y < size) or (step_x == 0 and step_y == 0):
                    continue
                other = other_y * size + other_x
                length = _DIAGONAL if step_x != 0 and step_y != 0 else 1.0
                paid = cost[cell] + length * 0.5 * (flat[cell] + flat[other])
                if paid < cost[other] - 1e-4:
                    cost[other] = paid
                    come_from[other] = cell
                    dx, dy = abs(other_x - target_x), abs(other_y - target_y)
                    left = max(dx, dy) + (_DIAGONAL - 1.0) * min(dx, dy)
                    count = _push(keys, cells, count, paid + left, other)


@compiled(error_model="numpy")
def dearest_between(price: Float32Array, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the highest price on the straight line between two points in cells."""
    size = price.shape[0]
    steps = int(math.ceil(1.5 * math.hypot(x1 - x0, y1 - y0))) + 1
    highest = 0.0
    for k in range(steps + 1):
        x = x0 + (x1 - x0) * k / steps
        y = y0 + (y1 - y0) * k / steps
        column, row = min(max(int(x + 0.5), 0), size - 1), min(max(int(y + 0.5), 0), size - 1)
        highest = max(highest, price[row, column])
    return highest


@compiled(error_model="numpy")
def straight_part(
    price: Float32Array, come_from: Int32Array, start: int, target: int, robot_x: float, robot_y: float, beyond: int
) -> tuple[int, int]:
    """Return two cells of a way: the last one that can be reached straight, and the one `beyond` cells after it.

    A cell can be reached straight if no cell of the line costs more than the most expensive one of the way up to it.
    """
    size = price.shape[0]
    length = 1
    cell = target
    while cell != start:
        cell = come_from[cell]
        length += 1
    way = np.empty(length, np.int32)
    cell = target
    for k in range(length - 1, -1, -1):
        way[k] = cell
        cell = come_from[cell]
    dearest, reached = price[start // size, start % size], min(1, length - 1)
    for k in range(1, length):
        y, x = way[k] // size, way[k] % size
        dearest = max(dearest, price[y, x])
        if dearest_between(price, robot_x, robot_y, float(x), float(y)) > dearest + 1e-3:
            break
        reached = k
    return way[reached], way[min(reached + beyond, length - 1)]
