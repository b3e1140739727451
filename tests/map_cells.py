"""Middles of a map's cells, for tests that compare cells with places."""

import numpy as np


def cell_centers_m(grid):
    """(N, N, 2) float64: middles of the cells of a `FreeSpaceMap`, metres; the first index runs along x."""
    along = (np.arange(grid.cells) + 0.5) * grid.cell_m
    x, y = along + grid.corner_m[0], along + grid.corner_m[1]
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
