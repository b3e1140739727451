"""Where a field's defence areas are: its lines tell it."""

from __future__ import annotations

from dataclasses import dataclass

from field_models import Field


@dataclass(frozen=True, slots=True)
class DefenceArea:
    """The rectangle before each goal in which the keeper alone may touch the ball: its size, metres."""

    depth_m: float
    width_m: float
    line_x_m: float

    def holds(self, side: int, x_m: float, y_m: float, room_m: float = 0.0) -> bool:
        """Tell whether a place is in the area before the goal at +x (side 1) or -x, or nearer to it than a room."""
        return side * x_m > self.line_x_m - self.depth_m - room_m and abs(y_m) < self.width_m / 2 + room_m


def defence_area(field: Field) -> DefenceArea | None:
    """Return the size of a field's defence areas, the largest rectangle before each goal; None if it has none."""
    half = field.length_m / 2
    fronts = [row for row in field.lines.tolist() if row[0] == row[2] and 1e-9 < row[0] < half - 1e-9]
    if not fronts:
        return None
    x, y0, _, y1 = min(fronts, key=lambda row: row[0])
    return DefenceArea(half - x, abs(y1 - y0), half)
