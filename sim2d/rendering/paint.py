"""Painted lines on the floor: which fraction of a ray's patch they cover."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from field_models import Field
from robocup_vision.arrays import Float32Array

CELLS_AT_MAX = 400_000


class LinePaint:
    """The lines, arcs and marks of one field, and a coarse grid of the cells without one.

    Parameters
    ----------
    field : Field
        Its lines are painted `line_width_m` wide around their centres, with square ends.
    """

    def __init__(self, field: Field) -> None:
        self._half = field.line_width_m / 2
        self._lines = field.painted_lines
        self._arcs = field.painted_arcs
        low, high = field.floor_polygon.min(axis=0) - 0.5, field.floor_polygon.max(axis=0) + 0.5
        self._cell_m = max(field.line_width_m, math.sqrt(float(np.prod(high - low)) / CELLS_AT_MAX))
        self._low = low
        self._size = np.ceil((high - low) / self._cell_m).astype(int)
        x, y = (low[i] + (np.arange(self._size[i]) + 0.5) * self._cell_m for i in (0, 1))
        reach = np.float32(self._cell_m * 2)  # a patch of up to two cells across still meets its line
        axes = np.ones((len(y) * len(x), 2), dtype=np.float32)
        grid_x, grid_y = (g.astype(np.float32).ravel() for g in np.meshgrid(x, y))
        near = self._coverage(grid_x, grid_y, axes[:, 0], axes[:, 1] * 0, 2 * reach, 2 * reach) > 0
        self._near = near.reshape(len(y), len(x))

    def coverage(
        self,
        x_m: Float32Array,
        y_m: Float32Array,
        cos: Float32Array,
        sin: Float32Array,
        radial_m: Float32Array,
        tangential_m: Float32Array,
    ) -> tuple[npt.NDArray[np.intp], Float32Array]:
        """Return the painted fraction of rectangular patches of floor.

        Parameters
        ----------
        x_m, y_m : (N,) float32
            Middles of the patches, field frame, metres.
        cos, sin : (N,) float32
            Direction of their radial sides in the field frame.
        radial_m, tangential_m : (N,) float32
            Their sizes, metres.

        Returns
        -------
        (M,) intp, (M,) float32
            Indices of patches that may be painted, and their painted fractions, 0 to 1.
        """
        column = ((x_m - self._low[0]) * np.float32(1 / self._cell_m)).astype(np.int32)
        row = ((y_m - self._low[1]) * np.float32(1 / self._cell_m)).astype(np.int32)
        np.clip(column, 0, self._size[0] - 1, out=column)
        np.clip(row, 0, self._size[1] - 1, out=row)
        near = self._near[row, column]
        near |= radial_m > self._cell_m
        where = np.flatnonzero(near)
        covered_ratio = self._coverage(
            x_m[where], y_m[where], cos[where], sin[where], radial_m[where], tangential_m[where]
        )
        return where, covered_ratio

    def _coverage(
        self,
        x: Float32Array,
        y: Float32Array,
        cos: Float32Array,
        sin: Float32Array,
        radial: Float32Array | np.float32,
        tangential: Float32Array | np.float32,
    ) -> Float32Array:
        covered_ratio = np.zeros(len(x), dtype=np.float32)
        half = np.float32(self._half)
        for x0, y0, x1, y1 in self._lines.astype(np.float32):
            length = np.float32(math.hypot(x1 - x0, y1 - y0))
            tx, ty = (x1 - x0) / length, (y1 - y0) / length
            radial_along = np.abs(cos * tx + sin * ty)
            radial_across = np.abs(cos * ty - sin * tx)
            across = (x - x0) * ty - (y - y0) * tx
            along = (x - x0) * tx + (y - y0) * ty - length / 2
            covered = _overlap(across, half, radial_across * radial + radial_along * tangential)
            covered *= _overlap(along, length / 2 + half, radial_along * radial + radial_across * tangential)
            np.maximum(covered_ratio, covered, out=covered_ratio)
        for x0, y0, radius, start, sweep in self._arcs:
            dx, dy = x - np.float32(x0), y - np.float32(y0)
            from_center = np.maximum(np.hypot(dx, dy), np.float32(1e-6))
            radial_across = np.abs(cos * dx + sin * dy) / from_center
            radial_along = np.abs(cos * dy - sin * dx) / from_center
            covered = _overlap(
                from_center - np.float32(radius), half, radial_across * radial + radial_along * tangential
            )
            if abs(sweep) < math.tau - 1e-9:
                middle = start + sweep / 2
                aim_x, aim_y = np.float32(math.cos(middle)), np.float32(math.sin(middle))
                covered[dx * aim_x + dy * aim_y < from_center * np.float32(math.cos(sweep / 2))] = 0
            np.maximum(covered_ratio, covered, out=covered_ratio)
        return covered_ratio


def _overlap(offset: Float32Array, half: np.float32, size: Float32Array) -> Float32Array:
    """Return the fraction of an interval of `size` around `offset` that lies within `half` of 0."""
    reach = np.maximum(size, np.float32(1e-6)) / 2
    covered = np.minimum(offset + reach, half) - np.maximum(offset - reach, -half)
    return np.asarray(np.maximum(covered, np.float32(0)) / (2 * reach), dtype=np.float32)
