"""Shine that paint encloses, against OpenCV's closing of a picture with room around it."""

import cv2
import numpy as np
import pytest

from robocup_vision.kernels.goal.paint.shine import fill_shine

MIN = 170


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("longest", [1, 4, 9])
def test_fills_what_a_closing_fills_where_it_is_bright(upright, longest):
    rng = np.random.default_rng(5)
    mask = np.where(rng.random((40, 50)) < 0.1, 255, 0).astype(np.uint8)
    image = rng.integers(120, 256, (40, 50, 3)).astype(np.uint8)
    framed = cv2.copyMakeBorder(mask, 10, 10, 10, 10, cv2.BORDER_CONSTANT, value=0)
    size = np.ones((longest + 1, 1) if upright else (1, longest + 1), np.uint8)
    spread = cv2.dilate(framed, size, anchor=(0, 0))
    closed = cv2.erode(spread, size, anchor=(size.shape[1] - 1, size.shape[0] - 1))[10:-10, 10:-10]
    expected = mask | np.where((image >= MIN).all(axis=-1), closed, 0).astype(np.uint8)
    changed = fill_shine(mask, image, MIN, longest, upright)
    assert changed
    assert np.array_equal(mask, expected)


def test_fills_nothing_between_paint_and_the_end_of_the_picture():
    mask = np.zeros((10, 12), np.uint8)
    mask[5, 6] = 255
    image = np.full((10, 12, 3), 255, np.uint8)
    assert not any(fill_shine(mask, image, MIN, 9, upright) for upright in (False, True))
    assert np.count_nonzero(mask) == 1
