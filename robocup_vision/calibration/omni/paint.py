"""Where lines are painted, from where the field has them: each line and arc has three numbers that a fit may move.

A laboratory's lines are painted by hand, centimetres beside the field's: a camera fitted to lines that are taken to lie
exactly there puts those centimetres into its centre and tilt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.calibration.omni.shape import LineForms

# sideways at the start and at the end of a line; radius and centre of an arc
_NUMBERS = 3


@dataclass(frozen=True, eq=False)
class OnPaint:
    """Which points lie on a line or arc near the field, and how its paint moves what they are compared with.

    Parameters
    ----------
    is_line : (N,) bool
        Of all points.
    which : (K,) int64
        Line or arc of each of those points.
    by_paint : (K, 3) float64
        By how much the line lies farther out at that point, for each of its paint's numbers.
    """

    is_line: npt.NDArray[np.bool_]
    which: Int64Array
    by_paint: FloatArray

    @staticmethod
    def of(is_line: npt.NDArray[np.bool_], lines: LineForms) -> OnPaint:
        """Return those of points (N,), some of which lie on these lines."""
        straight = np.isfinite(lines.part)
        by_paint = np.ones((len(lines.which), _NUMBERS))
        part = lines.part[straight]
        by_paint[straight] = np.column_stack([1 - part, part, np.zeros(len(part))])
        by_paint[~straight, 1:] = lines.form[~straight, :2]
        return OnPaint(is_line, lines.which, by_paint)

    def move(self, covector: FloatArray, paint_m: FloatArray) -> None:
        """Move the points' covectors (N, 3) in place to where paint (L, 3) lies, see `no_paint`."""
        covector[self.is_line, 2] -= np.einsum("ij,ij->i", self.by_paint, paint_m[self.which])

    def derivative(self, weight: FloatArray, paint_m: FloatArray) -> FloatArray:
        """Return the derivative (N, 3 L) of what covectors say of points with W (N,) by the numbers of paint (L, 3)."""
        by_paint = np.zeros((len(weight), paint_m.size))
        columns = _NUMBERS * self.which[:, None] + np.arange(_NUMBERS)
        by_paint[np.flatnonzero(self.is_line)[:, None], columns] = -self.by_paint * weight[self.is_line, None]
        return by_paint


def no_paint(count: int) -> FloatArray:
    """Return the paint (L, 3), metres, of so many lines and arcs that lie where the field has them."""
    return np.zeros((count, _NUMBERS))
