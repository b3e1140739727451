"""From light to bytes: noise, blur, vignette, compression, and the blur of a frame whose camera turns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim2d.rendering.sensor import Sensor, motion_blur, motion_kernel


def flat(level: float) -> np.ndarray:
    return np.full((120, 160, 3), level, dtype=np.float32)


def test_gain_and_cast_scale_channels():
    frame = Sensor(cast_bgr=(0.8, 1.0, 1.25), gain=0.5).expose(flat(200), np.random.default_rng(0))
    assert frame.dtype == np.uint8
    np.testing.assert_array_equal(frame[5, 7], (80, 100, 125))


def test_noise_is_white_and_as_strong_as_said_whatever_the_gain():
    frame = Sensor(noise_sigma=8, gain=0.5).expose(flat(200), np.random.default_rng(1)).astype(float) - 100
    assert abs(frame.mean()) < 0.1
    assert frame.std() == pytest.approx(np.hypot(8, 12**-0.5), rel=0.02)
    for axis in (0, 1, 2):
        neighbours = (
            np.take(frame, range(frame.shape[axis] - 1), axis),
            np.take(frame, range(1, frame.shape[axis]), axis),
        )
        assert abs((neighbours[0] * neighbours[1]).mean()) < 64 * 0.02


def test_vignette_takes_light_from_the_corners():
    frame = Sensor(vignette=0.4).expose(flat(200), np.random.default_rng(0))
    np.testing.assert_array_equal(frame[[0, 0, -1, -1], [0, -1, 0, -1], 0], 120)
    assert frame[60, 80, 0] == 200
    middle = frame[60, :, 0].astype(int)
    assert np.all(np.diff(middle[80:]) <= 0)
    np.testing.assert_array_equal(middle, middle[::-1])


def test_blur_spreads_a_point_by_its_sigma():
    light = flat(0)
    light[60, 80] = 10_000
    frame = Sensor(blur_px=2.5).expose(light, np.random.default_rng(0)).astype(float)[..., 0]
    v, u = np.indices(frame.shape)
    assert np.sqrt((frame * (u - 80) ** 2).sum() / frame.sum()) == pytest.approx(2.5, rel=0.05)
    assert np.sqrt((frame * (v - 60) ** 2).sum() / frame.sum()) == pytest.approx(2.5, rel=0.05)


def test_only_what_is_burnt_out_bleeds():
    light = flat(100)
    light[:, 70:90] = 250
    plain, bleeding = Sensor(), Sensor(bloom=0.5)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(bleeding.expose(light, rng), plain.expose(light, rng))
    light[:, 70:90] = 600
    beside = bleeding.expose(light, rng).astype(int)[60, :70, 0]
    assert beside[-1] > 110
    assert np.all(np.diff(beside) >= 0)
    assert beside[0] == 100


def test_clipping_comes_last():
    frame = Sensor(gain=0.5).expose(flat(400), np.random.default_rng(0))
    assert np.all(frame == 200)
    assert np.all(Sensor().expose(flat(400), np.random.default_rng(0)) == 255)


def test_jpeg_halves_chroma_only():
    light = flat(100)
    light[:, ::2] = (40, 40, 220)
    light[:, 1::2] = (220, 40, 40)
    plain = Sensor().expose(light, np.random.default_rng(0)).astype(int)
    packed = Sensor(jpeg_quality=95).expose(light, np.random.default_rng(0)).astype(int)
    contrast = [np.abs(np.diff((f[..., 2] - f[..., 0]), axis=1)).mean() for f in (plain, packed)]
    assert contrast[1] < 0.2 * contrast[0]
    gray = flat(60)
    gray[:, ::2] = 180
    kept = Sensor(jpeg_quality=95).expose(gray, np.random.default_rng(0)).astype(int)
    assert np.abs(np.diff(kept[..., 1], axis=1)).mean() > 100


def test_input_is_left_alone_and_noise_comes_from_the_generator_alone():
    light = flat(90)
    sensor = Sensor(noise_sigma=5, vignette=0.3, blur_px=1)
    first, again = (sensor.expose(light, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert np.all(light == 90)
    assert np.any(first != sensor.expose(light, np.random.default_rng(8)))


@pytest.mark.parametrize(("du", "dv"), [(4.0, 0.0), (0.0, 5.5), (3.0, -4.0), (9.0, 2.0)])
def test_the_kernel_has_the_mean_and_the_variance_of_the_way(du, dv):
    kernel = motion_kernel(du, dv)
    assert kernel.sum() == pytest.approx(1.0)
    v, u = np.mgrid[: kernel.shape[0], : kernel.shape[1]]
    u, v = u - (kernel.shape[1] - 1) / 2, v - (kernel.shape[0] - 1) / 2
    assert abs((kernel * u).sum()) < 1e-6
    assert abs((kernel * v).sum()) < 1e-6
    length = math.hypot(du, dv)
    along = (u * du + v * dv) / length
    assert (kernel * along**2).sum() == pytest.approx(length**2 / 12, rel=0.1)
    # a way along an axis leaves the other one sharp
    assert kernel.shape[0] == 1 or dv
    assert kernel.shape[1] == 1 or du


def test_a_frame_is_blurred_along_its_way_alone():
    frame = np.zeros((20, 30, 3), dtype=np.uint8)
    frame[:, 15:] = 200
    assert motion_blur(frame, 0.6, 0.3) is frame
    assert (motion_blur(frame, 0.0, 6.0) == frame).all()
    blurred = motion_blur(frame, 6.0, 0.0)
    assert blurred[5, 15, 0] == pytest.approx(117, abs=4)
    assert (blurred[:, :11] == 0).all()
    assert (blurred[:, 19:] == 200).all()
