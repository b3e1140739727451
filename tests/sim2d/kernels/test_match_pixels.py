"""The compiled pixels against plain NumPy: paint, carpet, noise, the ball's light."""

import math

import numpy as np
import pytest

from field_models import field_names, load_field
from sim2d.kernels import match_pixels as kernels
from sim2d.rendering.line_grids import make_line_grids
from sim2d.rendering.paint import LinePaint


def cell_of(grid, x, y):
    """Return the number of the cell that holds a point."""
    left, bottom, per_m, columns, _, first = grid
    return int(first) + int((y - bottom) * per_m) * int(columns) + int((x - left) * per_m)


@pytest.mark.parametrize("name", field_names())
def test_painted_share_is_that_of_the_ray_caster(name):
    field = load_field(name)
    grids, paint = make_line_grids(field), LinePaint(field)
    rng = np.random.default_rng(4)
    count = 3000
    low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
    x, y = rng.uniform(low, high, (count, 2)).T.astype(np.float32)
    angle = rng.uniform(-math.pi, math.pi, count).astype(np.float32)
    radial, tangential = rng.uniform(0.002, ((0.08,), (0.01,)), (2, count)).astype(np.float32)
    expected = np.zeros(count)
    where, share = paint.coverage(x, y, np.cos(angle), np.sin(angle), radial, tangential)
    expected[where] = share
    found = []
    levels = grids.level(np.hypot(radial, tangential) / 2)
    for i in range(count):
        cell = cell_of(grids.grids[levels[i]], x[i], y[i])
        patch = float(x[i]), float(y[i]), math.cos(angle[i]), math.sin(angle[i]), float(radial[i]), float(tangential[i])
        near = grids.cells[cell]
        found.append(kernels.painted_share(*patch, grids.half_line_m, near, grids.lines, grids.arcs) if near else 0.0)
        reach = math.hypot(radial[i], tangential[i]) / 2
        clear = grids.clear_m[cell_of(grids.grids[0], x[i], y[i])]
        assert clear < reach or expected[i] == 0
    assert (expected > 0).sum() > 20
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_carpet_is_filled_as_numpy_fills_it():
    rng = np.random.default_rng(0)
    floor = rng.uniform(-2, 2, (3, 500)).astype(np.float32)
    floor[2] = rng.uniform(0, 1.2, 500)
    light, eye = np.array([1.1, 0.2, -0.1, 0.05]), np.array([0.4, -0.3, 0.8])
    color = np.array([50, 130, 245], dtype=np.float32)
    body = np.where(rng.random((3, 500)) < 0.1, 30, 0).astype(np.uint8)
    floor[2, body.any(axis=0)] = 0
    out = np.zeros((3, 500), dtype=np.uint8)
    kernels.fill_carpet(floor, light, eye, color, body, out)
    c, s = math.cos(eye[2]), math.sin(eye[2])
    x, y = eye[0] + c * floor[0] - s * floor[1], eye[1] + s * floor[0] + c * floor[1]
    lit = np.maximum(light[0] + light[1] * x + light[2] * y, light[3]) * floor[2]
    expected = np.minimum(np.floor(lit * color[:, None] + 0.5), 255) + body
    assert np.abs(out - expected).max() <= 1
    assert (out == expected).mean() > 0.99


def test_noise_is_added_and_clipped():
    rng = np.random.default_rng(1)
    frame = rng.integers(0, 256, 1000).astype(np.uint8)
    noise = rng.integers(-90, 90, 1000).astype(np.int16)
    expected = np.clip(frame.astype(int) + noise, 0, 255)
    kernels.add_noise(frame, noise)
    assert (frame == expected).all()


def test_a_ball_is_lightest_where_the_lamp_stands():
    eye, ball = np.array([0.0, 0.0, 0.0]), np.array([0.5, 0.0, 0.02, 0.06])
    drop = 0.2 - 0.02
    straight = kernels.ball_shade(1.0, 0.0, -drop / 0.5, eye, 0.2, ball, math.pi)
    # the ray through the middle meets the near upper side; its normal points back along the ray
    along = np.array([-0.5, 0.0, drop]) / math.hypot(0.5, drop)
    lamp = np.array([-0.5, 0.0, math.sqrt(0.75)])
    assert straight == pytest.approx(0.62 + 0.42 * along @ lamp, abs=1e-9)
    assert kernels.ball_shade(1.0, 0.0, -drop / 0.5, eye, 0.2, ball, 0.0) < straight
