"""The compiled pixels against plain NumPy: paint, carpet, noise, the ball's light."""

import math

import numpy as np
import pytest

from sim2d.kernels import match_pixels as kernels
from sim2d.kernels.bearing_profile import BALL, FLOOR, PAINT
from sim2d.kernels.frame_values import BallSphere, Lighting, PaintMarks, PixelRays, Spans, Viewpoint

LIGHT, EYE = Lighting(1.1, 0.2, -0.1, 0.05, 0.9), Viewpoint(0.4, -0.3, 0.8, 0.2)


def light_at(x, y):
    """Return the level of light at points of the viewpoint's frame."""
    c, s = math.cos(EYE.heading_rad), math.sin(EYE.heading_rad)
    field_x, field_y = EYE.x_m + c * x - s * y, EYE.y_m + s * x + c * y
    return np.maximum(LIGHT.level + LIGHT.per_m_x * field_x + LIGHT.per_m_y * field_y, LIGHT.min_level)


def rays_of(rows, pixels, first=None, directions=None):
    """Return rays of one bearing, unless said otherwise."""
    first = np.array([0, len(pixels)], dtype=np.int32) if first is None else first
    directions = np.array([[0.0, 1.0, 0.0]]) if directions is None else directions
    return PixelRays(rows, pixels.astype(np.uint32), first, directions, np.zeros(2))


def test_marked_rays_are_painted_and_forgotten():
    rng = np.random.default_rng(3)
    count = 200
    rays = rng.uniform(-2, 2, (9, count)).astype(np.float32)
    rays[kernels.GAIN] = rng.uniform(0, 1.2, count)
    pixels = rng.permutation(count).astype(np.uint32)
    marked = rng.permutation(count)[:60].astype(np.int32)
    fraction = np.zeros(count, dtype=np.float32)
    fraction[marked] = rng.uniform(0.01, 1, 60)
    plain = np.array([[50, 130, 45], [235, 240, 245], [0, 0, 0]], dtype=np.float32)
    out = np.zeros((count, 3), dtype=np.uint8)
    lit = light_at(rays[0], rays[1]) * rays[kernels.GAIN]
    color = plain[0] + fraction[:, None] * (plain[1] - plain[0])
    expected = np.zeros((count, 3))
    expected[pixels[marked]] = np.minimum(np.floor(lit[:, None] * color + 0.5), 255)[marked]
    kernels.paint_marked(rays_of(rays, pixels), LIGHT, EYE, plain, PaintMarks(fraction, marked), len(marked), out)
    assert np.abs(out - expected).max() <= 1
    assert (out == expected).mean() > 0.99
    assert not fraction.any()


def drawn(pixels, spans, ball, plain, out):
    """Draw pixel by pixel in plain Python: the mean of the two spans that a pixel's slopes reach into."""
    picture = out.astype(np.float64)
    c, s = math.cos(EYE.heading_rad), math.sin(EYE.heading_rad)
    dx, dy = ball.x_m - EYE.x_m, ball.y_m - EYE.y_m
    ball_x, ball_y = c * dx + s * dy, c * dy - s * dx
    for k, (_, cos, sin) in enumerate(pixels.directions):
        aim = c * cos - s * sin, s * cos + c * sin
        for i in range(pixels.first[k], pixels.first[k + 1]):
            x, y, low, high, gain = pixels.rays[:5, i].tolist()
            old = picture[pixels.pixels[i]]
            away2 = (x - ball_x) ** 2 + (y - ball_y) ** 2
            if spans.near_ball[k] and low < 0 and away2 < ball.shade_reach_m**2:
                old = np.floor(old * (1 - 0.55 * math.exp(-away2 / ball.radius_m**2)) + 0.5)
            n = int(np.searchsorted(spans.ends[k], low, side="right"))
            end = spans.ends[k, n]
            part = 1.0 if high <= end else (end - low) / (high - low)
            mean = np.zeros(3)
            for span, weight in ((n, part), (n + 1, 1 - part)):
                if not weight:
                    continue
                kind = spans.kinds[k, span]
                shade = kernels.ball_shade.py_func(*aim, (low + high) / 2, EYE, ball, LIGHT.lamp_rad)
                at_ball = LIGHT.level + LIGHT.per_m_x * ball.x_m + LIGHT.per_m_y * ball.y_m
                colors = {FLOOR: old, PAINT: gain * spans.paint[k, span], BALL: gain * shade * at_ball * plain[2]}
                mean += weight * colors[int(kind)]
            picture[pixels.pixels[i]] = np.minimum(np.floor(mean + 0.5), 255)
    return picture


