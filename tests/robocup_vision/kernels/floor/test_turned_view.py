"""Pixels mapped by a homography, against OpenCV's own."""

import cv2
import numpy as np
import pytest

from robocup_vision.kernels.floor.turned_view import map_pixels


@pytest.mark.parametrize("seed", range(3))
def test_pixels_are_mapped_and_rounded_into_the_frame(seed):
    rng = np.random.default_rng(seed)
    pixels = rng.uniform(-10.0, 220.0, (20, 30, 2))
    homography = np.eye(3) + rng.normal(0.0, 1.0, (3, 3)) * [[0.02, 0.02, 5.0], [0.02, 0.02, 5.0], [1e-5, 1e-5, 0.0]]
    out = np.empty(pixels.shape, np.int16)
    map_pixels(pixels, homography, 208, 160, out)
    expected = cv2.perspectiveTransform(pixels, homography)
    inside = np.clip(np.floor(expected + 0.5), 0, (207, 159))
    np.testing.assert_array_equal(out, inside.astype(np.int16))


def test_no_pixel_stays_none():
    out = np.ones((1, 2, 2), np.int16)
    map_pixels(np.full((1, 2, 2), np.nan), np.eye(3), 208, 160, out)
    np.testing.assert_array_equal(out, 0)
