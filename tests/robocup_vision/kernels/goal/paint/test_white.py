"""White paint's loops against OpenCV and NumPy."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.paint.white import (
    GRADIENT_SIZES,
    WhiteRuns,
    band_gradients,
    find_white_runs,
    greenness,
    least_channel,
    median_size,
)

seeds = st.integers(0, 2**32 - 1)


def picture(seed, shape):
    """Draw noise of some contrast, with bright stripes across it."""
    rng = np.random.default_rng(seed)
    bright, spread = rng.integers(0, 256), rng.choice([0, 3, 20, 255])
    image = rng.integers(max(0, bright - spread), min(256, bright + spread + 1), shape)
    for _ in range(rng.integers(0, 6)):
        left = rng.integers(0, shape[1])
        image[:, left : left + rng.integers(1, 9)] += rng.integers(-120, 120)
    return np.clip(image, 0, 255).astype(np.uint8)


def vertex(gradient, row, column):
    low, mid, high = (np.abs(gradient[row, column + d]).astype(np.float64) for d in (-1, 0, 1))
    return np.clip((high - low) / (2 * np.maximum(2 * mid - low - high, 1e-6)), -0.5, 0.5)


def gradient_by_opencv(least, row_step):
    bands = len(least) // row_step
    profile = cv2.resize(least[: bands * row_step], (least.shape[1], bands), interpolation=cv2.INTER_AREA)
    kernel = np.array([-1, -2, 0, 2, 1], np.float32) / 8
    return cv2.sepFilter2D(profile.astype(np.float32), cv2.CV_32F, kernel, np.ones(1, np.float32))


def runs_by_numpy(gradient, row_step, noise, width_px):
    """Do what find_white_runs does: each rise, and the first fall after it, the second and the third."""
    inner, before, after = gradient[:, 1:-1], gradient[:, :-2], gradient[:, 2:]
    rows, starts = np.nonzero((inner > 4 * noise) & (inner >= before) & (inner > after))
    fall_rows, ends = np.nonzero((inner < -4 * noise) & (inner <= before) & (inner < after))
    if not len(ends):
        return np.empty((4, 0))
    stride = 3 * gradient.shape[1]  # a run never reaches the next row
    flat_ends = fall_rows * stride + ends
    flat_starts = rows * stride + starts
    found = []
    for skip in (0, 1, 2):
        pick = np.searchsorted(flat_ends, flat_starts) + skip
        width = np.where(pick < len(ends), flat_ends[np.minimum(pick, len(ends) - 1)] - flat_starts, -1)
        good = (width >= width_px[0]) & (width <= width_px[1])
        r, s, e = rows[good], starts[good] + 1, ends[pick[good]] + 1
        contrast = np.minimum(gradient[r, s], -gradient[r, e]) / noise
        left, right = s + vertex(gradient, r, s), e + vertex(gradient, r, e)
        found.append(np.stack([(r + 0.5) * row_step - 0.5, left, right, contrast]))
    runs = np.hstack(found)
    return runs[:, np.argsort(runs[0], kind="stable")]


@settings(deadline=None, max_examples=40)
@given(seeds, st.tuples(st.integers(1, 20), st.integers(1, 40)))
def test_channels_are_weighed_as_opencv_does(seed, shape):
    image = np.random.default_rng(seed).integers(0, 256, (*shape, 3), dtype=np.uint8)
    least, green = np.empty(shape, np.uint8), np.empty(shape, np.uint8)
    least_channel(image, least)
    np.testing.assert_array_equal(least, image.min(axis=2))
    greenness(image, green)
    blue, own, red = cv2.split(image)
    mean = cv2.addWeighted(red, 0.5, blue, 0.5, 0.0)
    np.testing.assert_array_equal(green, cv2.addWeighted(own, 1.0, mean, -1.0, 0.0))


@settings(deadline=None, max_examples=60)
@given(seeds, st.tuples(st.integers(6, 40), st.integers(3, 70)), st.integers(1, 6))
def test_gradients_are_those_of_opencv(seed, shape, row_step):
    least = picture(seed, shape)
    expected = gradient_by_opencv(least, row_step)
    gradient, sizes = np.empty(expected.shape, np.int16), np.empty(GRADIENT_SIZES, np.int64)
    band_gradients(least, row_step, gradient, sizes)
    np.testing.assert_array_equal(gradient / 8, expected)
    np.testing.assert_array_equal(sizes, np.bincount(np.abs(gradient).ravel(), minlength=GRADIENT_SIZES))
    assert median_size(sizes) / 8 == np.median(np.abs(expected))


def test_no_gradients_have_no_median():
    assert np.isnan(median_size(np.zeros(GRADIENT_SIZES, np.int64)))


@settings(deadline=None, max_examples=100)
@given(seeds, st.tuples(st.integers(4, 30), st.integers(3, 90)), st.sampled_from([1, 3, 4]))
def test_runs_are_those_of_numpy(seed, shape, row_step):
    least = picture(seed, shape)
    expected = gradient_by_opencv(least, row_step)
    noise = 1.4826 * float(np.median(np.abs(expected))) + 0.25
    gradient, sizes = np.empty(expected.shape, np.int16), np.empty(GRADIENT_SIZES, np.int64)
    band_gradients(least, row_step, gradient, sizes)
    width_px = (2.5, float(shape[1] // 8 + 5))
    found = np.empty((4, 3 * gradient.size))
    count = find_white_runs(gradient, row_step, noise, width_px, WhiteRuns(*found))
    np.testing.assert_array_equal(found[:, :count], runs_by_numpy(expected, row_step, noise, width_px))
