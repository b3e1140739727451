"""Compiled renderer of the view along each bearing, as a stack of spans of slope from below to above the horizon.

A ray of one bearing has a slope (rise over run). An object on the floor covers the slopes from its foot up to its upper
edge and hides what is behind it. A bearing's picture is therefore a list of spans of slope, and a pixel is the mean
over the slopes that it covers.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.frame_values import Bearings, MirrorView
from sim2d.kernels.room import cell_color, wall_point
from sim2d.kernels.things import (
    BALL,
    BANDS,
    BOX,
    COLOR,
    CYLINDER,
    HEIGHT,
    KIND,
    MARKER_RATIO,
    OTHER,
    RADIUS,
    SHEET,
    X0,
    X1,
    Y0,
    Y1,
    meet_box_sides,
)

# kinds of spans; for a ball its number among the things is added to `OF_BALL`
FLOOR, PAINT, OF_BALL = range(3)
# columns of `Bearings.entries`; for a ball the last two are the slopes between which it is seen
NEAR, FAR, THING, FIRST_COLOR, SHADE = range(5)
LOW, HIGH = FIRST_COLOR, SHADE
# index of the ground in `FloorPaint.colors`
GROUND = np.uintp(2)
# number that stands for an edge of the carpet in column `THING`
EDGE = -1
# the room's wall is computed for every 16th bearing and interpolated between them
ROOM_STRIDE = 16


@compiled(inline="always")
def _add(bearing: int, near_m: float, far_m: float, thing: int, color: float, shade: float, bearings: Bearings) -> None:
    """Insert a thing into a bearing's list, sorted by distance; a full list drops the farthest thing."""
    count, entries = bearings.lengths, bearings.entries
    k = count[bearing]
    is_full = k == entries.shape[1]
    if is_full:
        k -= 1
    if not is_full or entries[bearing, k, NEAR] > near_m:
        count[bearing] = k + 1
        while k > 0 and entries[bearing, k - 1, NEAR] > near_m:
            for column in range(5):
                entries[bearing, k, column] = entries[bearing, k - 1, column]
            k -= 1
        entries[bearing, k, NEAR], entries[bearing, k, FAR] = near_m, far_m
        entries[bearing, k, THING], entries[bearing, k, FIRST_COLOR] = thing, color
        entries[bearing, k, SHADE] = shade


@compiled(error_model="numpy", inline="always")
def span_of(low_rad: float, span_rad: float, turns: int) -> tuple[int, int]:
    """Return the first of `turns` bearings within a span of angles, and the one after the last, which may exceed it."""
    low = low_rad - math.floor(low_rad / math.tau) * math.tau
    start = math.ceil(low * turns / math.tau)
    return start, min(math.ceil((low + span_rad) * turns / math.tau), start + turns)


@compiled(error_model="numpy")
def _meet_sheet(
    ends: tuple[float, float, float, float],
    thing: int,
    colors: tuple[int, int],
    view: MirrorView,
    bearings: Bearings,
) -> None:
    """Enter an upright sheet (x0, y0, x1, y1, field frame, metres), with its colours seen from left and right."""
    eye, directions = view.eye, view.pixels.directions
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    x, y = ends[0] - eye.x_m, ends[1] - eye.y_m
    ax, ay = c * x + s * y, c * y - s * x
    x, y = ends[2] - eye.x_m, ends[3] - eye.y_m
    bx, by = c * x + s * y, c * y - s * x
    turn, color = ax * by - ay * bx, colors[0]
    if turn < 0:
        ax, ay, bx, by, turn, color = bx, by, ax, ay, -turn, colors[1]
    if turn < 1e-9:
        return
    turns = len(directions)
    start, stop = span_of(math.atan2(ay, ax), math.atan2(turn, ax * bx + ay * by), turns)
    for i in range(start, stop):
        k = i if i < turns else i - turns
        across = directions[k, 2] * (ax - bx) - directions[k, 1] * (ay - by)
        if across > 0:
            _add(k, turn / across, turn / across, thing, color, 1.0, bearings)


@compiled(error_model="numpy")
def _ball_slopes(toward: float, aside: float, radius: float, height_m: float) -> tuple[float, float]:
    """Return the slopes of a bearing's two rays that are tangent to a ball, or (0, 0) if the bearing misses it."""
    # squared radius of the ball's section with the bearing's vertical plane
    section2 = radius * radius - aside * aside
    if section2 > 0 and toward > 0 and toward * toward > section2:
        drop = height_m - radius
        root = math.sqrt(section2 * (toward * toward + drop * drop - section2))
        per_away2 = 1 / (toward * toward - section2)
        return (-toward * drop - root) * per_away2, (-toward * drop + root) * per_away2
    return 0.0, 0.0


