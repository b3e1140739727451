"""A mirror camera as a vector of parameters for a fit: centre, tilt and curve.

All curves share the two parameters that images determine best: K, the slope of the radius over floor range near the
centre (px/m), and H, the radius of the horizon (px). A family's further parameters follow, so that a fit may start from
a curve of another family. A paraboloid is q = K/R (1 - (R/H)^2), of height H/(2K).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent, magnified
from robocup_vision.camera.omni import OmniCamera

# "own": the stretched table of a start, which keeps kinks that other families cannot represent
Curve = Literal["hyperboloid", "tangent", "table", "own"]
CURVES: tuple[Curve, ...] = ("hyperboloid", "tangent", "table")
# "magnified": the given curve of any family; centre and tilt are free, and its image radii are magnified
Family = Literal[Curve, "magnified"]

CENTER, TILT, SCALE, HORIZON = slice(0, 2), slice(2, 4), 4, 5
# number of nodes of a table's stretch, evenly spaced over the usable radii: errors of a mirror's polish are smooth
BENDS = 6
# greatest stretch of a table: larger ones need another base curve
_MAX_BEND = 0.08
# greatest tilt about either axis, beyond that of intact mounts
MAX_TILT_RAD = math.radians(6.0)
# bounds of a hyperboloid's sqrt(C), in horizon radii: at the upper one it is practically a paraboloid
_ROOT_OVER_HORIZON = (0.3, 30.0)
# prior standard deviations: of the centre, relative to the image's smaller side; of the tilt about either axis, as
# mounts are level to a degree or two; of the logarithms of scale and horizon, the difference between robots; of the
# logarithm of a hyperboloid's sqrt(C)/H; and of a table's stretches
_CENTER_STD_RATIO, _TILT_STD_RAD, _CURVE_STD, _SHAPE_STD, _BEND_STD = 0.05, math.radians(1.5), 0.3, 0.5, 0.02
# factor by which a start's table is extended in radius, because its centre may be wrong
_PROLONGED = 1.1
# number of rows of a written table: linear interpolation is then accurate to a hundredth of a pixel
_TABLE_ROWS = 64
# greatest range of a written table, in viewpoint heights: a pixel or two before the horizon
_FARTHEST_HEIGHTS = 40.0


@dataclass(frozen=True, slots=True, eq=False)
class BentCurve:
    """A curve with a small smooth stretch of the image radius; written as a table."""

    base: Hyperboloid | Table  #: the unstretched curve
    nodes_px: FloatArray  #: (B,) float64: image radii, increasing
    #: (B,) float64: relative stretch of the radius at the nodes; linear between them, constant beyond
    stretch: FloatArray

    def inverse_range_per_m(self, radius_px: npt.ArrayLike) -> FloatArray:
        """1/r, see `FloorRange`."""
        radius = np.asarray(radius_px, dtype=np.float64)
        return self.base.inverse_range_per_m(radius * (1.0 + np.interp(radius, self.nodes_px, self.stretch)))

    def radius_px(self, inverse_range_per_m: npt.ArrayLike) -> FloatArray:
        """R, see `FloorRange`."""
        wanted = self.base.radius_px(inverse_range_per_m)
        radius = wanted
        for _ in range(20):
            radius = wanted / (1.0 + np.interp(radius, self.nodes_px, self.stretch))
        return np.asarray(radius)

    @property
    def implied_height_m(self) -> float | None:
        """Height of the stretched hyperboloid; a table has none."""
        return self.base.implied_height_m


def hyperboloid_of(scale_px_per_m: float, horizon_px: float, root_px: float) -> Hyperboloid:
    """Hyperboloid of K, H and sqrt(C): q = (K - B (sqrt(C + R^2) - sqrt(C))) / R with q(H) = 0."""
    sagitta = horizon_px**2 / (math.hypot(root_px, horizon_px) + root_px)
    b = scale_px_per_m / sagitta
    return Hyperboloid(scale_px_per_m + b * root_px, b, root_px**2)


def tangent_of(scale_px_per_m: float, horizon_px: float) -> Tangent:
    """Tangent of K and H: q = 1 / (a tan(b R)) with q = K/R near the centre and q(H) = 0."""
    b = math.pi / (2 * horizon_px)
    return Tangent(1.0 / (scale_px_per_m * b), b)


def scale_and_horizon(curve: FloorRange, usable_radius_px: tuple[float, float]) -> tuple[float, float]:
    """Return K (px/m) and H (px) of a curve: its own, or those of the best-fitting paraboloid."""
    if isinstance(curve, Hyperboloid):
        root = math.sqrt(curve.C_px2)
        scale = curve.A_px_per_m - curve.B_per_m * root
        rise = scale / curve.B_per_m + root
        return scale, math.sqrt(rise**2 - curve.C_px2)
    if isinstance(curve, Tangent):
        return 1.0 / (curve.a_m * curve.b_per_px), math.pi / (2 * curve.b_per_px)
    radius = np.linspace(*usable_radius_px, 100)
    q = curve.inverse_range_per_m(radius)
    known = np.isfinite(q)
    radius, q = radius[known], q[known]
    (scale, fall), *_ = np.linalg.lstsq(np.stack([1 / radius, -radius], axis=1), q, rcond=None)
    if not (scale > 0 and fall > 0):
        return float(np.median(q * radius)), 4.0 * usable_radius_px[1]
    return float(scale), math.sqrt(scale / fall)


def _prolonged(table: Table) -> Table:
    """Return a table extended at both ends by one row, linear in 1/r."""
    radius, q = table.table_radius_px, 1.0 / table.table_range_m
    first, last = radius[0] / _PROLONGED, radius[-1] * _PROLONGED
    inner = q[0] + (q[0] - q[1]) / (radius[1] - radius[0]) * (radius[0] - first)
    outer = q[-1] - (q[-2] - q[-1]) / (radius[-1] - radius[-2]) * (last - radius[-1])
    if outer <= 0.1 * q[-1]:
        # short of the horizon
        last = radius[-1] + (last - radius[-1]) * 0.9 * q[-1] / (q[-1] - outer)
        outer = 0.1 * q[-1]
    return Table(np.array([first, *radius, last]), 1.0 / np.array([inner, *q, outer]))


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A family of cameras with its parameter vector.

    The vector: centre u, v (px); tilt about x, y (rad); log K, log H; for a hyperboloid and a table log of sqrt(C)/H;
    the stretches of a table, or of the table of `frame` in the family "own". The family "magnified" has the first
    four, and the logarithm of the curve's magnification.
    """

    #: provides all that is not in the vector: size, usable radii, heading, offset, mirroring
    frame: OmniCamera
    curve: Family  #: the family

    @property
    def size(self) -> int:
        """Length of the vector."""
        return {"hyperboloid": 7, "tangent": 6, "table": 7 + BENDS, "own": 6 + BENDS, "magnified": 5}[self.curve]

    @property
    def _nodes_px(self) -> FloatArray:
        return np.linspace(*self.frame.usable_radius_px, BENDS)

    @cached_property
    def _own(self) -> tuple[Table, float, float]:
        """The start's extended table, and its K and H."""
        table = self.frame.floor_range
        if not isinstance(table, Table):
            raise ArgumentError(f"only a table can be stretched as it is, got a {type(table).__name__}")
        return _prolonged(table), *scale_and_horizon(table, self.frame.usable_radius_px)

    def vector(self, camera: OmniCamera) -> FloatArray:
        """Return the vector (G,) of the member of this family that is closest to a camera."""
        if self.curve == "magnified":
            # compared at the floor range shown at the middle radius
            middle_px = 0.5 * sum(self.frame.usable_radius_px)
            same_floor = self.frame.floor_range.inverse_range_per_m(middle_px)
            factor = float(camera.floor_range.radius_px(same_floor)) / middle_px
            return np.array([*camera.center_px, *camera.tilt_rad, math.log(factor)])
        scale, horizon = scale_and_horizon(camera.floor_range, self.frame.usable_radius_px)
        head = [*camera.center_px, *camera.tilt_rad, math.log(scale), math.log(horizon)]
        root = 4.0
        if isinstance(camera.floor_range, Hyperboloid):
            low, high = _ROOT_OVER_HORIZON
            root = min(max(math.sqrt(camera.floor_range.C_px2) / horizon, low), high)
        vector = np.zeros(self.size)
        vector[:6] = head
        if self.curve != "own":
            vector[6:7] = math.log(root)
        return vector

    def camera(self, vector: FloatArray) -> OmniCamera:
        """Return the camera of a vector; a table is a `BentCurve` (see `written`)."""
        height = self.frame.viewpoint_height_m
        curve = self.frame.floor_range
        if self.curve == "magnified":
            scale, horizon = scale_and_horizon(curve, self.frame.usable_radius_px)
            curve, scale = magnified(curve, math.exp(vector[SCALE])), scale * math.exp(vector[SCALE])
            horizon *= math.exp(vector[SCALE])
        else:
            scale, horizon = math.exp(vector[SCALE]), math.exp(vector[HORIZON])
        if self.curve == "tangent":
            curve = tangent_of(scale, horizon)
        elif self.curve == "own":
            table, own_scale, own_horizon = self._own
            larger = horizon / own_horizon
            farther = own_scale * larger / scale
            base = Table(table.table_radius_px * larger, table.table_range_m * farther)
            curve = BentCurve(base, self._nodes_px, vector[6:])
        elif self.curve != "magnified":
            mirror = hyperboloid_of(scale, horizon, horizon * math.exp(vector[6]))
            curve = mirror if self.curve == "hyperboloid" else BentCurve(mirror, self._nodes_px, vector[7:])
        if self.curve != "hyperboloid":
            # images of the floor do not determine it: the start's, or that of the paraboloid with this K and H
            height = self.frame.height_m if self.frame.height_m is not None else horizon / (2 * scale)
        return dataclasses.replace(
            self.frame,
            center_px=(float(vector[0]), float(vector[1])),
            tilt_rad=(float(vector[2]), float(vector[3])),
            floor_range=curve,
            viewpoint_height_m=height,
        )

    def written(self, vector: FloatArray) -> OmniCamera:
        """Return the camera of a vector in the form of a camera file."""
        camera = self.camera(vector)
        bent = camera.floor_range
        if not isinstance(bent, BentCurve):
            return camera
        if isinstance(bent.base, Table):
            # its own rows, moved, because they include the kinks
            rows = np.union1d(bent.radius_px(1.0 / bent.base.table_range_m), bent.nodes_px)
            return dataclasses.replace(camera, floor_range=Table(rows, 1.0 / bent.inverse_range_per_m(rows)))
        inner, outer = camera.usable_radius_px
        radius = np.linspace(0.5 * inner, 1.1 * outer, 2000)
        q = bent.inverse_range_per_m(radius)
        reach = 1.0 / (_FARTHEST_HEIGHTS * (camera.height_m or 1.0))
        last = int(np.argmax(q < reach)) if (q < reach).any() else len(q)
        rows = np.linspace(radius[0], radius[last - 1], _TABLE_ROWS)
        curve = Table(rows, 1.0 / bent.inverse_range_per_m(rows))
        return dataclasses.replace(camera, floor_range=curve)

    def prior_std(self) -> FloatArray:
        """(G,) prior standard deviations of the vector."""
        std = np.full(self.size, _BEND_STD)
        std[CENTER] = _CENTER_STD_RATIO * min(self.frame.size_px)
        std[TILT] = _TILT_STD_RAD
        std[SCALE : HORIZON + 1] = _CURVE_STD
        if self.curve != "own":
            std[6:7] = _SHAPE_STD
        return std

    def bounds(
        self, start: FloatArray, center_px: float, log_scale: float, log_horizon: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper bounds (G,) of a vector fitted from a start.

        Parameters
        ----------
        center_px : float
            Greatest change of either coordinate of the centre.
        log_scale, log_horizon : float
            Greatest changes of the logarithms of K and H.
        """
        reach = np.full(self.size, _MAX_BEND)
        reach[CENTER] = center_px
        reach[TILT] = MAX_TILT_RAD
        reach[SCALE], reach[HORIZON] = log_scale, log_horizon
        low, high = start - reach, start + reach
        if self.curve != "own":
            low[6:7], high[6:7] = np.log(_ROOT_OVER_HORIZON)
        return low, high
