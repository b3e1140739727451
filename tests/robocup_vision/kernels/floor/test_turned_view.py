"""Samples of a camera that is turned, beyond the fold of its lens and behind the robot itself."""

import numpy as np

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
