"""Compiled intersection of rays with objects on the floor: sheet, cylinder, bar, ball, box.

A ray starts at the eye; its direction may have any length. Coordinates are along the field's axes, from the eye's foot.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, Int32Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.frame_values import UprightThings

# kinds of things
SHEET, CYLINDER, BAR, BALL, BOX = range(5)
# Columns of `UprightThings.rows`:
# X0, Y0: position; for a sheet or bar its start
# X1, Y1: end of a sheet or bar; for a box the direction of its width; for a ball its turns about x and y
# RADIUS: radius; for a box half its width
# HEIGHT: height; for a bar that of its axis
# COLOR: number of the first colour
# BANDS: number of colour bands; for a box its four faces (right, ahead, left and behind of the direction of its width)
#   and its top; for a ball its turn about z
# OTHER: colour of a sheet's right side, of a cylinder's marker or of a ball's patches (-1: none); half a box's depth
KIND, X0, Y0, X1, Y1, RADIUS, HEIGHT, COLOR, BANDS, OTHER = range(10)
COLUMNS = 10
# number of low bits that hold the colour in an id of a thing and one of its colours
ID_BITS = 12
MARKER_RATIO = np.float32(0.3)  # radius of a robot's marker divided by the robot's
# A ball's dark pentagons are at the corners of an icosahedron: (0, 1, golden) over its length, with all signs and
# cyclic permutations. Each is drawn as a disc of the same area; the twelve cover 28 % of a ball whose edges are equally
# long.
_GOLDEN = np.float32((1 + math.sqrt(5)) / 2)
_PATCH_REACH = np.float32((1 - 2 * 0.284 / 12) * math.hypot(1.0, (1 + math.sqrt(5)) / 2))
_NOTHING = np.float32(1e30)
_ZERO, _ONE, _MIN_DROP = np.float32(0.0), np.float32(1.0), np.float32(1e-6)
# a row of `UprightThings.rows`, or its numbers
ThingRow = Float32Array | tuple[np.float32, ...]


@compiled(inline="always")
def row_of(rows: Float32Array, k: np.uintp) -> tuple[np.float32, ...]:
    """Return a row as a tuple of numbers, since creating and releasing an array view takes longer than reading it."""
    first = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4]
    return (*first, rows[k, 5], rows[k, 6], rows[k, 7], rows[k, 8], rows[k, 9])


@compiled(error_model="numpy")
def rows_from_eye(things: UprightThings, eye_x_m: float, eye_y_m: float) -> Float32Array:
    """Return the rows of things, moved so that the eye's foot is the origin."""
    rows = things.rows.astype(np.float32)
    for k in range(len(rows)):
        rows[k, X0] = np.float32(things.rows[k, X0] - eye_x_m)
        rows[k, Y0] = np.float32(things.rows[k, Y0] - eye_y_m)
        if rows[k, KIND] == SHEET or rows[k, KIND] == BAR:
            rows[k, X1] = np.float32(things.rows[k, X1] - eye_x_m)
            rows[k, Y1] = np.float32(things.rows[k, Y1] - eye_y_m)
    return rows


@compiled(error_model="numpy")
def foot_circle(row: Float32Array) -> tuple[float, float, float]:
    """Return x, y and radius of a circle on the floor that contains a thing's foot."""
    kind, x, y, radius = row[KIND], float(row[X0]), float(row[Y0]), float(row[RADIUS])
    if kind == SHEET or kind == BAR:
        end_x, end_y = float(row[X1]), float(row[Y1])
        return (x + end_x) / 2, (y + end_y) / 2, radius + math.hypot(end_x - x, end_y - y) / 2
    return x, y, math.hypot(radius, float(row[OTHER])) if kind == BOX else radius


