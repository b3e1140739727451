"""Samples of a camera that is turned: their places against plain algebra, their colours against OpenCV's."""

import cv2
import numpy as np
import pytest

from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.floor.turned_view import sample_turned


def lens_of(focal, center, size, distortion=()):
    return lens_table(PinholeCamera(size, focal, center, 0.2, distortion)).astype(np.float32)


NO_LENS, NOTHING = lens_of((1.0, 1.0), (0.0, 0.0), (208, 160)), np.empty((0, 0), np.uint8)


def sampled(frame, pixels, homography, lens=NO_LENS, hidden=NOTHING, valid=None):
    out = np.empty((*pixels.shape[:2], 3), np.uint8)
    valid = np.empty(pixels.shape[:2], np.uint8) if valid is None else valid
    sample_turned(frame, np.ascontiguousarray(np.moveaxis(pixels, -1, 0)), homography, lens, hidden, valid, out)
    return out


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_pixels_are_fetched(seed):
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 256, (160, 208, 3), dtype=np.uint8)
    pixels = rng.uniform(-10.0, 220.0, (20, 30, 2)).astype(np.float32)
    homography = np.eye(3) + rng.normal(0.0, 1.0, (3, 3)) * [[0.02, 0.02, 5.0], [0.02, 0.02, 5.0], [1e-5, 1e-5, 0.0]]
    places = cv2.perspectiveTransform(pixels.astype(float), homography)
    expected = np.clip(places, 0, (207, 159)).astype(np.float32)
    # more rows than places: bearings that see nothing
    valid = np.ones((23, 30), np.uint8)
    same = sampled(frame, pixels, homography, valid=valid) == cv2.remap(frame, expected, None, cv2.INTER_NEAREST)
    # half-way between two pixels rounding decides
    assert (~same.all(axis=-1)).sum() <= 1
    np.testing.assert_array_equal(valid[:20], ((places >= 0) & (places <= (207, 159))).all(axis=-1))
    assert not valid[20:].any()


@pytest.mark.parametrize(
    "distortion", [(-0.3, 0.1, 0.002, -0.001, 0.01), (0.1, 0.02, 0.0, 0.001, 0.0, 0.2, 0.05, 0.01)]
)
def test_a_lens_shows_them_where_opencv_says(distortion):
    rng = np.random.default_rng(6)
    frame = rng.integers(0, 256, (160, 208, 3), dtype=np.uint8)
    focal, center = (190.0, 205.0), (103.5, 79.5)
    coefficients = (*distortion, *(0.0,) * (8 - len(distortion)))
    # such as the picture shows: a lens is followed no farther
    pixels = rng.uniform((10.0, 10.0), (198.0, 150.0), (20, 30, 2)).astype(np.float32)
    rays = np.dstack([(pixels.astype(float) - center) / focal, np.ones((20, 30))]).reshape(-1, 1, 3)
    matrix = np.array([[focal[0], 0.0, center[0]], [0.0, focal[1], center[1]], [0.0, 0.0, 1.0]])
    places, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.array(coefficients))
    expected = np.clip(places.reshape(20, 30, 2), 0, (207, 159)).astype(np.float32)
    lens = lens_of(focal, center, (208, 160), distortion)
    same = sampled(frame, pixels, np.eye(3), lens) == cv2.remap(frame, expected, None, cv2.INTER_NEAREST)
    # half-way between two pixels rounding decides
    is_clear = (np.abs(expected % 1.0 - 0.5) > 1e-3).all(axis=-1)
    assert is_clear.sum() > 590
    assert same[is_clear].all()


def test_beyond_its_fold_a_lens_shows_the_fold():
    frame = np.random.default_rng(7).integers(0, 256, (160, 208, 3), dtype=np.uint8)
    # radius r (1 - 0.3 r^2) grows up to a slope of 1.054
    lens = lens_of((300.0, 300.0), (100.0, 80.0), (460, 160), (-0.3, 0.0, 0.0, 0.0))
    at_fold, beyond = (np.full((1, 1, 2), (100.0 + 300.0 * slope, 80.0), np.float32) for slope in (1.06, 3.0))
    np.testing.assert_array_equal(sampled(frame, beyond, np.eye(3), lens), sampled(frame, at_fold, np.eye(3), lens))


def test_places_behind_the_robot_itself_take_the_colours_of_their_neighbours():
    frame = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    hidden = np.zeros((4, 6), np.uint8)
    hidden[0, [0, 1, 4]] = hidden[1] = 1
    rows = np.stack(np.meshgrid(np.arange(6.0), np.arange(4.0)), axis=-1).astype(np.float32)
    valid = np.empty((4, 6), np.uint8)
    found = sampled(frame, rows, np.eye(3), hidden=hidden, valid=valid)
    np.testing.assert_array_equal(valid, hidden == 0)
    np.testing.assert_array_equal(found[0], frame[0, [2, 2, 2, 3, 3, 5]])
    # where all is hidden there is nothing better
    np.testing.assert_array_equal(found[1:], frame[1:])
