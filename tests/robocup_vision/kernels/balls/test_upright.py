"""Upright things about a blob."""

import numpy as np

from robocup_vision.kernels.balls.blobs import FloorTable
from robocup_vision.kernels.balls.upright import count_upright

WIDTH, HEIGHT = 80, 60


def test_a_band_above_and_below_counts_and_carpet_around_does_not():
    carpet, packing = (50, 130, 45), np.zeros((3, 256), dtype=np.uint16)
    packing[1] = np.arange(256)
    table = FloorTable(packing, np.where(np.arange(256) == carpet[1], 1, -1).astype(np.int8))
    frame = np.full((HEIGHT, WIDTH, 3), carpet, dtype=np.uint8)
    blob = (40.0, 30.0), (6.0, 6.0), (0.0, -1.0)
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 0
    frame[:30, 34:47] = 200, 60, 40
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 1
    frame[30:, 34:47] = 60, 200, 220
    assert count_upright(frame, *blob, table, 15.0, 2.0) == 2