@compiled(error_model="numpy", inline="always")
def _meet_cylinder(
    row: ThingRow, dx: np.float32, dy: np.float32, dz: np.float32, height: np.float32, lamp: Float32Array
) -> tuple[np.float32, np.int32, np.float32]:
    # without branches, so that the compiler can vectorise over several rays
    x, y, radius, top, bands = row[X0], row[Y0], row[RADIUS], row[HEIGHT], row[BANDS]
    radius2 = radius * radius
    toward, flat2 = dx * x + dy * y, dx * dx + dy * dy
    # a cross product, which avoids the cancellation of a difference of large squares
    aside = dx * y - dy * x
    root2 = radius2 * flat2 - aside * aside
    t = (toward - np.float32(math.sqrt(max(root2, _ZERO)))) / flat2
    up = height + t * dz
    on_side = (root2 >= _ZERO) & (t > _ZERO) & (up >= _ZERO) & (up <= top)
    band = np.int32(min(max(up, _ZERO) * bands / top, bands - _ONE))
    facing = ((t * dx - x) * lamp[0] + (t * dy - y) * lamp[1]) / radius
    t_top = (top - height) / min(dz, -_MIN_DROP)
    from_x, from_y = t_top * dx - x, t_top * dy - y
    from2 = from_x * from_x + from_y * from_y
    on_top = (top < height) & (dz < -_MIN_DROP) & (from2 <= radius2)
    marked = (row[OTHER] >= _ZERO) & (from2 <= radius2 * MARKER_RATIO * MARKER_RATIO)
    top_color = np.int32(row[OTHER]) if marked else np.int32(row[COLOR] + bands - _ONE)
    color = np.int32(row[COLOR]) + band if on_side else top_color
    shade = np.float32(0.75) + np.float32(0.20) * facing if on_side else _ONE
    found = t if on_side else t_top
    return (found if on_side | on_top else _NOTHING), color, shade


@compiled(error_model="numpy", inline="always")
def _meet_sheet(
    row: ThingRow, dx: np.float32, dy: np.float32, dz: np.float32, height: np.float32
) -> tuple[np.float32, np.int32, np.float32]:
    ax, ay, bx, by = row[X0], row[Y0], row[X1], row[Y1]
    turn = ax * by - ay * bx
    sign = _ONE if turn >= _ZERO else -_ONE
    past_a, past_b = sign * (ax * dy - ay * dx), sign * (bx * dy - by * dx)
    t = sign * turn / max(past_a - past_b, np.float32(1e-12))
    up = height + t * dz
    is_met = (past_a >= _ZERO) & (past_b < _ZERO) & (up >= _ZERO) & (up <= row[HEIGHT]) & (abs(turn) > np.float32(1e-9))
    return (t if is_met else _NOTHING), np.int32(row[COLOR] if turn >= _ZERO else row[OTHER]), _ONE


@compiled(error_model="numpy", inline="always")
def _meet_bar(
    row: ThingRow, dx: np.float32, dy: np.float32, dz: np.float32, height: np.float32
) -> tuple[np.float32, np.int32, np.float32]:
    ax, ay = row[X1] - row[X0], row[Y1] - row[Y0]
    length = np.float32(math.sqrt(ax * ax + ay * ay))
    ax, ay = ax / length, ay / length
    # in the plane perpendicular to the axis: ray (across, dz) from the eye, circle at (offset, rise)
    across, offset, rise = dy * ax - dx * ay, row[Y0] * ax - row[X0] * ay, row[HEIGHT] - height
    norm2, toward = max(across * across + dz * dz, np.float32(1e-12)), across * offset + dz * rise
    beside, radius = across * rise - dz * offset, row[RADIUS]
    root2 = norm2 * radius * radius - beside * beside
    t = (toward - np.float32(math.sqrt(max(root2, _ZERO)))) / norm2
    along = t * (dx * ax + dy * ay) - row[X0] * ax - row[Y0] * ay
    is_met = (root2 >= _ZERO) & (t > _ZERO) & (along >= _ZERO) & (along <= length)
    up = (t * dz - rise) / radius
    return (t if is_met else _NOTHING), np.int32(row[COLOR]), np.float32(0.80) + np.float32(0.20) * up


