"""The compiled pixels against plain NumPy: paint, carpet, noise, the ball's light."""

import math

import numpy as np
import pytest

from sim2d.kernels import match_pixels as kernels


def test_marked_rays_are_painted_and_forgotten():
    rng = np.random.default_rng(3)
    count = 200
    rays = rng.uniform(-2, 2, (9, count)).astype(np.float32)
    rays[kernels.GAIN] = rng.uniform(0, 1.2, count)
    pixels = rng.permutation(count).astype(np.uint32)
    marked = rng.permutation(count)[:60].astype(np.int32)
    share = np.zeros(count, dtype=np.float32)
    share[marked] = rng.uniform(0.01, 1, 60)
    light, eye = np.array([1.1, 0.2, -0.1, 0.05]), np.array([0.4, -0.3, 0.8])
    plain = np.array([[50, 130, 45], [235, 240, 245], [0, 0, 0]], dtype=np.float32)
    out = np.zeros((count, 3), dtype=np.uint8)
    c, s = math.cos(eye[2]), math.sin(eye[2])
    x, y = eye[0] + c * rays[0] - s * rays[1], eye[1] + s * rays[0] + c * rays[1]
    lit = np.maximum(light[0] + light[1] * x + light[2] * y, light[3]) * rays[kernels.GAIN]
    color = plain[0] + share[:, None] * (plain[1] - plain[0])
    expected = np.zeros((count, 3))
    expected[pixels[marked]] = np.minimum(np.floor(lit[:, None] * color + 0.5), 255)[marked]
    kernels.paint_marked(rays, pixels, light, eye, plain, share, marked, len(marked), out)
    assert np.abs(out - expected).max() <= 1
    assert (out == expected).mean() > 0.99
    assert not share.any()


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