@compiled(error_model="numpy")
def meet_things(view: MirrorView, bearings: Bearings) -> None:
    """Enter the carpet's edges, sheets, cylinders, balls and boxes into the lists of the bearings that meet them."""
    things, edges, eye, directions = view.things, view.paint.edges, view.eye, view.pixels.directions
    lamp_rad = view.light.lamp_rad
    bearings.lengths[:] = 0
    for k in range(len(edges)):
        ends = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        _meet_sheet(ends, EDGE, (0, 0), view, bearings)
    turns = len(directions)
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    lamp_x, lamp_y = math.cos(lamp_rad - eye.heading_rad), math.sin(lamp_rad - eye.heading_rad)
    for thing in range(len(things.rows)):
        row = things.rows[thing]
        kind, color, other = int(row[KIND]), int(row[COLOR]), row[OTHER]
        if kind == SHEET:
            ends = row[X0], row[Y0], row[X1], row[Y1]
            _meet_sheet(ends, thing, (color, int(other)), view, bearings)
        if kind != CYLINDER and kind != BALL and kind != BOX:
            continue
        dx, dy, radius = row[X0] - eye.x_m, row[Y0] - eye.y_m, row[RADIUS]
        x, y = c * dx + s * dy, c * dy - s * dx
        away, reach = math.hypot(x, y), math.hypot(radius, other) if kind == BOX else radius
        if kind != BOX and away <= radius:
            continue
        # from within the circle through its corners, a box may be seen at any bearing
        half = math.asin(reach / away) if away > reach else math.pi
        start, stop = span_of(math.atan2(y, x) - half, 2 * half, turns)
        ahead, left = c * row[X1] + s * row[Y1], c * row[Y1] - s * row[X1]
        box = (row[KIND], x, y, ahead, left, radius, row[HEIGHT], row[COLOR], row[BANDS], other)
        for i in range(start, stop):
            k = i if i < turns else i - turns
            cos, sin = directions[k, 1], directions[k, 2]
            if kind == BOX:
                enter, leave, face = meet_box_sides(box, cos, sin)
                if 0 < enter < leave:
                    _add(k, float(enter), float(leave), thing, color + int(face), 1.0, bearings)
                continue
            toward, aside = cos * x + sin * y, cos * y - sin * x
            if kind == BALL:
                low, high = _ball_slopes(toward, aside, radius, eye.height_m)
                if low < high:
                    _add(k, toward, toward, thing, low, high, bearings)
                continue
            chord = math.sqrt(max(radius * radius - aside * aside, 0.0))
            distance = toward - chord
            facing = ((distance * cos - x) * lamp_x + (distance * sin - y) * lamp_y) / radius
            _add(k, distance, toward + chord, thing, color, 0.75 + 0.20 * facing, bearings)


# inlined functions take single arrays: taking an array from a tuple costs reference counting at each call
@compiled(inline="always")
def _end_span(
    k: int,
    n: int,
    end: float,
    kind: int,
    colors: Float32Array,
    color: np.uintp,
    light: float,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
) -> int:
    """Append a span to bearing k's stack of n unless it is hidden or the stack is full; return the new n."""
    slope = np.float32(end)
    if (n > 0 and slope <= ends[k, n - 1]) or n == ends.shape[1] - 1:
        return n
    ends[k, n], kinds[k, n] = slope, kind
    for channel in range(3):
        paint[k, n, channel] = colors[color, channel] * light
    return n + 1


