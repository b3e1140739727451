"""The compiled rays of a tile against plain code, and what stands in a tile against four rays a pixel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.camera.projection import camera_rotation
from sim2d.kernels.forward.outlines import THING, THING_ROWS, outline_things
from sim2d.kernels.forward.rays import (
    camera_ray,
    cast,
    cast_corners,
    fill_slopes,
    pixels_of,
    turn_bounds,
    turn_slopes,
    turned,
)
from sim2d.kernels.forward.standing import draw_things
from sim2d.kernels.forward.things import COLUMNS, CYLINDER, SHEET, meet_thing
from sim2d.kernels.forward.values import ForwardEye, ForwardLens, Outlines, UprightThings

TILE = (6, 8)
V, U = (index.ravel() for index in np.mgrid[: TILE[0], : TILE[1]])
PER_PIXEL = np.array([0.05, 0.001, -0.002, 0.05], dtype=np.float32)
CORNER = np.array([-0.2, -0.1])  # slopes at the tile's corner
SHUTTER = (0.02, -0.03, 0.04, 1 / 11)  # turn about ahead, left, up; part of it by a row
ROTATION = np.ascontiguousarray(camera_rotation(0.4, -0.2, 0.1))
LAMP = np.array([math.cos(0.9), math.sin(0.9)], dtype=np.float32)


def lens(slopes=()):
    corner_slopes = np.zeros((2, 3, 2))
    corner_slopes[0, 0] = CORNER
    places = np.stack([U, V]).astype(np.float32)
    each = np.array(slopes, dtype=np.float32).reshape(-1, 1, 2, U.size)
    bounds = np.zeros((1, 1, 4), dtype=np.float32)
    return ForwardLens(each, np.ones((1, 1, U.size), np.float32), corner_slopes, PER_PIXEL[None, None], bounds, places)


def even_slopes():
    """Return the slopes (2, P) of the middles of the tile's pixels."""
    slopes = np.empty((2, U.size), dtype=np.float32)
    fill_slopes(lens(), 0, 0, slopes)
    return slopes


def rotated(right, down, part, turn):
    """Return the slopes of a ray after small turns (rad) of the camera, to the first order."""
    ray = np.array([1.0, -right, -down])
    ray = ray + part * np.cross(turn, ray)
    return -ray[1] / ray[0], -ray[2] / ray[0]


def test_slopes_of_pixels_change_evenly_or_are_the_lenses():
    right, down = even_slopes()
    assert right == pytest.approx(CORNER[0] + PER_PIXEL[0] * (U + 0.5), abs=1e-6)
    assert down == pytest.approx(CORNER[1] + PER_PIXEL[3] * (V + 0.5), abs=1e-6)
    bent, slopes = np.random.default_rng(1).normal(size=(2, U.size)).astype(np.float32), even_slopes()
    fill_slopes(lens(bent), 0, 0, slopes)
    assert np.array_equal(slopes, bent)


def test_a_ray_is_turned_as_a_vector_is():
    rng = np.random.default_rng(2)
    for right, down, part in rng.uniform(-0.5, 0.5, (40, 3)).tolist():
        assert turned(right, down, part, *SHUTTER[:3]) == pytest.approx(rotated(right, down, part, SHUTTER[:3]))


def test_slopes_are_turned_by_the_time_of_their_row():
    slopes, per_pixel = even_slopes(), PER_PIXEL.copy()
    before = slopes.copy()
    turn_slopes(slopes, per_pixel, V.astype(np.float32), 3, SHUTTER)
    for i in range(U.size):
        part = (3 + V[i]) * SHUTTER[3] - 0.5
        assert slopes[:, i] == pytest.approx(rotated(*before[:, i], part, SHUTTER[:3]), abs=1e-5)
    middle = U.size // 2
    by_row = slopes[:, middle + TILE[1]] - slopes[:, middle]
    plain = before[:, middle + TILE[1]] - before[:, middle]
    assert per_pixel[[1, 3]] - PER_PIXEL[[1, 3]] == pytest.approx(by_row - plain, abs=5e-4)


def test_bounds_hold_the_turned_slopes():
    slopes, bounds = even_slopes(), np.array([[-0.2, 0.2, -0.1, 0.2]], dtype=np.float32)
    turn_slopes(slopes, PER_PIXEL.copy(), V.astype(np.float32), 4, SHUTTER)
    turn_bounds(bounds, SHUTTER, 4, TILE[0])
    for low, high, of_axis in ((bounds[0, 0], bounds[0, 1], slopes[0]), (bounds[0, 2], bounds[0, 3], slopes[1])):
        assert (of_axis > low).all()
        assert (of_axis < high).all()


def test_rays_leave_through_pixels_and_their_corners():
    slopes, rays, steps = even_slopes(), np.empty((3, U.size), dtype=np.float32), np.empty((2, 3))
    cast(slopes, PER_PIXEL, ROTATION, rays, steps)
    for i in range(U.size):
        assert rays[:, i] == pytest.approx(ROTATION @ [1.0, -slopes[0, i], -slopes[1, i]], abs=1e-6)
    assert steps[0] == pytest.approx(ROTATION @ [0.0, -PER_PIXEL[0], -PER_PIXEL[2]], abs=1e-7)
    assert steps[1] == pytest.approx(ROTATION @ [0.0, -PER_PIXEL[1], -PER_PIXEL[3]], abs=1e-7)
    corners = np.empty((3, TILE[0] + 1, TILE[1] + 1), dtype=np.float32)
    cast_corners(rays, TILE, steps, corners.reshape(3, -1))
    of_pixel = rays.reshape(3, *TILE)
    half = 0.5 * steps.sum(axis=0)[:, None, None]
    assert corners[:, :-1, :-1] == pytest.approx(of_pixel - half, abs=1e-6)
    assert corners[:, -1, :-1] == pytest.approx(of_pixel[:, -1] - half[:, 0] + steps[1][:, None], abs=1e-6)
    assert corners[:, :, -1] == pytest.approx(corners[:, :, -2] + steps[0][:, None], abs=1e-6)


