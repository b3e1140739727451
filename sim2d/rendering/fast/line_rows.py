"""A field's lines, arcs and marks as the compiled loops take them."""

from __future__ import annotations

import math

import numpy as np

from field_models import Field
from robocup_vision.arrays import FloatArray


def line_rows(field: Field) -> FloatArray:
    """Lines (N, 5): start x, y, unit direction x, y, length."""
    return np.array([_line(*row) for row in field.painted_lines.tolist()], dtype=np.float64).reshape(-1, 5)


def arc_rows(field: Field) -> FloatArray:
    """Arcs (M, 6): centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle)."""
    return np.array([_arc(*row) for row in field.painted_arcs.tolist()], dtype=np.float64).reshape(-1, 6)


def _line(x0: float, y0: float, x1: float, y1: float) -> list[float]:
    length = math.hypot(x1 - x0, y1 - y0)
    return [x0, y0, (x1 - x0) / length, (y1 - y0) / length, length]


def _arc(x: float, y: float, radius: float, start: float, sweep: float) -> list[float]:
    middle = start + sweep / 2
    cosine = -2.0 if abs(sweep) > math.tau - 1e-9 else math.cos(sweep / 2)
    return [x, y, radius, math.cos(middle), math.sin(middle), cosine]
