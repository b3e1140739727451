"""Compiled: the view along each bearing, as a stack of spans from steeply down to above the horizon.

A ray of one bearing has a slope (rise over run). Things that stand on the floor hide what is behind them from the slope
of their foot up to that of their upper edge, nearest first. A bearing's picture is therefore a list of spans of slope,
and a pixel is the mean over the slopes it covers.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.frame_values import BallSphere, Bearings, Crossings, Lighting, RoomWall, Spans, Things, Viewpoint

# kinds of spans
FLOOR, PAINT, BALL = 0, 1, 2
# columns of `Crossings.entries`
NEAR, FAR, THING, SHADE = range(4)
# the room's wall is computed for every so many bearings, and interpolated between them
ROOM_STRIDE = 16
# columns of `Things.rows`
HEIGHT, BANDS, COLOR, TOP_COLOR, MARKER_COLOR, MARKER_GAP_M2, IS_EDGE = range(7)


@compiled(inline="always")
def _add(bearing: int, near_m: float, far_m: float, thing: int, shade: float, crossings: Crossings) -> None:
    """Insert a thing into a bearing's list, sorted by distance; the farthest falls out of a full list."""
    count, entries = crossings.lengths, crossings.entries
    k = count[bearing]
    is_full = k == entries.shape[1]
    if is_full:
        k -= 1
    if not is_full or entries[bearing, k, NEAR] > near_m:
        count[bearing] = k + 1
        while k > 0 and entries[bearing, k - 1, NEAR] > near_m:
            for column in range(4):
                entries[bearing, k, column] = entries[bearing, k - 1, column]
            k -= 1
        entries[bearing, k, NEAR], entries[bearing, k, FAR] = near_m, far_m
        entries[bearing, k, THING], entries[bearing, k, SHADE] = thing, shade


@compiled(error_model="numpy")
def meet_walls(
    walls: FloatArray,
    first: int,
    eye: Viewpoint,
    bearings: Bearings,
    crossings: Crossings,
) -> None:
    """Enter upright sheets into the lists of the bearings that meet them.

    Parameters
    ----------
    walls : (W, 4) float64
        x0, y0, x1, y1, field frame, metres.
    first : int
        Wall w is thing `first + 2 w` seen from its left and `first + 2 w + 1` from its right.
    crossings : Crossings
        Extended.
    """
    directions, per_turn = bearings.directions, bearings.per_turn
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    per_rad = per_turn / math.tau
    for w in range(len(walls)):
        x, y = walls[w, 0] - eye.x_m, walls[w, 1] - eye.y_m
        ax, ay = c * x + s * y, c * y - s * x
        x, y = walls[w, 2] - eye.x_m, walls[w, 3] - eye.y_m
        bx, by = c * x + s * y, c * y - s * x
        turn = ax * by - ay * bx
        thing = first + 2 * w
        if turn < 0:
            ax, ay, bx, by, turn = bx, by, ax, ay, -turn
            thing += 1
        if turn < 1e-9:
            continue
        low = math.atan2(ay, ax) - directions[0, 0]
        low -= math.floor(low / math.tau) * math.tau
        span = math.atan2(turn, ax * bx + ay * by)
        for i in range(math.ceil(low * per_rad), math.ceil((low + span) * per_rad)):
            k = i if i < per_turn else i - per_turn
            if k >= len(directions):
                continue
            across = directions[k, 2] * (ax - bx) - directions[k, 1] * (ay - by)
            if across > 0:
                distance = turn / across
                _add(k, distance, distance, thing, 1.0, crossings)


@compiled(error_model="numpy")
def meet_cylinders(
    cylinders: FloatArray,
    first: int,
    eye: Viewpoint,
    lamp_rad: float,
    bearings: Bearings,
    crossings: Crossings,
) -> None:
    """Enter upright cylinders, (C, 3) float64: x, y, radius (m), field frame; cylinder i is thing `first + i`.

    Other parameters as in `meet_walls`; `lamp_rad` is the field-frame direction of the light.
    """
    directions, per_turn = bearings.directions, bearings.per_turn
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    lamp_x, lamp_y = math.cos(lamp_rad - eye.heading_rad), math.sin(lamp_rad - eye.heading_rad)
    per_rad = per_turn / math.tau
    for i in range(len(cylinders)):
        dx, dy, radius = cylinders[i, 0] - eye.x_m, cylinders[i, 1] - eye.y_m, cylinders[i, 2]
        x, y = c * dx + s * dy, c * dy - s * dx
        away = math.hypot(x, y)
        if away <= radius:
            continue
        half = math.asin(radius / away)
        low = math.atan2(y, x) - half - directions[0, 0]
        low -= math.floor(low / math.tau) * math.tau
        for j in range(math.ceil(low * per_rad), math.ceil((low + 2 * half) * per_rad)):
            k = j if j < per_turn else j - per_turn
            if k >= len(directions):
                continue
            cos, sin = directions[k, 1], directions[k, 2]
            toward, aside = cos * x + sin * y, cos * y - sin * x
            chord = math.sqrt(max(radius * radius - aside * aside, 0.0))
            distance = toward - chord
            facing = ((distance * cos - x) * lamp_x + (distance * sin - y) * lamp_y) / radius
            _add(k, distance, toward + chord, first + i, 0.75 + 0.20 * facing, crossings)


