"""Three kinds of curves from image radius R (px) to floor range r (m) of a mirror camera.

They are expressed by the inverse range q = 1/r, which is finite and smooth across the horizon (q = 0) and negative
above it. Straight walls are straight in q.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only


class FloorRange(Protocol):
    """A curve from image radius to floor range."""

    def inverse_range_per_m(self, radius_px: npt.ArrayLike) -> FloatArray:
        """Return 1/r for image radii >= 0 (any shape, px), 1/m; q <= 0 on and above the horizon, NaN where undefined.

        At R = 0, straight down, it is infinite; NaN outside a table.
        """
        ...

    def radius_px(self, inverse_range_per_m: npt.ArrayLike) -> FloatArray:
        """Return the image radius (px) of inverse ranges (any shape, 1/m); NaN where undefined."""
        ...

    @property
    def implied_height_m(self) -> float | None:
        """Height of the effective viewpoint above the floor if the curve's parameters determine it."""
        ...


@dataclass(frozen=True, slots=True)
class Hyperboloid:
    """r = R / (A - B sqrt(C + R^2)): a hyperboloidal mirror (Sekimori et al. 2001, eq. 26).

    A - B sqrt(C) nearly cancels, so the constants need their full precision. In an image s times larger they are A s,
    B, C s^2.
    """

    #: the three constants, all positive
    A_px_per_m: float
    B_per_m: float
    C_px2: float

    def inverse_range_per_m(self, radius_px: npt.ArrayLike) -> FloatArray:
        """1/r, see `FloorRange`."""
        radius = np.asarray(radius_px, dtype=np.float64)
        with np.errstate(divide="ignore"):
            return (self.A_px_per_m - self.B_per_m * np.sqrt(self.C_px2 + radius**2)) / radius

    def radius_px(self, inverse_range_per_m: npt.ArrayLike) -> FloatArray:
        """R, see `FloorRange`: the root of (A - qR)^2 = B^2 (C + R^2) with A - qR > 0."""
        q = np.asarray(inverse_range_per_m, dtype=np.float64)
        a, b2 = self.A_px_per_m, self.B_per_m**2
        # (q^2 - B^2) R^2 - 2 A q R + (A^2 - B^2 C) = 0, in a form that is also valid for q = B, a linear equation
        constant = a * a - b2 * self.C_px2
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt((a * q) ** 2 - (q * q - b2) * constant)
            radius = constant / (a * q + root)
        return np.where(q == np.inf, 0.0, np.where(radius > 0, radius, np.nan))

    @property
    def implied_height_m(self) -> float | None:
        """The mirror's outer focus above the floor: sqrt(C / (A^2 - B^2 C))."""
        # a product, unlike a power, overflows to infinity
        denominator = self.A_px_per_m * self.A_px_per_m - self.B_per_m * self.B_per_m * self.C_px2
        return math.sqrt(self.C_px2 / denominator) if denominator > 0 else None


@dataclass(frozen=True, slots=True)
class Tangent:
    """r = a tan(b R): a mirror with constant angular gain."""

    #: both positive
    a_m: float
    b_per_px: float

    def inverse_range_per_m(self, radius_px: npt.ArrayLike) -> FloatArray:
        """1/r, see `FloorRange`."""
        angle = self.b_per_px * np.asarray(radius_px, dtype=np.float64)
        with np.errstate(divide="ignore"):
            q = 1.0 / (self.a_m * np.tan(angle))
        return np.where((angle >= 0) & (angle < math.pi), q, np.nan)

    def radius_px(self, inverse_range_per_m: npt.ArrayLike) -> FloatArray:
        """R, see `FloorRange`."""
        q = np.asarray(inverse_range_per_m, dtype=np.float64)
        return np.arctan2(1.0, self.a_m * q) / self.b_per_px

    @property
    def implied_height_m(self) -> float | None:
        """None: a and b do not determine the viewpoint."""
        return None


@dataclass(frozen=True, eq=False)
class Table:
    """Measured pairs of image radius and floor range, interpolated linearly in 1/r.

    Parameters
    ----------
    radius_px, range_m : (N,) float64
        Both strictly increasing and positive, N >= 2.
    """

    table_radius_px: FloatArray
    table_range_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "table_radius_px", read_only(self.table_radius_px))
        object.__setattr__(self, "table_range_m", read_only(self.table_range_m))

    def inverse_range_per_m(self, radius_px: npt.ArrayLike) -> FloatArray:
        """1/r, see `FloorRange`; NaN outside the table."""
        radius = np.asarray(radius_px, dtype=np.float64)
        return _interpolate(radius, self.table_radius_px, 1.0 / self.table_range_m)

    def radius_px(self, inverse_range_per_m: npt.ArrayLike) -> FloatArray:
        """R, see `FloorRange`; NaN outside the table."""
        q = np.asarray(inverse_range_per_m, dtype=np.float64)
        return _interpolate(q, 1.0 / self.table_range_m[::-1], self.table_radius_px[::-1])

    @property
    def implied_height_m(self) -> float | None:
        """None: a table does not determine the viewpoint."""
        return None


def magnified(curve: FloorRange, factor: float) -> FloorRange:
    """Return the curve of the same family with its image radii multiplied by a factor.

    Raises
    ------
    ArgumentError
        If the curve belongs to none of the three families.
    """
    if isinstance(curve, Hyperboloid):
        return Hyperboloid(curve.A_px_per_m * factor, curve.B_per_m, curve.C_px2 * factor**2)
    if isinstance(curve, Tangent):
        return Tangent(curve.a_m, curve.b_per_px / factor)
    if isinstance(curve, Table):
        return Table(curve.table_radius_px * factor, curve.table_range_m)
    raise ArgumentError(f"a {type(curve).__name__} cannot be magnified: only Hyperboloid, Tangent and Table can")


def _interpolate(x: FloatArray, known_x: FloatArray, known_y: FloatArray) -> FloatArray:
    # tolerance for rounding errors of pixels and floor points at the ends
    slack = 1e-9 * known_x[-1]
    inside = (x >= known_x[0] - slack) & (x <= known_x[-1] + slack)
    return np.where(inside, np.interp(x, known_x, known_y), np.nan)
