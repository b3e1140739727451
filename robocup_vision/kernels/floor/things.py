"""Compiled loops that group the blocked places on the floor into objects that stand on it.

An object's foot on a bearing is the first blocked sample. A column is a step of the samples along a bearing; the floor
distance between two columns is the error of a range.

The loops take `columns` (K,) int64, the columns of the feet, M or more where there is none; `range_m` or `column_m`
(M,) float64, the range of each column from the camera's foot; `columns_in_use`, the end of the columns that show floor;
`step_rad`, the angle between bearings; and `is_ring`, whether the last bearing is adjacent to the first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.floor.free_floor import BLOCKED

# lowest and highest bit of each byte of a word of eight marks
EACH_BYTE, HIGH_BITS = np.uint64(0x0101010101010101), np.uint64(0x8080808080808080)
# least ratio of the floor behind an object that is blocked; the rest may be noise
HIDDEN_RATIO = 0.9
# bearings over which averaging, lens and motion blur an object's side
SIDE_BEARINGS = 3
# columns over which averaging and lens blur a foot, and half a column to the last sample of floor
AVERAGED_COLUMNS = 2.5
# bound of a foot's error due to the pose, in standard deviations
POSE_SIGMAS = 2.0
# states of a bearing: unknown, an object, the end of the floor, or floor up to the end of view
_UNKNOWN, _THING, _END, _FREE = 0, 1, 2, 3
# ends of a group of bearings: floor behind it is visible, it continues gradually, or it is hidden
_STANDS_OUT, _GOES_ON, _HIDDEN = 0, 1, 2


class FieldFeet(NamedTuple):
    """Feet of the field's own walls and goals on the floor, field frame, metres.

    Parameters
    ----------
    floor : (P, 2) float64
        Corners of the floor.
    panels : (S, 4) float64
        Feet of panels on it.
    posts : (C, 3) float64
        x, y and radius of posts and beacons.
    nets : (N, 4) float64
        Goals with a net: side, and distance from the centre of mouth and back; half of the width.
    """

    floor: FloatArray
    panels: FloatArray
    posts: FloatArray
    nets: FloatArray


@compiled(error_model="numpy", inline="always")
def _beside(k: int, step: int, count: int, is_ring: bool) -> int:
    """Return the index of the bearing `step` beside another; -1 if there is none."""
    beside = k + step
    if is_ring:
        return beside % count
    return beside if 0 <= beside < count else -1


@compiled(inline="always")
def _has_blocked(eight: np.uint64) -> bool:
    """Whether any of eight marks is BLOCKED, which is 0: the first zero byte borrows from the bit above it."""
    return bool((eight - EACH_BYTE) & ~eight & HIGH_BITS)


@compiled(error_model="numpy")
def blocked_feet(
    marks: UInt8Array,
    shown: UInt8Array,
    range_m: FloatArray,
    first_column: int,
    columns_in_use: int,
    eye_m: float,
    height_m: float,
    out: Int64Array,
) -> None:
    """Find the nearest sample of each bearing where an object stands: unlike paint, it hides the floor behind itself.

    Parameters
    ----------
    marks : (K, M) uint8
        Marks of the samples.
    shown : (K, M) uint8
        Zero for samples that are not used.
    first_column : int
        First column to use.
    eye_m, height_m : float
        Height of the viewpoint, and least height of an object.
    out : (K,) int64
        Filled with the columns; without an object M plus the last column that is shown.
    """
    bearings, columns = marks.shape
    beyond = np.full(columns, columns_in_use)
    if eye_m > height_m:
        end = 0
        for m in range(columns_in_use):
            while end < columns_in_use and range_m[end] <= range_m[m] * eye_m / (eye_m - height_m):
                end += 1
            beyond[m] = end
    flat, count = marks.reshape(-1), bearings * columns
    eights = flat[: count - count % 8].view(np.uint64)
    for k in range(bearings):
        last = columns_in_use - 1
        while last > 0 and not shown[k, last]:
            last -= 1
        out[k] = columns + last
        m = first_column
        while m < columns_in_use - 1:
            at = k * columns + m
            # eight samples at once, because most are floor
            if at % 8 == 0 and m + 8 <= columns_in_use and not _has_blocked(eights[at // 8]):
                m += 8
                continue
            if marks[k, m] == BLOCKED and shown[k, m]:
                blocked, seen = 0, 0
                for j in range(m, max(beyond[m], m + 2)):
                    seen += shown[k, j] != 0
                    blocked += (shown[k, j] != 0) & (marks[k, j] == BLOCKED)
                if blocked >= 2 and blocked >= HIDDEN_RATIO * seen:
                    out[k] = m
                    break
            m += 1


@compiled(error_model="numpy")
def drop_narrow(
    columns: Int64Array, range_m: FloatArray, columns_in_use: int, width_m: float, step_rad: float, is_ring: bool
) -> None:
    """Move feet of narrow objects back to where the blocked floor is wide enough; in place.

    This removes specks, thin posts and paint. It is a morphological opening of nearness over the bearings, by a width
    on the floor, metres, that is the same at every range, and at least two bearings.
    """
    count, none = len(columns), len(range_m)
    before, order = columns.copy(), np.argsort(columns)
    waiting, kept = np.empty(count, np.int64), 0
    due = 0
    m = before[order[0]]
    while m < columns_in_use:
        while due < count and before[order[due]] <= m:
            waiting[kept], kept, due = order[due], kept + 1, due + 1
        needed = max(2, int(math.ceil(width_m / (range_m[m] * step_rad))))
        narrow = 0
        for n in range(kept):
            k, run = waiting[n], 1
            for way in (-1, 1):
                beside, step = _beside(k, way, count, is_ring), 1
                while run < needed and beside >= 0 and before[beside] <= m:
                    run, step = run + 1, step + 1
                    beside = _beside(k, way * step, count, is_ring)
            if run >= needed:
                columns[k] = m
            else:
                waiting[narrow], narrow = k, narrow + 1
        kept = narrow
        # nothing changes before the next foot unless one is waiting
        m = m + 1 if kept or due == count else max(m + 1, before[order[due]])
        if kept == 0 and due == count:
            break
    for n in range(kept):
        columns[waiting[n]] = none + columns_in_use - 1


@compiled(error_model="numpy")
def is_of_field(
    x_m: float,
    y_m: float,
    error_m: float,
    offset_m: tuple[float, float],
    robot: tuple[float, float, float],
    field: FieldFeet,
) -> bool:
    """Whether a foot belongs to the field's own walls, boards, goals or beacons, or the floor may end there.

    Parameters
    ----------
    x_m, y_m, error_m : float
        The foot, robot frame, and its greatest error along its bearing.
    offset_m : (float, float)
        The camera's position in the robot frame.
    robot : (float, float, float)
        x, y, heading of the robot, field frame.
    """
    if not math.isfinite(error_m):
        return True
    ahead, left = x_m - offset_m[0], y_m - offset_m[1]
    # tested at the far end of the error
    far_ratio = error_m / max(math.sqrt(ahead * ahead + left * left), 1e-9)
    far_x, far_y = x_m + ahead * far_ratio, y_m + left * far_ratio
    c, s = math.cos(robot[2]), math.sin(robot[2])
    if not _is_inside(robot[0] + c * far_x - s * far_y, robot[1] + s * far_x + c * far_y, field.floor):
        return True
    return _is_at_goal(robot[0] + c * x_m - s * y_m, robot[1] + s * x_m + c * y_m, error_m, field)


@compiled(error_model="numpy")
def _is_inside(x: float, y: float, corners_m: FloatArray) -> bool:
    is_inside, count = False, len(corners_m)
    for n in range(count):
        x0, y0 = corners_m[n]
        x1, y1 = corners_m[n + 1 if n + 1 < count else 0]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            is_inside = not is_inside
    return is_inside


@compiled(error_model="numpy")
def _is_at_goal(x: float, y: float, error_m: float, field: FieldFeet) -> bool:
    """Whether a place belongs to a panel, post, beacon or net within an error."""
    for n in range(len(field.panels)):
        x0, y0, x1, y1 = field.panels[n]
        dx, dy = x1 - x0, y1 - y0
        part = ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy)
        part = min(max(part, 0.0), 1.0)
        if (x - x0 - part * dx) ** 2 + (y - y0 - part * dy) ** 2 < error_m * error_m:
            return True
    for n in range(len(field.posts)):
        if math.sqrt((x - field.posts[n, 0]) ** 2 + (y - field.posts[n, 1]) ** 2) < field.posts[n, 2] + error_m:
            return True
    for n in range(len(field.nets)):
        side, mouth, back, half = field.nets[n]
        if mouth + error_m < side * x < back + error_m and abs(y) < half + error_m:
            return True
    return False


@compiled(error_model="numpy")
def _reach_aside(
    k: int,
    way: int,
    farthest_m: float,
    jump_m: float,
    range_m: FloatArray,
    explained: BoolArray,
    state: Int64Array,
    is_ring: bool,
) -> tuple[int, int]:
    """Return the number of further bearings on one side that belong to an object, and how it ends there."""
    count, taken, last_m = len(range_m), variable(0), range_m[k]
    while taken < count - 1:
        beside = _beside(k, way * (taken + 1), count, is_ring)
        if beside < 0 or state[beside] == _THING:
            return taken, _HIDDEN
        if explained[beside]:
            return taken, _STANDS_OUT
        if state[beside] == _END:
            return taken, _GOES_ON
        if state[beside] == _FREE or range_m[beside] > farthest_m:
            break
        last_m = range_m[beside]
        taken += 1
    if taken == count - 1:
        return taken, _HIDDEN
    end = _GOES_ON
    for step in range(1, SIDE_BEARINGS + 1):
        beside = _beside(k, way * (taken + step), count, is_ring)
        if beside >= 0 and (explained[beside] or range_m[beside] > last_m + jump_m):
            return taken, _STANDS_OUT
        # floor is visible up to there only
        if beside >= 0 and state[beside] == _FREE:
            end = _HIDDEN
    return taken, end


@compiled(error_model="numpy")
def find_things(
    columns: Int64Array,
    places_m: FloatArray,
    column_m: FloatArray,
    columns_in_use: int,
    radius_m: float,
    step_rad: float,
    is_ring: bool,
    offset_m: tuple[float, float],
    robot: tuple[float, float, float],
    covariance: FloatArray,
    field: FieldFeet,
    out: FloatArray,
) -> int:
    """Group the feet of neighbouring bearings into objects, the nearest first.

    An object extends from its nearest foot to feet that are up to a robot's radius farther. On at least one side the
    next feet must be farther by half a radius, or the field's own; what continues gradually is a wall, a board or the
    end of the carpet. The other side may be hidden by a nearer object or the picture's border. Both may be hidden only
    if a pose is known, which identifies the field's own.

    Parameters
    ----------
    places_m : (K, 2) float64
        The feet, robot frame.
    radius_m : float
        Radius of a robot. Objects must be at least that wide. Feet are not used where the error of a range is larger
        than twice this.
    offset_m, robot, field
        As in `is_of_field`.
    covariance : (3, 3) float64
        Covariance of the robot's pose; (0, 0) if no pose is known.
    out : (K, 6) float64
        Filled with x and y of each object's middle, its width, bearing and range of its middle, and the step between
        samples at its nearest foot.

    Returns
    -------
    int
        Number of objects.
    """
    count, found, is_located = len(columns), variable(0), len(covariance) > 0
    range_m, error_m, explained = np.full(count, np.inf), np.full(count, np.inf), np.zeros(count, np.bool_)
    state = np.zeros(count, np.int64)
    for k in range(count):
        m = columns[k]
        if m >= columns_in_use or not math.isfinite(places_m[k, 0]):
            state[k] = _FREE
            seen = m - len(column_m)
            range_m[k] = column_m[seen] if 0 <= seen < columns_in_use - 1 else np.inf
            continue
        range_m[k] = column_m[m]
        # beyond the last column is the horizon
        error_m[k] = column_m[m + 1] - column_m[m] if m + 1 < columns_in_use else np.inf
        if is_located:
            variance = covariance[0, 0] + covariance[1, 1] + covariance[2, 2] * range_m[k] ** 2
            reach_m = AVERAGED_COLUMNS * error_m[k] + POSE_SIGMAS * math.sqrt(variance)
            explained[k] = is_of_field(places_m[k, 0], places_m[k, 1], reach_m, offset_m, robot, field)
    while True:
        k, nearest_m = -1, np.inf
        for n in range(count):
            if state[n] == _UNKNOWN and not explained[n] and range_m[n] < nearest_m:
                k, nearest_m = n, range_m[n]
        if k < 0 or error_m[k] > 2.0 * radius_m:
            return found
        farthest_m, jump_m = nearest_m + radius_m + error_m[k], 0.5 * radius_m + error_m[k]
        right, right_end = _reach_aside(k, -1, farthest_m, jump_m, range_m, explained, state, is_ring)
        left, left_end = _reach_aside(k, 1, farthest_m, jump_m, range_m, explained, state, is_ring)
        bearings = min(right + 1 + left, count)
        x, y, across_m = 0.0, 0.0, 0.0
        for n in range(bearings):
            at = _beside(k, n - right, count, is_ring)
            x, y, across_m = x + places_m[at, 0], y + places_m[at, 1], across_m + range_m[at] * step_rad
        is_thing = right_end != _GOES_ON and left_end != _GOES_ON and bearings >= 2 and across_m >= radius_m
        is_thing &= is_located or right_end == _STANDS_OUT or left_end == _STANDS_OUT
        for n in range(bearings):
            state[_beside(k, n - right, count, is_ring)] = _THING if is_thing else _END
        if is_thing:
            first, last = _beside(k, -right, count, is_ring), _beside(k, bearings - 1 - right, count, is_ring)
            x, y = x / bearings, y / bearings
            ends_m = math.hypot(places_m[last, 0] - places_m[first, 0], places_m[last, 1] - places_m[first, 1])
            out[found, 0], out[found, 1], out[found, 2] = x, y, ends_m + across_m / bearings
            out[found, 3], out[found, 4], out[found, 5] = math.atan2(y, x), math.hypot(x, y), error_m[k]
            found += 1
