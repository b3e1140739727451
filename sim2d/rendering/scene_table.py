"""Scenes in the format of the compiled loops: rows of objects, of paint and of goal nets."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import Float32Array, FloatArray
from sim2d.kernels.frame_values import FloorPaint, Nets, UprightThings
from sim2d.kernels.things import BALL, BAR, BOX, COLUMNS, CYLINDER, SHEET
from sim2d.rendering.scene import GROUND_BGR, Ball, Bar, Bgr, Box, Post, Robot, Scene, Wall

Thing = Wall | Post | Bar | Box | Robot | Ball
WHITE = np.ones(3)


class ThingTable:
    """Rows of objects, and the colours to which they refer by number."""

    def __init__(self, things: Iterable[Thing], first_color: int = 0) -> None:
        self.rows: list[list[float]] = []
        self.colors: list[Bgr] = []
        self._first = first_color
        for thing in things:
            self._add(thing)

    @property
    def values(self) -> UprightThings:
        """The objects in the format of the loops, in their own colours."""
        rows = np.array(self.rows, dtype=np.float64).reshape(-1, COLUMNS)
        return UprightThings(rows, in_cast(self.colors, WHITE))

    def _color(self, *colors: Bgr) -> int:
        """Add colours; return the number of the first."""
        self.colors += colors
        return self._first + len(self.colors) - len(colors)

    def _add(self, thing: Thing) -> None:
        add = self.rows.append
        if isinstance(thing, Wall):
            ends = [thing.x0_m, thing.y0_m, thing.x1_m, thing.y1_m]
            left = self._color(thing.left_bgr, thing.right_bgr)
            add([SHEET, *ends, 0, thing.height_m, left, 1, left + 1])
        elif isinstance(thing, Bar):
            ends = [thing.x_m, -thing.half_length_m, thing.x_m, thing.half_length_m]
            add([BAR, *ends, thing.radius_m, thing.height_m, self._color(thing.color_bgr), 1, -1])
        elif isinstance(thing, Post):
            color = self._color(*thing.bands_bgr)
            row = [CYLINDER, thing.x_m, thing.y_m, 0, 0, thing.radius_m, thing.height_m, color]
            add([*row, len(thing.bands_bgr), -1])
        elif isinstance(thing, Box):
            along = math.cos(thing.yaw_rad), math.sin(thing.yaw_rad)
            color = self._color(*(face.right_bgr for face in thing.faces()), thing.color_bgr)
            row = [BOX, thing.x_m, thing.y_m, *along, thing.width_m / 2, thing.height_m, color]
            add([*row, 5, thing.depth_m / 2])
        elif isinstance(thing, Robot):
            side = self._color(thing.color_bgr, thing.marker_bgr)
            add([CYLINDER, thing.x_m, thing.y_m, 0, 0, thing.radius_m, thing.height_m, side, 1, side + 1])
        else:
            color = self._color(thing.color_bgr)
            patches = -1 if thing.patches_bgr is None else self._color(thing.patches_bgr)
            about_x, about_y, about_z = thing.turn_rad
            place = [thing.x_m, thing.y_m, about_x, about_y, thing.radius_m, 2 * thing.radius_m]
            add([BALL, *place, color, about_z, patches])


def in_cast(colors: Iterable[Bgr], cast_bgr: FloatArray) -> Float32Array:
    """Return colours (C, 3) float32 BGR multiplied by a sensor's white balance."""
    return np.asarray(np.array([*colors], dtype=np.float64).reshape(-1, 3) * cast_bgr, dtype=np.float32)


def floor_paint(scene: Scene, cast_bgr: FloatArray = WHITE) -> FloorPaint:
    """Return the paint on a scene's floor, in a sensor's colours."""
    field, corners = scene.field, scene.carpet_polygon
    colors = COLOR_NAMES["green"], COLOR_NAMES[field.line_color], GROUND_BGR
    return FloorPaint(
        _line_rows(field),
        _arc_rows(field),
        field.line_width_m / 2,
        np.hstack([corners, np.roll(corners, -1, axis=0)]),
        not field.is_bounded,  # a floor with goal recesses is not convex
        in_cast(colors, cast_bgr),
    )


def _line_rows(field: Field) -> FloatArray:
    """Lines (N, 5): start x, y, unit direction x, y, length."""
    rows = []
    for x0, y0, x1, y1 in field.painted_lines.tolist():
        length = math.hypot(x1 - x0, y1 - y0)
        rows.append([x0, y0, (x1 - x0) / length, (y1 - y0) / length, length])
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _arc_rows(field: Field) -> FloatArray:
    """Arcs (M, 6): centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle)."""
    rows = []
    for x, y, radius, start, sweep in field.painted_arcs.tolist():
        middle = start + sweep / 2
        cosine = -2.0 if abs(sweep) > math.tau - 1e-9 else math.cos(sweep / 2)
        rows.append([x, y, radius, math.cos(middle), math.sin(middle), cosine])
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def net_rows(field: Field) -> FloatArray:
    """Return the rectangles of a field's nets, (P, 14) float64: see `Nets.rows`."""
    rows = []
    for goal in field.goals:
        if goal.net is None:
            continue
        net, half = goal.net, goal.width_m / 2
        for x0, y0, x1, y1 in goal.panels.tolist():
            length = np.hypot(x1 - x0, y1 - y0)
            along = (x1 - x0) / length, (y1 - y0) / length
            rows.append([x0, y0, 0, *along, 0, 0, 0, 1, length, net.height_m])
        rows.append([goal.line_x_m, -half, net.height_m, goal.side, 0, 0, 0, 1, 0, goal.depth_m, goal.width_m])
        for row in rows[-4:]:
            # a whole number of meshes
            row += [size / max(round(size / net.mesh_m), 1) for size in row[9:11]] + [net.cord_m]
    return np.array(rows, dtype=np.float64).reshape(-1, 14)


def nets_of(field: Field, cast_bgr: FloatArray = WHITE) -> Nets:
    """Return a field's nets in the format of the compiled loops, in a sensor's colours."""
    colors = [COLOR_NAMES[goal.net.color] for goal in field.goals if goal.net is not None]
    color = np.array(colors[0] if colors else (0.0, 0.0, 0.0)) * cast_bgr
    return Nets(net_rows(field), color.astype(np.float32))