@compiled(error_model="numpy")
def _is_patch(row: ThingRow, nx: np.float32, ny: np.float32, nz: np.float32) -> bool:
    """Whether a ball has a dark patch at a unit normal; the normal is turned back about z, y, x to the ball's axes."""
    c, s = np.float32(math.cos(row[BANDS])), np.float32(math.sin(row[BANDS]))
    nx, ny = c * nx + s * ny, c * ny - s * nx
    c, s = np.float32(math.cos(row[Y1])), np.float32(math.sin(row[Y1]))
    nz, nx = c * nz + s * nx, c * nx - s * nz
    c, s = np.float32(math.cos(row[X1])), np.float32(math.sin(row[X1]))
    ny, nz = abs(c * ny + s * nz), abs(c * nz - s * ny)
    nx = abs(nx)
    return bool(max(ny + _GOLDEN * nz, nx + _GOLDEN * ny, nz + _GOLDEN * nx) > _PATCH_REACH)


@compiled(error_model="numpy", inline="always")
def meet_ball(
    row: ThingRow, dx: np.float32, dy: np.float32, dz: np.float32, height: np.float32, lamp: Float32Array
) -> tuple[np.float32, np.int32, np.float32]:
    """Return where a ray meets a ball, as `meet_thing`; a ray that misses it gets the shade of the ball's rim."""
    x, y, radius = row[X0], row[Y0], row[RADIUS]
    z = radius - height
    toward, norm2 = dx * x + dy * y + dz * z, dx * dx + dy * dy + dz * dz
    root2 = toward * toward - norm2 * (x * x + y * y + z * z - radius * radius)
    is_met = (root2 >= _ZERO) & (toward > _ZERO)
    t = (toward - np.float32(math.sqrt(max(root2, _ZERO)))) / norm2
    nx, ny, nz = (t * dx - x) / radius, (t * dy - y) / radius, (t * dz - z) / radius
    lit = np.float32(0.5) * (nx * lamp[0] + ny * lamp[1]) + np.float32(math.sqrt(0.75)) * nz
    is_dark = is_met and row[OTHER] >= _ZERO and _is_patch(row, nx, ny, nz)
    color = np.int32(row[OTHER] if is_dark else row[COLOR])
    return (t if is_met else _NOTHING), color, np.float32(0.62) + np.float32(0.42) * lit


@compiled(error_model="numpy", inline="always")
def meet_box_sides(row: ThingRow, dx: np.float32, dy: np.float32) -> tuple[np.float32, np.float32, np.int32]:
    """Return where a ray enters and leaves a box seen from above, in lengths of its direction, and by which face."""
    x, y, c, s = row[X0], row[Y0], row[X1], row[Y1]
    box_x, box_y = x * c + y * s, y * c - x * s
    ray_x, ray_y = dx * c + dy * s, dy * c - dx * s
    least = np.float32(1e-9)
    ray_x = ray_x if abs(ray_x) > least else least
    ray_y = ray_y if abs(ray_y) > least else least
    half_x, half_y = row[RADIUS] if ray_x > _ZERO else -row[RADIUS], row[OTHER] if ray_y > _ZERO else -row[OTHER]
    enter_x, enter_y = (box_x - half_x) / ray_x, (box_y - half_y) / ray_y
    leave = min((box_x + half_x) / ray_x, (box_y + half_y) / ray_y)
    by_x, by_y = np.int32(3 if ray_x > _ZERO else 1), np.int32(0 if ray_y > _ZERO else 2)
    return max(enter_x, enter_y), leave, by_x if enter_x > enter_y else by_y