@pytest.mark.parametrize("bounds", [(-0.2, -0.11, -0.1, -0.02), (-9.0, 9.0, -9.0, 9.0), (0.3, 0.4, 0.3, 0.4)])
def test_pixels_of_an_outline_hold_all_within_its_bounds(bounds):
    slopes = even_slopes()
    v0, v1, u0, u1 = pixels_of(np.array(bounds, dtype=np.float32), slopes, PER_PIXEL, TILE)
    inside = (slopes[0] >= bounds[0]) & (slopes[0] <= bounds[1]) & (slopes[1] >= bounds[2]) & (slopes[1] <= bounds[3])
    assert not inside.any() or (v0 <= V[inside].min() and V[inside].max() <= v1)
    assert not inside.any() or (u0 <= U[inside].min() and U[inside].max() <= u1)
    assert min(v0, u0) >= 0
    assert v1 < TILE[0]
    assert u1 < TILE[1]
    assert inside.all() or (v1 - v0 + 1) * (u1 - u0 + 1) < U.size


def test_things_are_drawn_as_four_rays_a_pixel_meet_them():
    eye = ForwardEye(0.0, 0.0, 0.25, np.ascontiguousarray(camera_rotation(0.0, -0.1, 0.0)), np.zeros(3))
    rows = np.zeros((2, COLUMNS))
    rows[0] = [CYLINDER, 1.1, -0.02, 0, 0, 0.06, 0.3, 0, 1, -1]
    rows[1] = [SHEET, 1.5, -0.4, 1.5, 0.1, 0, 0.2, 1, 1, 1]
    things = UprightThings(rows, np.array([[200, 30, 10], [20, 90, 240]], dtype=np.float32))
    outlines = Outlines(np.zeros((8, 10), dtype=np.float32), np.zeros((8, 3), dtype=np.int32))
    count = outline_things(things, eye, 0.1, 0.0, 0, outlines)
    seen, seen_count = np.zeros((THING_ROWS + 1, 8), dtype=np.int32), np.zeros(THING_ROWS + 1, dtype=np.int64)
    for n in range(count):
        if outlines.owners[n, 0] == THING:
            seen[THING, seen_count[THING]], seen[THING_ROWS, seen_count[THING]] = outlines.owners[n, 1], n
            seen_count[THING] += 1
    slopes, steps = even_slopes(), np.empty((2, 3))
    rays, colors = np.empty((3, U.size), dtype=np.float32), np.full((3, U.size), 100.0, dtype=np.float32)
    per_pixel = np.array([PER_PIXEL[0], 0, 0, PER_PIXEL[3]], dtype=np.float32)
    cast(slopes, per_pixel, eye.rotation, rays, steps)
    here = np.array([0.0, 0.0, 0.25], dtype=np.float32)
    lit = np.array([1.0, 0.1, -0.05, 0.5], dtype=np.float32)
    corners = (TILE[0] + 1) * (TILE[1] + 1)
    nearest = np.zeros((2, U.size), dtype=np.float32)
    draw_things(
        rows.astype(np.float32), things.colors, outlines, seen, seen_count, slopes, per_pixel, TILE, rays, steps, here,
        lit, LAMP, np.zeros(U.size, np.uint8), np.empty((3, corners), np.float32), np.empty(corners, np.int32),
        np.empty(corners, np.float32), nearest, colors,
    )  # fmt: skip

    plain, share, away = np.zeros_like(colors), np.zeros(U.size), np.zeros(U.size)
    row_of = rows.astype(np.float32)
    for a, b in ((-0.375, -0.125), (-0.125, 0.375), (0.125, -0.375), (0.375, 0.125)):
        for i in range(U.size):
            ray = (rays[:, i] + a * steps[0] + b * steps[1]).astype(np.float32)
            met = [meet_thing(row[0], row, *ray, np.float32(0.25), LAMP) for row in row_of]
            t, color, shade = min(met)
            share[i], away[i] = share[i] + (t < 1e20) / 4, away[i] + (t if t < 1e20 else 0.0) / 4
            bright = shade * max(1.0 + 0.1 * t * ray[0] - 0.05 * t * ray[1], 0.5)
            plain[:, i] += bright * things.colors[color] if t < 1e20 else 100.0
    plain /= 4
    assert colors == pytest.approx(plain, abs=4.0)
    assert nearest[1] == pytest.approx(share, abs=1e-6)
    assert (nearest[0] * share)[share > 0] == pytest.approx(away[share > 0], abs=0.01)
    assert len(np.unique(colors[0].round(-1))) > 3


@given(right=st.floats(-2.0, 2.0), down=st.floats(-2.0, 2.0), seed=st.integers(0, 2**31))
def test_a_ray_is_ahead_and_its_slopes_turned(right, down, seed):
    rotation = np.random.default_rng(seed).normal(size=(3, 3))
    np.testing.assert_allclose(camera_ray(rotation, right, down), rotation @ (1.0, -right, -down), atol=1e-12)
