"""What measured points lie on: a field's walls and painted lines, and the pixels' floor points compared with them.

A laboratory's lines are painted by hand, centimetres off the drawing. A camera fitted to the drawing would absorb those
centimetres into its centre and tilt, so a fit may move each line and arc by three numbers (`OnPaint`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.calibration.omni.settings import JointFitSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.lines.lines import nearest_lines
from robocup_vision.kernels.walls.calibration import MirrorView, floor_points


class LineForms(NamedTuple):
    """On which line or arc floor points lie, and their covectors."""

    which: Int64Array  #: (N,) int64: the line; arcs follow the lines
    form: FloatArray  #: (N, 3) float64: n_x, n_y, -d of the line; an arc's is that of its tangent there
    part: FloatArray  #: (N,) float64: how far along the line, 0 at its start to 1 at its end; NaN on an arc


class FieldShape:
    """A field's walls and lines, from which distances of points are measured.

    Parameters
    ----------
    settings : JointFitSettings, optional
        Says how far away a line point may be.
    """

    def __init__(self, field: Field, settings: JointFitSettings = JointFitSettings()) -> None:
        self.walls = np.ascontiguousarray(field.walls if field.is_bounded else np.empty((0, 4)))
        self.lines, self.arcs = np.ascontiguousarray(field.lines), np.ascontiguousarray(field.arcs)
        self.reach_m = settings.max_line_diagonals * float(np.hypot(*np.ptp(field.floor_polygon, axis=0)))
        self.low, self.high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        ends = np.vstack([self.walls, self.lines])
        along = ends[:, 2:] - ends[:, :2]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
        # (S, 3): n_x, n_y, -d of every straight thing
        self.straight = np.column_stack([normal, -np.einsum("ij,ij->i", normal, ends[:, :2])])
        # walls stand where the field has them, and tell where the lines are
        self.paint_std_m = 0.0 if field.is_bounded else settings.paint_std_widths * field.line_width_m

    def visible_wall(self, eye_m: FloatArray, direction: FloatArray) -> Int64Array:
        """Index (N,) of the wall first met from eyes (N, 2) along directions (N, 2), field frame; -1 if none."""
        a, edge = self.walls[:, :2], self.walls[:, 2:] - self.walls[:, :2]
        to_a = a[None] - eye_m[:, None]
        across = direction[:, None, 0] * edge[None, :, 1] - direction[:, None, 1] * edge[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (to_a[..., 0] * edge[:, 1] - to_a[..., 1] * edge[:, 0]) / across
            s = (to_a[..., 0] * direction[:, None, 1] - to_a[..., 1] * direction[:, None, 0]) / across
        t = np.where((t > 0) & (s >= -1e-9) & (s <= 1 + 1e-9), t, np.inf)
        wall = np.argmin(t, axis=1)
        return np.where(np.isfinite(t[np.arange(len(t)), wall]), wall, -1)

    def nearest(self, field_m: FloatArray) -> LineForms:
        """Return the lines and arcs that floor points (N, 2), field frame, lie nearest to."""
        _, _, which = nearest_lines(np.ascontiguousarray(field_m), self.lines, self.arcs)
        count = len(self.lines)
        form = np.empty((len(which), 3))
        part = np.full(len(which), np.nan)
        straight = which < count
        form[straight] = self.straight[len(self.walls) + which[straight]]
        arc = self.arcs[which[~straight] - count]
        radial = field_m[~straight] - arc[:, :2]
        radial /= np.maximum(np.hypot(radial[:, 0], radial[:, 1]), 1e-9)[:, None]
        form[~straight] = np.column_stack([radial, -np.einsum("ij,ij->i", radial, arc[:, :2]) - arc[:, 2]])
        start, end = self.lines[which[straight], :2], self.lines[which[straight], 2:]
        along = np.einsum("ij,ij->i", field_m[straight] - start, end - start)
        part[straight] = np.clip(along / np.einsum("ij,ij->i", end - start, end - start), 0.0, 1.0)
        return LineForms(which, form, part)


def homogeneous(camera: OmniCamera, pixels: FloatArray) -> FloatArray:
    """Floor points (N, 3) as X, Y, W, robot frame: the floor point is (X, Y) / W, and W <= 0 from the horizon on."""
    u, v = camera.center_px
    q = camera.floor_range.inverse_range_per_m(np.hypot(pixels[:, 0] - u, pixels[:, 1] - v))
    point = np.empty((len(pixels), 3))
    sign = 1.0 if camera.mirrored else -1.0
    x, y, height = camera.viewpoint_m.tolist()
    view = MirrorView((float(u), float(v)), sign, float(camera.heading_rad), camera.camera_to_robot, (x, y, height))
    floor_points(pixels, q, view, point)
    return point


# sideways at the start and at the end of a line; radius and centre of an arc
_NUMBERS = 3


@dataclass(frozen=True, eq=False)
class OnPaint:
    """Which points lie on a line or arc near the field, and how its paint moves what they are compared with."""

    is_line: npt.NDArray[np.bool_]  #: (N,) bool: of all points
    which: Int64Array  #: (K,) int64: line or arc of each of those points
    #: (K, 3) float64: by how much the line lies farther out at that point, for each of its paint's numbers
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
