"""Discs that pass for patterned balls, in pictures of kinds and levels."""

import math

import numpy as np
import pytest

from robocup_vision.kernels.balls import patterned as kernel
from robocup_vision.kernels.balls.patterned import CARPET, NEUTRAL

HEIGHT, WIDTH = 48, 64
ANY = np.tile((0.0, np.inf), (HEIGHT, 1))


def ball(kinds, level, u0, v0, radius):
    """Lay a ball with one dark patch over a picture."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    inside = np.hypot(u - u0, v - v0) < radius
    kinds[inside], level[inside] = NEUTRAL, 200
    level[inside & (np.hypot(u - u0 + 2, v - v0 + 2) < 0.45 * radius)] = 20


def test_a_ball_whose_underside_is_as_green_as_the_carpet_keeps_its_place_and_size():
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    ball(kinds, level, 30, 22, 9)
    kinds[22 + 6 :] = CARPET
    found, out = np.empty((5000, kernel.COLUMNS)), np.empty((10, kernel.COLUMNS))
    count = kernel.find_discs(kinds, np.array([6.0, 7.2, 8.6, 10.4]), ANY, found)
    assert kernel.best_discs(kinds, level, found[:count], out) >= 1
    row = out[0]
    assert math.hypot(row[kernel.U] - 30, row[kernel.V] - 22) < 2
    assert row[kernel.RADIUS] == pytest.approx(9, rel=0.15)
    assert row[kernel.AGREE] == 1.0
    assert 0.6 < row[kernel.SHOWN] < 1.0


def test_a_disc_of_another_size_is_kept_beside_a_better_one_at_its_place():
    """A ball and the line it touches look like a larger ball."""
    kinds, level = np.zeros((HEIGHT, WIDTH), np.uint8), np.full((HEIGHT, WIDTH), 110, np.uint8)
    kinds[11:15], level[11:15] = NEUTRAL, 220
    ball(kinds, level, 30, 22, 7)
    found, out = np.zeros((3, kernel.COLUMNS)), np.empty((10, kernel.COLUMNS))
    found[:, kernel.U], found[:, kernel.V], found[:, kernel.RADIUS] = 30, (19, 22, 22), (10.5, 7.0, 7.8)
    found[:, kernel.AGREE], found[:, kernel.INSIDE] = (0.95, 0.9, 0.85), 1.0
    kept = out[: kernel.best_discs(kinds, level, found, out)]
    assert len(kept) == 2
    assert math.hypot(kept[1, kernel.U] - 30, kept[1, kernel.V] - 22) < 2
    assert kept[1, kernel.RADIUS] == pytest.approx(7, rel=0.15)