@compiled(error_model="numpy")
def meet_boxes(
    corners: FloatArray,
    first: int,
    eye: Viewpoint,
    bearings: Bearings,
    crossings: Crossings,
) -> None:
    """Enter upright boxes, (B, 4, 2) float64 corners, field frame (m), counter-clockwise.

    Face f of box b, between corners f - 1 and f, is thing `first + 4 b + f`. Other parameters as in `meet_walls`.
    """
    directions, per_turn = bearings.directions, bearings.per_turn
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    per_rad = per_turn / math.tau
    x, y = np.empty(4), np.empty(4)
    for b in range(len(corners)):
        for f in range(4):
            dx, dy = corners[b, f, 0] - eye.x_m, corners[b, f, 1] - eye.y_m
            x[f], y[f] = c * dx + s * dy, c * dy - s * dx
        middle_x, middle_y = (x[0] + x[2]) / 2, (y[0] + y[2]) / 2
        low, high = 0.0, 0.0
        for f in range(4):
            beside = math.atan2(middle_x * y[f] - middle_y * x[f], middle_x * x[f] + middle_y * y[f])
            low, high = min(low, beside), max(high, beside)
        start = math.atan2(middle_y, middle_x) + low - directions[0, 0]
        start -= math.floor(start / math.tau) * math.tau
        for i in range(math.ceil(start * per_rad), math.ceil((start + high - low) * per_rad)):
            k = i if i < per_turn else i - per_turn
            if k >= len(directions):
                continue
            cos, sin = directions[k, 1], directions[k, 2]
            enter, leave, face = -1.0, math.inf, -1
            for f in range(4):
                g = (f + 3) % 4
                # the line through corners g and f; inside is to its left
                ex, ey = x[f] - x[g], y[f] - y[g]
                at_eye = ey * x[g] - ex * y[g]  # > 0: the eye is on the inner side
                speed = ex * sin - ey * cos
                if abs(speed) < 1e-12:
                    continue
                at = -at_eye / speed
                if speed > 0:
                    if at > enter:
                        enter, face = at, f
                else:
                    leave = min(leave, at)
            if face >= 0 and 0 < enter < leave:
                _add(k, enter, leave, first + 4 * b + face, 1.0, crossings)


@compiled(error_model="numpy")
def _room_wall(along: float, aside: float, c: float, s: float, eye: Viewpoint, radius_m: float) -> tuple[float, float]:
    """Return the distance (m) of the round wall in a direction of the eye's frame, and its azimuth in turns, 0 to 1."""
    cos, sin = c * along - s * aside, s * along + c * aside
    toward = -(cos * eye.x_m + sin * eye.y_m)
    away2 = eye.x_m * eye.x_m + eye.y_m * eye.y_m
    distance = toward + math.sqrt(max(toward * toward + radius_m * radius_m - away2, 0.0))
    turn = math.atan2(eye.y_m + distance * sin, eye.x_m + distance * cos) / math.tau
    return distance, turn - math.floor(turn)


@compiled(inline="always")
def _end_span(
    k: int,
    n: int,
    end: float,
    kind: int,
    colors: FloatArray,
    color: np.uintp,
    light: float,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
) -> int:
    """Append a span to bearing k's stack of n unless it is hidden or the stack is full; return the new n."""
    if (n > 0 and end <= ends[k, n - 1]) or n == ends.shape[1] - 1:
        return n
    ends[k, n], kinds[k, n] = end, kind
    for channel in range(3):
        paint[k, n, channel] = colors[color, channel] * light
    return n + 1


@compiled(error_model="numpy")
def _ball_slopes(toward: float, aside: float, radius: float, height_m: float) -> tuple[float, float, float]:
    """Return where a bearing meets the ball: distance (infinite: never), slopes of the two rays that touch it."""
    # slopes of the rays that touch its section with the bearing's upright plane
    section2 = radius * radius - aside * aside
    if section2 > 0 and toward > 0 and toward * toward > section2:
        drop = height_m - radius
        root = math.sqrt(section2 * (toward * toward + drop * drop - section2))
        low = (-toward * drop - root) / (toward * toward - section2)
        return toward, low, (-toward * drop + root) / (toward * toward - section2)
    return math.inf, 0.0, 0.0