@compiled(error_model="numpy", inline="always")
def _meet_box(
    row: ThingRow, dx: np.float32, dy: np.float32, dz: np.float32, height: np.float32
) -> tuple[np.float32, np.int32, np.float32]:
    enter, leave, face = meet_box_sides(row, dx, dy)
    top, first = row[HEIGHT], np.int32(row[COLOR])
    up = height + enter * dz
    if _ZERO < enter < leave and _ZERO <= up <= top:
        return enter, first + face, _ONE
    t = (top - height) / min(dz, -_MIN_DROP)
    is_on_top = top < height and dz < -_MIN_DROP and enter <= t <= leave
    return (t if is_on_top else _NOTHING), first + np.int32(4), _ONE


@compiled(error_model="numpy", inline="always")
def meet_thing(
    kind: np.float32,
    row: ThingRow,
    dx: np.float32,
    dy: np.float32,
    dz: np.float32,
    height: np.float32,
    lamp: Float32Array,
) -> tuple[np.float32, np.int32, np.float32]:
    """Return where a ray meets a thing: distance in lengths of its direction (`_NOTHING`: never), colour, shade.

    Parameters
    ----------
    row : (10,) float32, or its numbers
        A row of `UprightThings.rows`, with the eye's foot as the origin.
    dx, dy, dz : float32
        Direction of the ray, field axes.
    height : float32
        Height of the eye above the floor, metres.
    lamp : (2,) float32
        Unit direction towards the light, field axes.
    """
    if kind == CYLINDER:
        return _meet_cylinder(row, dx, dy, dz, height, lamp)
    if kind == SHEET:
        return _meet_sheet(row, dx, dy, dz, height)
    if kind == BAR:
        return _meet_bar(row, dx, dy, dz, height)
    if kind == BALL:
        return meet_ball(row, dx, dy, dz, height, lamp)
    return _meet_box(row, dx, dy, dz, height)


@compiled(error_model="numpy")
def meet_grid(
    row: ThingRow,
    first_id: np.int32,
    grid: Float32Array,
    part: tuple[int, int, int, int],
    wide: int,
    height: np.float32,
    lamp: Float32Array,
    depth: Float32Array,
    ids: Int32Array,
) -> None:
    """Intersect part of a grid of rays with one thing, and keep the nearest intersections.

    Parameters
    ----------
    row : (10,) float32
        As in `meet_thing`.
    first_id : int32
        Id of the thing with its first colour.
    grid : (3, G) float32
        Directions of the rays, row by row.
    part : (int, int, int, int)
        First row, row after the last, first column, column after the last.
    wide : int
        Number of rays in a row of the grid.
    height, lamp
        As in `meet_thing`.
    depth : (G,) float32
        Distance of the nearest thing so far, in lengths of the rays' directions; updated.
    ids : (G,) int32
        Its id; updated.
    """
    kind, dx, dy, dz = row[KIND], grid[0], grid[1], grid[2]
    many = np.uintp(max(part[3] - part[2], 0))
    for v in range(part[0], part[1]):
        start = np.uintp(v * wide + part[2])
        if kind == CYLINDER:
            for u in range(many):
                k = start + u
                t, color, _ = _meet_cylinder(row, dx[k], dy[k], dz[k], height, lamp)
                is_nearer = t < depth[k]
                depth[k], ids[k] = t if is_nearer else depth[k], first_id + color if is_nearer else ids[k]
        elif kind == SHEET:
            for u in range(many):
                k = start + u
                t, color, _ = _meet_sheet(row, dx[k], dy[k], dz[k], height)
                is_nearer = t < depth[k]
                depth[k], ids[k] = t if is_nearer else depth[k], first_id + color if is_nearer else ids[k]
        elif kind == BAR:
            for u in range(many):
                k = start + u
                t, color, _ = _meet_bar(row, dx[k], dy[k], dz[k], height)
                is_nearer = t < depth[k]
                depth[k], ids[k] = t if is_nearer else depth[k], first_id + color if is_nearer else ids[k]
        else:
            for u in range(many):
                k = start + u
                t, color, _ = meet_thing(kind, row, dx[k], dy[k], dz[k], height, lamp)
                is_nearer = t < depth[k]
                depth[k], ids[k] = t if is_nearer else depth[k], first_id + color if is_nearer else ids[k]
