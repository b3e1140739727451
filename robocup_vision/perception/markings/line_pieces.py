"""Line points of one frame grouped by small squares of the picture: each piece has a place and a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.perception.line_points import LinePoints

_SQUARE_PX = 8.0
# fewer points do not determine a direction
_MIN_POINTS = 4
# least ratio of the variances along and across a piece; it is less where lines meet
_MIN_SLENDERNESS = 6.0
# sine of the largest angle in the picture between a line and its pieces
_DIRECTION_SINE = math.sin(math.radians(15.0))


@dataclass(frozen=True, slots=True, eq=False)
class LinePieces:
    """Pieces of lines."""

    #: (E, 2) float64: middles in the picture, and on the floor, robot frame, metres
    pixels: FloatArray
    floor_m: FloatArray
    floor_per_px: FloatArray  #: (E, 2, 2) float64: see `LinePoints`
    along_px: FloatArray  #: (E, 2) float64: unit directions in the picture
    weight: FloatArray  #: (E,) float64: sums of the points' weights

    def __len__(self) -> int:
        return len(self.weight)

    def take(self, chosen: BoolArray) -> LinePieces:
        """Return the pieces where this mask is true."""
        return LinePieces(
            self.pixels[chosen],
            self.floor_m[chosen],
            self.floor_per_px[chosen],
            self.along_px[chosen],
            self.weight[chosen],
        )

    def across_m_per_px(self, normal_x: FloatArray, normal_y: FloatArray) -> FloatArray:
        """Return the motion of pieces along floor normals (..., E) for a step in the picture, metres for each pixel."""
        a, b, c, d = self.floor_per_px.reshape(-1, 4).T
        return np.asarray(np.hypot(a * normal_x + c * normal_y, b * normal_x + d * normal_y))

    def is_along(self, way_x: FloatArray, way_y: FloatArray) -> BoolArray:
        """Whether pieces lie along directions (..., E) of the floor, within an angle in the picture."""
        a, b, c, d = self.floor_per_px.reshape(-1, 4).T
        # the inverse of the derivative, up to scale
        u, v = d * way_x - b * way_y, a * way_y - c * way_x
        across = u * self.along_px[:, 1] - v * self.along_px[:, 0]
        return np.asarray(across * across <= _DIRECTION_SINE**2 * (u * u + v * v))


def gather_pieces(points: LinePoints) -> LinePieces:
    """Return the pieces of line points, in arbitrary order."""
    columns = np.floor(points.pixels / _SQUARE_PX).astype(np.int64)
    _, member = np.unique(columns[:, 0] * 1_000_003 + columns[:, 1], return_inverse=True)
    member = member.ravel()
    count = np.bincount(member).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        return np.bincount(member, values) / count

    middle = np.column_stack([mean(points.pixels[:, 0]), mean(points.pixels[:, 1])])
    u, v = (points.pixels - middle[member]).T
    uu, uv, vv = mean(u * u), mean(u * v), mean(v * v)
    half, apart = (uu + vv) / 2, np.hypot((uu - vv) / 2, uv)
    angle = 0.5 * np.arctan2(2 * uv, uu - vv)
    good = (count >= _MIN_POINTS) & (half + apart > 1.0) & (half + apart > _MIN_SLENDERNESS * (half - apart))
    per_px = np.stack([mean(values) for values in points.floor_per_px.reshape(-1, 4).T], axis=-1).reshape(-1, 2, 2)
    floor = np.column_stack([mean(points.floor_m[:, 0]), mean(points.floor_m[:, 1])])
    weight = np.bincount(member, points.weight).astype(np.float64)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    return LinePieces(middle[good], floor[good], per_px[good], along[good], weight[good])