@compiled(error_model="numpy", inline="always")
def _end_thing(
    k: int,
    n: int,
    entries: Float32Array,
    e: int,
    lit: float,
    height_m: float,
    rows: FloatArray,
    colors: FloatArray,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
) -> int:
    """Append the spans of entry e of bearing k to its stack of n: a thing's bands, its top and a marker there."""
    # a row of an array would be counted and let go again, which takes longer than what is read of it
    thing = np.uintp(int(entries[k, e, THING]))
    distance, far, shade = float(entries[k, e, NEAR]), float(entries[k, e, FAR]), entries[k, e, SHADE]
    height, bands, color = rows[thing, HEIGHT], int(rows[thing, BANDS]), np.uintp(int(rows[thing, COLOR]))
    for band in range(bands):
        top = (height * (band + 1) / bands - height_m) / distance
        n = _end_span(k, n, top, PAINT, colors, color + np.uintp(band), lit * shade, ends, kinds, paint)
    if rows[thing, TOP_COLOR] >= 0 and height < height_m:
        drop, top_color = height - height_m, np.uintp(int(rows[thing, TOP_COLOR]))
        middle, half = (distance + far) / 2, (far - distance) / 2
        marker2 = half * half - rows[thing, MARKER_GAP_M2]
        if rows[thing, MARKER_COLOR] >= 0 and marker2 > 0:
            marker, marker_color = math.sqrt(marker2), np.uintp(int(rows[thing, MARKER_COLOR]))
            n = _end_span(k, n, drop / (middle - marker), PAINT, colors, top_color, lit, ends, kinds, paint)
            n = _end_span(k, n, drop / (middle + marker), PAINT, colors, marker_color, lit, ends, kinds, paint)
        n = _end_span(k, n, drop / far, PAINT, colors, top_color, lit, ends, kinds, paint)
    return n


@compiled(error_model="numpy")
def stack_spans(
    crossings: Crossings,
    things: Things,
    bearings: Bearings,
    eye: Viewpoint,
    light: Lighting,
    room: RoomWall,
    ball: BallSphere,
    spans: Spans,
) -> None:
    """Turn each bearing's list into spans of slope, in ascending order.

    Parameters
    ----------
    light : Lighting
        On everything but the room's wall.
    spans : Spans
        Filled.
    """
    directions, count, entries, picture = bearings.directions, crossings.lengths, crossings.entries, room.picture
    ends, kinds, paint, near_ball = spans.ends, spans.kinds, spans.paint, spans.near_ball
    rows, colors, height_m = things.rows, things.colors, eye.height_m
    ground, zero = room.ground.reshape((1, 3)), np.uintp(0)
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    dx, dy = ball.x_m - eye.x_m, ball.y_m - eye.y_m
    ball_x, ball_y = c * dx + s * dy, c * dy - s * dx
    radius, reach = ball.radius_m, ball.shade_reach_m
    from_k, until_k = 0, 0
    room_from, turn_from = _room_wall(directions[0, 1], directions[0, 2], c, s, eye, room.radius_m)
    room_until, turn_until = room_from, turn_from
    for k in range(len(directions)):
        cos, sin = c * directions[k, 1] - s * directions[k, 2], s * directions[k, 1] + c * directions[k, 2]
        if k > until_k:
            from_k, room_from, turn_from = until_k, room_until, turn_until
            until_k = min(until_k + ROOM_STRIDE, len(directions) - 1)
            room_until, turn_until = _room_wall(
                directions[until_k, 1], directions[until_k, 2], c, s, eye, room.radius_m
            )
            turn_until += np.rint(turn_from - turn_until)
        part = (k - from_k) / max(until_k - from_k, 1)
        room_m = room_from + part * (room_until - room_from)
        turn = turn_from + part * (turn_until - turn_from)
        column = int((turn - math.floor(turn)) * picture.shape[1]) % picture.shape[1]

        toward = directions[k, 1] * ball_x + directions[k, 2] * ball_y
        aside = directions[k, 1] * ball_y - directions[k, 2] * ball_x
        near_ball[k] = radius > 0 and abs(aside) < reach and toward > -reach
        ball_m, ball_low, ball_high = _ball_slopes(toward, aside, radius, height_m)

        on_floor, n = True, 0
        lit_ground = light.level
        for e in range(count[k] + 1):
            is_last = e == count[k]
            distance = room_m if is_last else float(entries[k, e, NEAR])
            if ball_m < distance:
                n = _end_span(
                    k, n, ball_low, FLOOR if on_floor else PAINT, ground, zero, lit_ground, ends, kinds, paint
                )
                n = _end_span(k, n, ball_high, BALL, ground, zero, 0.0, ends, kinds, paint)
                ball_m = math.inf
            x_m, y_m = eye.x_m + distance * cos, eye.y_m + distance * sin
            lit = max(light.level + light.per_m_x * x_m + light.per_m_y * y_m, light.min_level)
            n = _end_span(
                k, n, -height_m / distance, FLOOR if on_floor else PAINT, ground, zero, lit, ends, kinds, paint
            )
            if is_last:
                break
            if rows[int(entries[k, e, THING]), IS_EDGE]:
                on_floor = not on_floor
            n = _end_thing(k, n, entries, e, lit, height_m, rows, colors, ends, kinds, paint)
            lit_ground = lit
        # seen at the middle between the last edge and the horizon
        up = height_m + room_m * (float(ends[k, n - 1]) + 0.02) / 2
        row = min(max(int(up * room.rows_per_m), 0), picture.shape[0] - 1)
        ends[k, n], kinds[k, n] = np.float32(math.inf), PAINT
        for channel in range(3):
            paint[k, n, channel] = picture[row, column, channel]