def test_pixels_are_the_mean_of_their_spans():
    rng = np.random.default_rng(5)
    angles = np.array([-0.1, 0.0, 0.1])
    directions = np.stack([angles, np.cos(angles), np.sin(angles)], axis=1)
    steps, height_m = np.linspace(-2.0, 0.3, 121), EYE.height_m
    count = len(steps) - 1
    rows = np.zeros((9, 3 * count), dtype=np.float32)
    for k in range(3):
        here = slice(k * count, (k + 1) * count)
        away = height_m / np.maximum(-(steps[:-1] + steps[1:]) / 2, 0.02)
        rows[:4, here] = away * directions[k, 1], away * directions[k, 2], steps[:-1], steps[1:]
        rows[kernels.GAIN, here] = rng.uniform(0.6, 1.1, count)
    first = (np.arange(4) * count).astype(np.int32)
    pixels = rays_of(rows, rng.permutation(3 * count), first, directions)
    c, s = math.cos(EYE.heading_rad), math.sin(EYE.heading_rad)
    ball = BallSphere(EYE.x_m + 0.5 * c, EYE.y_m + 0.5 * s, 0.03, 0.09)
    inf = math.inf
    # floor, ball, floor, a thing and its top, the room; beside it no ball
    ends = [[-0.42, -0.33, -0.25, -0.1, 0.05, inf], [-0.25, -0.1, 0.051, inf, inf, inf]]
    kinds = [[FLOOR, BALL, FLOOR, PAINT, PAINT, PAINT], [FLOOR, PAINT, PAINT, PAINT, PAINT, PAINT]]
    spans = Spans(
        np.array([ends[1], ends[0], ends[1]], dtype=np.float32),
        np.array([kinds[1], kinds[0], kinds[1]], dtype=np.int32),
        rng.uniform(0, 300, (3, 6, 3)).astype(np.float32),
        np.array([1, 1, 0], dtype=np.int32),
    )
    plain = np.array([[50, 130, 45], [235, 240, 245], [30, 110, 230]], dtype=np.float32)
    out = rng.integers(0, 256, (3 * count, 3)).astype(np.uint8)
    before, expected = out.copy(), drawn(pixels, spans, ball, plain, out)
    kernels.draw_pixels(pixels, EYE, spans, ball, plain, LIGHT, out)
    assert np.abs(out - expected).max() <= 1
    assert (out == expected).mean() > 0.98
    # the bearing that is not near the ball keeps its floor
    far_floor = pixels.pixels[2 * count : 2 * count + 80]
    np.testing.assert_array_equal(out[far_floor], before[far_floor])


def test_carpet_is_filled_as_numpy_fills_it():
    rng = np.random.default_rng(0)
    floor = rng.uniform(-2, 2, (3, 500)).astype(np.float32)
    floor[2] = rng.uniform(0, 1.2, 500)
    color = np.array([50, 130, 245], dtype=np.float32)
    body = np.where(rng.random((3, 500)) < 0.1, 30, 0).astype(np.uint8)
    floor[2, body.any(axis=0)] = 0
    out = np.zeros((3, 500), dtype=np.uint8)
    kernels.fill_carpet(floor, LIGHT, EYE, color, body, out)
    lit = light_at(floor[0], floor[1]) * floor[2]
    expected = np.minimum(np.floor(lit * color[:, None] + 0.5), 255) + body
    assert np.abs(out - expected).max() <= 1
    assert (out == expected).mean() > 0.99


def test_noise_is_added_and_clipped():
    rng = np.random.default_rng(1)
    frame = rng.integers(0, 256, 1000).astype(np.uint8)
    noise = rng.integers(-128, 128, 1000).astype(np.int8)
    expected = np.clip(frame.astype(int) + noise, 0, 255)
    kernels.add_noise(frame, noise)
    assert (frame == expected).all()


def test_a_ball_is_lightest_where_the_lamp_stands():
    eye, ball = Viewpoint(0.0, 0.0, 0.0, 0.2), BallSphere(0.5, 0.0, 0.02, 0.06)
    drop = 0.2 - 0.02
    straight = kernels.ball_shade(1.0, 0.0, -drop / 0.5, eye, ball, math.pi)
    # the ray through the middle meets the near upper side; its normal points back along the ray
    along = np.array([-0.5, 0.0, drop]) / math.hypot(0.5, drop)
    lamp = np.array([-0.5, 0.0, math.sqrt(0.75)])
    assert straight == pytest.approx(0.62 + 0.42 * along @ lamp, abs=1e-9)
    assert kernels.ball_shade(1.0, 0.0, -drop / 0.5, eye, ball, 0.0) < straight
