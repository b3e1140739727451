"""Pixels mapped by a homography, against OpenCV's own."""

import cv2
import numpy as np
import pytest

from robocup_vision.kernels.floor.turned_view import map_pixels


@pytest.mark.parametrize("seed", range(3))
def test_pixels_are_mapped_into_the_frame(seed):
    rng = np.random.default_rng(seed)
    pixels = rng.uniform(-10.0, 220.0, (20, 30, 2)).astype(np.float32)
    homography = np.eye(3) + rng.normal(0.0, 1.0, (3, 3)) * [[0.02, 0.02, 5.0], [0.02, 0.02, 5.0], [1e-5, 1e-5, 0.0]]
    out = np.empty((2, 20, 30), np.float32)
    map_pixels(np.ascontiguousarray(np.moveaxis(pixels, -1, 0)), homography, 208, 160, out)
    expected = np.clip(cv2.perspectiveTransform(pixels.astype(float), homography), 0, (207, 159))
    np.testing.assert_allclose(np.moveaxis(out, 0, -1), expected, atol=1e-3)


def test_no_pixel_stays_none_and_what_lies_behind_is_none():
    out = np.ones((2, 1, 2), np.float32)
    map_pixels(np.full((2, 1, 2), np.nan, np.float32), np.eye(3), 208, 160, out)
    np.testing.assert_array_equal(out, 0)
    out[:] = 1
    map_pixels(np.full((2, 1, 2), 30, np.float32), np.diag([1.0, 1.0, -1.0]), 208, 160, out)
    np.testing.assert_array_equal(out, 0)