@compiled(error_model="numpy", inline="always")
def _end_thing(
    k: int,
    n: int,
    entries: Float32Array,
    e: int,
    lit: float,
    height_m: float,
    rows: FloatArray,
    colors: Float32Array,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
) -> int:
    """Append the spans of entry e of bearing k to its stack of n: a thing's bands, its top and a marker on it."""
    # elements are read without a view of the row, whose reference counting would take longer
    thing, color = np.uintp(int(entries[k, e, THING])), np.uintp(int(entries[k, e, FIRST_COLOR]))
    distance, far, shade = float(entries[k, e, NEAR]), float(entries[k, e, FAR]), entries[k, e, SHADE]
    kind, height = int(rows[thing, KIND]), rows[thing, HEIGHT]
    # a bearing shows only one face of a box
    bands = int(rows[thing, BANDS]) if kind == CYLINDER else 1
    for band in range(bands):
        top = (height * (band + 1) / bands - height_m) / distance
        n = _end_span(k, n, top, PAINT, colors, color + np.uintp(band), lit * shade, ends, kinds, paint)
    if kind != SHEET and height < height_m:
        # the top has the last of the thing's colours
        drop, top_color = height - height_m, np.uintp(int(rows[thing, COLOR] + rows[thing, BANDS]) - 1)
        middle, half = (distance + far) / 2, (far - distance) / 2
        marker2 = half * half - rows[thing, RADIUS] ** 2 * (1 - MARKER_RATIO * MARKER_RATIO)
        if kind == CYLINDER and rows[thing, OTHER] >= 0 and marker2 > 0:
            marker, marker_color = math.sqrt(marker2), np.uintp(int(rows[thing, OTHER]))
            n = _end_span(k, n, drop / (middle - marker), PAINT, colors, top_color, lit, ends, kinds, paint)
            n = _end_span(k, n, drop / (middle + marker), PAINT, colors, marker_color, lit, ends, kinds, paint)
        n = _end_span(k, n, drop / far, PAINT, colors, top_color, lit, ends, kinds, paint)
    return n


@compiled(error_model="numpy")
def stack_spans(view: MirrorView, bearings: Bearings) -> None:
    """Turn each bearing's list into spans of slope, in ascending order; the room's wall is one span of one colour."""
    count, entries = bearings.lengths, bearings.entries
    ends, kinds, paint = bearings.ends, bearings.kinds, bearings.paint
    (rows, colors), floor_colors, directions = view.things, view.paint.colors, view.pixels.directions
    eye, light, wall, height_m = view.eye, view.light, view.wall, view.eye.height_m
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    around, last = wall.turn, len(directions) - 1
    from_k, until_k = 0, 0
    column_from, room_from = 0.0, 0.0
    column_until, room_until = wall_point(c, s, eye.x_m, eye.y_m, wall)
    for k in range(len(directions)):
        cos, sin = c * directions[k, 1] - s * directions[k, 2], s * directions[k, 1] + c * directions[k, 2]
        if k >= until_k and k < last:
            from_k, column_from, room_from = until_k, column_until, room_until
            until_k = min(until_k + ROOM_STRIDE, last)
            ahead, left = directions[until_k, 1], directions[until_k, 2]
            column_until, room_until = wall_point(c * ahead - s * left, s * ahead + c * left, eye.x_m, eye.y_m, wall)
            column_until += around * np.rint((column_from - column_until) / around)
        part = (k - from_k) / (until_k - from_k)
        room_m = room_from + part * (room_until - room_from)
        column = column_from + part * (column_until - column_from)

        on_floor, n = True, 0
        lit_ground = light.level
        for e in range(count[k] + 1):
            is_last = e == count[k]
            distance = room_m if is_last else float(entries[k, e, NEAR])
            below = FLOOR if on_floor else PAINT
            thing = EDGE if is_last else int(entries[k, e, THING])
            if thing != EDGE and rows[thing, KIND] == BALL:
                low, high = entries[k, e, LOW], entries[k, e, HIGH]
                n = _end_span(k, n, low, below, floor_colors, GROUND, lit_ground, ends, kinds, paint)
                n = _end_span(k, n, high, OF_BALL + thing, floor_colors, GROUND, 0.0, ends, kinds, paint)
                continue
            x_m, y_m = eye.x_m + distance * cos, eye.y_m + distance * sin
            lit = max(light.level + light.per_m_x * x_m + light.per_m_y * y_m, light.min_level)
            n = _end_span(k, n, -height_m / distance, below, floor_colors, GROUND, lit, ends, kinds, paint)
            if thing != EDGE:
                n = _end_thing(k, n, entries, e, lit, height_m, rows, colors, ends, kinds, paint)
            else:
                on_floor = not on_floor
            lit_ground = lit
        # the wall's colour is taken in the middle between the last edge and just above the horizon
        up = height_m + room_m * (float(ends[k, n - 1]) + 0.02) / 2
        row = min(max(int(up * wall.rows_per_m), 0) + 1, len(wall.cells) - 2)
        ends[k, n], kinds[k, n] = np.float32(math.inf), PAINT
        cell = wall.cells[row, int(column - math.floor(column / around) * around) % around]
        paint[k, n, 0], paint[k, n, 1], paint[k, n, 2] = cell_color(cell)
