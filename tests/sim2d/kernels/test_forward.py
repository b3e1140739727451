"""The compiled loops of a forward camera's frame against plain code."""

import math

import numpy as np
import pytest

from robocup_vision.camera.projection import camera_rotation
from sim2d.kernels.forward.floor import cover_arc, cover_line, end_carpet, fill_floor, is_inside, shade_floor
from sim2d.kernels.forward.outlines import LINE, THING, bound_hull, outline_floor, outline_things, overlaps
from sim2d.kernels.forward.room import draw_wall, pack_cells, wall_point
from sim2d.kernels.forward.things import BALL, BAR, BOX_TOP, CYLINDER, SHEET, meet_grid, meet_thing
from sim2d.kernels.forward.tiles import draw_forward
from sim2d.kernels.forward.values import (
    FloorPaint,
    ForwardEye,
    ForwardLens,
    Outlines,
    UprightThings,
    WallPicture,
)
from sim2d.kernels.frame_values import Lighting, Nets

EYE = np.array([0.4, -0.3, 0.2], dtype=np.float32)
# rays that all come down to the floor, and their change by a pixel
PIXEL_U, PIXEL_V = np.array([0.0, -0.01, 0.0005]), np.array([-0.001, 0.0, -0.01])
STEPS = np.stack([PIXEL_U, PIXEL_V])
TILE = (4, 6)
V, U = (index.ravel() for index in np.mgrid[: TILE[0], : TILE[1]])
MIDDLES = np.array([1.0, 0.1, -0.3])[:, None] + PIXEL_U[:, None] * U + PIXEL_V[:, None] * V
RAYS = MIDDLES.astype(np.float32)
SQUARE = np.array([[-1.0, -1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [-1, 1, -1, -1]])
LAMP = np.array([math.cos(0.9), math.sin(0.9)], dtype=np.float32)


def floor_points(samples=8):
    """Return floor points (N, S, 2) of many rays a pixel, field frame."""
    at = (np.arange(samples) + 0.5) / samples - 0.5
    a, b = (index.ravel() for index in np.meshgrid(at, at))
    rays = MIDDLES[:, :, None] + PIXEL_U[:, None, None] * a + PIXEL_V[:, None, None] * b
    return (EYE[:2, None, None] + rays[:2] * (EYE[2] / -rays[2])).transpose(1, 2, 0)


def outlines(count):
    return Outlines(np.zeros((count, 10), dtype=np.float32), np.zeros((count, 3), dtype=np.int32))


def paint(lines=(), arcs=(), edges=SQUARE, is_convex=True):
    rows = np.array(lines, dtype=float).reshape(-1, 5), np.array(arcs, dtype=float).reshape(-1, 6)
    colors = np.array([[40, 120, 40], [250, 250, 250], [90, 90, 90]], dtype=np.float32)
    return FloorPaint(*rows, 0.02, edges, is_convex, colors)


def test_the_light_on_the_floor_changes_evenly():
    light = np.array([1.0, 0.1, -0.05, 0.9], dtype=np.float32)
    out = np.empty(RAYS.shape[1], dtype=np.float32)
    fill_floor(RAYS, EYE, light, out)
    x, y = floor_points(1)[:, 0].T
    assert out == pytest.approx(np.maximum(1.0 + 0.1 * x - 0.05 * y, 0.9), abs=1e-5)


def test_paint_of_lines_and_arcs_is_what_rays_meet():
    middle = floor_points(1)[len(U) // 2, 0]
    covered = np.zeros(RAYS.shape[1], dtype=np.float32)
    line = np.array([middle[0] - 0.5, middle[1], 1.0, 0.0, 0.5])
    cover_line(line, 0.02, (0, RAYS.shape[1]), RAYS, STEPS, EYE, covered)
    points = floor_points()
    on_line = np.abs(points[..., 1] - middle[1]) <= 0.02
    on_line &= (points[..., 0] <= middle[0] + 0.02) & (points[..., 0] >= middle[0] - 0.52)
    assert np.abs(covered - on_line.mean(axis=1)).mean() < 0.02
    covered[:] = 0
    arc = np.array([middle[0], middle[1] + 0.3, 0.3, 0.0, -1.0, 0.0])
    cover_arc(arc, 0.02, RAYS, STEPS, EYE, covered)
    off = points - arc[:2]
    on_arc = (np.abs(np.hypot(*off.transpose(2, 0, 1)) - 0.3) <= 0.02) & (off[..., 1] <= 0)
    assert np.abs(covered - on_arc.mean(axis=1)).mean() < 0.02
    assert 0.05 < on_arc.mean() < 0.9


@pytest.mark.parametrize("is_convex", [True, False])
def test_a_carpet_ends_at_its_edges(is_convex):
    middle = floor_points(1)[len(U) // 2, 0]
    edges = SQUARE + np.tile(middle - (1.0, 0.3), 2)
    carpet = np.empty(RAYS.shape[1], dtype=np.float32)
    near = np.arange(4, dtype=np.int32)
    end_carpet(paint(edges=edges, is_convex=is_convex), near, 4, RAYS, STEPS, EYE, carpet)
    points = floor_points()
    inside = (np.abs(points - (middle - (1.0, 0.3))) <= 1).all(axis=2)
    assert np.abs(carpet - inside.mean(axis=1)).mean() < 0.03
    assert all(
        is_inside(edges, *point) == bool((np.abs(point - (middle - (1.0, 0.3))) <= 1).all()) for point in points[:, 0]
    )


def test_the_floor_is_dark_around_a_balls_foot():
    x, y = floor_points(1)[:, 0].T
    ball = np.array([x[7] - EYE[0], y[7] - EYE[1], 0.04], dtype=np.float32)
    tone = np.ones(len(x), dtype=np.float32)
    shade_floor(ball, 0.12, RAYS, EYE[2], tone)
    away2 = (x - x[7]) ** 2 + (y - y[7]) ** 2
    want = np.where(away2 < 0.12**2, 1 - 0.55 * np.exp(-away2 / 0.04**2), 1.0)
    assert tone == pytest.approx(want, abs=1e-3)


def test_the_wall_is_met_where_a_ray_leaves_the_room():
    wall = WallPicture(pack_cells(np.zeros((4, 100, 3), dtype=np.float32)), 100, 10.0, 3.0)
    column, up = wall_point((0.6, -0.3, 0.2), (0.5, 0.4, 0.2), wall)
    t = (up - 0.2) / 0.2
    point = np.array([0.5 + 0.6 * t, 0.4 - 0.3 * t])
    assert math.hypot(*point) == pytest.approx(3.0)
    assert column == pytest.approx(math.atan2(point[1], point[0]) / math.tau * 100)


def test_the_wall_is_averaged_over_a_pixels_footprint():
    rng = np.random.default_rng(2)
    picture = rng.uniform(0, 300, (6, 40, 3)).astype(np.float32)
    wall = WallPicture(pack_cells(picture), 40, 10.0, 3.0)
    rows, columns = 4, 8
    # columns from 38.2 on, over the seam; heights down to the floor
    at_columns, at_up = np.linspace(38.2, 42.2, columns + 1), np.linspace(0.35, -0.05, rows + 1)
    corners = np.zeros((2, 3, 2))
    corners[..., 0], corners[..., 1] = at_columns[[0, 4, 8]], at_up[[0, -1]][:, None]
    colors = np.full((3, rows * columns), 7.0, dtype=np.float32)
    scratch = np.zeros((4, rows * columns), dtype=np.int32), np.zeros(rows * columns, dtype=np.uint64)
    places = np.tile(np.arange(columns, dtype=np.float32), rows)
    draw_wall(corners, (rows, columns), wall, wall.cells.reshape(-1), places, *scratch, colors)
    fine = 64
    c = np.interp(np.arange(columns * fine) / fine + 0.5 / fine, np.arange(columns + 1), at_columns)
    up = np.interp(np.arange(rows * fine) / fine + 0.5 / fine, np.arange(rows + 1), at_up)
    cells = picture[np.clip((up * 10).astype(int), 0, 5)[:, None], c.astype(int)[None, :] % 40]
    want = cells.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3))
    got = colors.T.reshape(rows, columns, 3)
    assert np.abs(got[:-1] - want[:-1]).max() < 3.0
    assert got[-1] == pytest.approx(0.5 * want[-1] + 0.5 * 7.0, abs=2.5)  # half of them look at the floor


THINGS = {
    SHEET: [SHEET, 1.0, -0.5, 1.2, 0.6, 0.0, 0.4, 0, 1, 1],
    CYLINDER: [CYLINDER, 1.2, 0.1, 0, 0, 0.2, 0.15, 0, 3, 3],
    BAR: [BAR, 1.0, -0.5, 1.3, 0.6, 0.06, 0.3, 0, 1, -1],
    BALL: [BALL, 0.9, 0.1, 0, 0, 0.1, 0.2, 0, 1, -1],
    BOX_TOP: [BOX_TOP, 1.0, 0.1, math.cos(0.4), math.sin(0.4), 0.3, 0.1, 0, 1, 0.2],
}


def is_on(kind, row, p):
    """Return whether a point (from the eye's foot) is on or in a thing."""
    _, x, y, x1, y1, radius, height, *_ = row
    if kind == SHEET:
        along = np.array([x1 - x, y1 - y]) / math.hypot(x1 - x, y1 - y)
        off = p[:2] - (x, y)
        return abs(off @ (-along[1], along[0])) < 2e-3 and 0 <= off @ along <= 1.2 and 0 <= p[2] <= height
    if kind == CYLINDER:
        return math.hypot(p[0] - x, p[1] - y) <= radius and 0 <= p[2] <= height
    if kind == BAR:
        along = np.array([x1 - x, y1 - y]) / math.hypot(x1 - x, y1 - y)
        off = p[:2] - (x, y)
        inside = math.hypot(off @ (-along[1], along[0]), p[2] - height) <= radius
        return inside and 0 <= off @ along <= math.hypot(x1 - x, y1 - y)
    if kind == BALL:
        return math.dist(p, (x, y, radius)) <= radius
    c, s = x1, y1
    off = p[:2] - (x, y)
    return abs(p[2] - height) < 4e-4 and abs(off @ (c, s)) <= radius and abs(off @ (-s, c)) <= row[9]


@pytest.mark.parametrize("kind", THINGS)
def test_a_ray_meets_a_thing_where_it_first_is(kind):
    rng = np.random.default_rng(kind)
    row = THINGS[kind]
    height = 0.25
    met = 0
    t_of = np.arange(0.3, 3.0, 2e-3 if kind != BOX_TOP else 5e-4)
    for _ in range(120):
        d = np.array([1.0, rng.uniform(-0.4, 0.5), rng.uniform(-0.35, 0.15)])
        t, _, shade = meet_thing(
            np.float32(kind), np.array(row, np.float32), *d.astype(np.float32), np.float32(height), LAMP
        )
        points = np.array([0, 0, height]) + t_of[:, None] * d
        inside = [is_on(kind, row, p) for p in points]
        if any(inside):
            met += 1
            if t < 1e20:
                assert t == pytest.approx(t_of[int(np.argmax(inside))], abs=8e-3)
            else:  # a mere touch
                assert sum(inside) < 30
        else:
            assert t > 1e20 or t > 3.0 or kind in (SHEET, BOX_TOP)
        assert t > 1e20 or 0.2 <= shade <= 1.1
    assert met > 3


def test_a_grid_of_rays_keeps_the_nearest_thing():
    rows = [np.array(THINGS[kind], np.float32) for kind in THINGS]
    a, b = (index.ravel() for index in np.meshgrid(np.linspace(-0.4, 0.5, 9), np.linspace(-0.35, 0.1, 7)))
    grid = np.stack([np.ones_like(a), a, b]).astype(np.float32)
    depth, ids = np.full(63, 1e29, dtype=np.float32), np.full(63, -1, dtype=np.int32)
    for k, row in enumerate(rows):
        meet_grid(row, np.int32(100 * k), grid, (0, 7, 0, 9), 9, np.float32(0.25), LAMP, depth, ids)
    for i in range(63):
        met = [meet_thing(row[0], row, *grid[:, i], np.float32(0.25), LAMP) for row in rows]
        first = int(np.argmin([t for t, _, _ in met]))
        want = 100 * first + met[first][1] if met[first][0] < 1e20 else -1
        assert ids[i] == want


def eye_at(tilt=-0.2, roll=0.1):
    return ForwardEye(0.1, 0.2, 0.3, np.ascontiguousarray(camera_rotation(0.4, tilt, roll)), np.zeros(3))


def slopes_of(points, eye):
    camera = points @ eye.rotation
    return -camera[:, 1:] / camera[:, :1], camera[:, 0] > 0.01


def test_a_hull_is_bounded_along_four_axes():
    rng = np.random.default_rng(9)
    eye, bounds = eye_at(), np.zeros(10, dtype=np.float32)
    assert bound_hull(np.array([[-1.0, 0.0, 0.0]] * 8), 8, eye, 0.01, bounds) == -1
    for _ in range(20):
        points = rng.uniform(-1, 1, (8, 3)) + np.array([1.0, 0.4, 0.0])
        if bound_hull(points, 8, eye, 0.01, bounds) < 0:
            continue
        weights = rng.dirichlet(np.full(8, 0.3), 400)
        slopes, ahead = slopes_of(weights @ points, eye)
        slopes = slopes[ahead]
        c, s = bounds[8:]
        along = np.stack([slopes[:, 0], slopes[:, 1], slopes @ (c, s), slopes @ (-s, c)], axis=1)
        low, high = bounds[0:8:2], bounds[1:8:2]
        assert (along >= low - 1e-3 * (1 + np.abs(along))).all()
        assert (along <= high + 1e-3 * (1 + np.abs(along))).all()
        for right, down in slopes[:50].tolist():
            assert overlaps(bounds, right - 0.01, right + 0.01, down - 0.01, down + 0.01)
        assert not overlaps(bounds, float(high[0]) + 0.1, float(high[0]) + 0.2, -9.0, 9.0)


def test_outlines_hold_what_is_painted_and_what_stands_there():
    eye = eye_at()
    drawn = paint(lines=[[0.5, 0.2, 0.6, 0.8, 1.0]], arcs=[[1.5, 0.8, 0.4, 1.0, 0.0, -2.0]])
    things = UprightThings(np.array([[k[0], k[1] + 0.8, k[2] + 0.5, *k[3:]] for k in THINGS.values()]), np.ones((4, 3)))
    things.rows[:, 3:5] += np.where(np.isin(things.rows[:, :1], (SHEET, BAR)), (0.8, 0.5), 0.0)
    to = outlines(60)
    count = outline_floor(drawn, eye, 0.01, to)
    assert (to.owners[:count, 0] == LINE).sum() == 1
    middle = np.array([[0.8 - eye.x_m, 0.6 - eye.y_m, -eye.height_m]])
    (right, down), _ = slopes_of(middle, eye)[0][0], None
    line = to.bounds[:count][to.owners[:count, 0] == LINE][0]
    assert overlaps(line, right, right, down, down)
    more = outline_things(things, eye, 0.1, 0.01, count, to)
    stand = to.owners[count:more]
    assert stand[stand[:, 0] == THING, 1].tolist() == [0, 1, 2, 3, 4]
    cylinder = to.bounds[count:more][(stand[:, 0] == THING) & (stand[:, 1] == 1)][0]
    place = things.rows[1, 1:3] - (eye.x_m, eye.y_m)
    for up in (0.01, 0.14):
        right, down = slopes_of(np.array([[*place, up - eye.height_m]]), eye)[0][0]
        assert overlaps(cylinder, right, right, down, down)


def test_an_empty_room_is_floor_below_and_wall_above():
    size = (4, 4)
    slope = np.linspace(-0.35, 0.35, 8)
    corner = np.linspace(-0.4, 0.4, 9)
    corner_slopes = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 5), corner[::4]), axis=-1)
    low = np.array([-0.5, -0.1])
    bounds = np.zeros((2, 2, 4), dtype=np.float32)
    bounds[..., 0], bounds[..., 1] = low, low + 0.6
    bounds[..., 2], bounds[..., 3] = low[:, None], low[:, None] + 0.6
    per_pixel = np.tile(np.array([0.1, 0, 0, 0.1], dtype=np.float32), (2, 2, 1))
    places = np.stack([np.tile(np.arange(4), 4), np.repeat(np.arange(4), 4)]).astype(np.float32)
    lens = ForwardLens(
        np.zeros((0, 0, 2, 16), np.float32), np.ones((2, 2, 16), np.float32), corner_slopes, per_pixel, bounds, places
    )
    eye = ForwardEye(0.0, 0.0, 0.2, np.eye(3), np.zeros(3))
    far = SQUARE * 50
    wall = WallPicture(pack_cells(np.full((9, 60, 3), 200.0, dtype=np.float32)), 60, 4.0, 60.0)
    planes = np.zeros((3, 8, 8), dtype=np.uint8)
    light = Lighting(1.0, 0.0, 0.0, 0.05, 0.9)
    nothing = UprightThings(np.zeros((0, 10)), np.zeros((0, 3), dtype=np.float32))
    no_nets = Nets(np.zeros((0, 14)), np.zeros(3, dtype=np.float32))
    draw_forward(lens, eye, paint(edges=far), nothing, no_nets, 0.1, light, wall, outlines(4), size, planes)
    assert (planes[:, slope < -0.1] == 200).all()
    assert planes[:, slope > 0.1, 3].T.tolist() == [[40, 120, 40]] * 3
