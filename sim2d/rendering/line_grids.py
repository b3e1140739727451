"""Which of a field's lines may be met near a floor point: bit masks on grids of ever coarser cells."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models import Field
from robocup_vision.geometry import FloatArray

CELLS_AT_MOST = 12_000
LEVELS = 7


@dataclass(frozen=True, eq=False)
class LineGrids:
    """Lines, arcs and their grids as the compiled loops take them.

    Parameters
    ----------
    lines : (N, 5) float64
        Start x, y, unit direction x, y, length.
    arcs : (M, 6) float64
        Centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle).
    half_line_m : float
        Half a line's width.
    cells : (G,) uint64
        Bit i of a cell: a patch of floor around a point in it may meet line or arc i, i + 64, ...
    grids : (L, 6) float64
        Of each level: x, y of its corner, cells per metre, columns, rows, first cell.
    clear_m : (C,) float32
        For each cell of level 0, how far from any point in it there is no line.
    """

    lines: FloatArray
    arcs: FloatArray
    half_line_m: float
    cells: npt.NDArray[np.uint64]
    grids: FloatArray
    clear_m: npt.NDArray[np.float32]

    def level(self, reach_m: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
        """Levels (N,) whose cells know all lines within (N,) reach of a point in them, as far as there are any."""
        cell_m = 1 / self.grids[0, 2]
        level = np.ceil(np.log2(np.maximum(reach_m / cell_m, 1e-6)))
        return np.asarray(np.clip(level, 0, len(self.grids) - 1), dtype=np.int32)


def make_line_grids(field: Field) -> LineGrids:
    """Prepare a field's lines; a cell of level k is 2^k of the finest wide and knows what lies its width around it."""
    lines = np.array([_line(*row) for row in field.lines.tolist()]).reshape(-1, 5)
    arcs = np.array([_arc(*row) for row in field.arcs.tolist()]).reshape(-1, 6)
    half = field.line_width_m / 2
    low, high = field.floor_polygon.min(axis=0) - 0.3, field.floor_polygon.max(axis=0) + 0.3
    finest = max(field.line_width_m, math.sqrt(float(np.prod(high - low)) / CELLS_AT_MOST))
    cells, grids, first = [], [], 0
    for k in range(LEVELS):
        cell_m = finest * 2**k
        columns, rows = (max(1, math.ceil(extent / cell_m)) for extent in high - low)
        x = low[0] + (np.arange(columns) + 0.5) * cell_m
        y = low[1] + (np.arange(rows) + 0.5) * cell_m
        grid_x, grid_y = (g.ravel() for g in np.meshgrid(x, y))
        reach = cell_m * (1 + math.sqrt(0.5)) + half
        mask = np.zeros(len(grid_x), dtype=np.uint64)
        nearest = np.full(len(grid_x), np.inf)
        distances = [_from_line(line, grid_x, grid_y) for line in lines]
        for i, away in enumerate(distances + [_from_arc(arc, grid_x, grid_y) for arc in arcs]):
            mask |= (away <= reach).astype(np.uint64) << np.uint64(i % 64)
            nearest = np.minimum(nearest, away)
        if k == 0:
            clear_m = np.maximum(nearest - half - cell_m * math.sqrt(0.5), 0.0).astype(np.float32)
        cells.append(mask)
        grids.append([low[0], low[1], 1 / cell_m, columns, rows, first])
        first += len(mask)
    return LineGrids(lines, arcs, half, np.concatenate(cells), np.array(grids), clear_m)


def _line(x0: float, y0: float, x1: float, y1: float) -> list[float]:
    length = math.hypot(x1 - x0, y1 - y0)
    return [x0, y0, (x1 - x0) / length, (y1 - y0) / length, length]


def _arc(x: float, y: float, radius: float, start: float, sweep: float) -> list[float]:
    middle = start + sweep / 2
    cosine = -2.0 if abs(sweep) > math.tau - 1e-9 else math.cos(sweep / 2)
    return [x, y, radius, math.cos(middle), math.sin(middle), cosine]


def _from_line(line: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    dx, dy = x - line[0], y - line[1]
    along = np.clip(dx * line[2] + dy * line[3], 0, line[4])
    return np.asarray(np.hypot(dx - along * line[2], dy - along * line[3]))


def _from_arc(arc: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.abs(np.hypot(x - arc[0], y - arc[1]) - arc[2]))
