"""Converts the field that a vision system sends into this project's `Field`, and back."""

from __future__ import annotations

import math

import numpy as np

from field_models.errors import PacketError
from field_models.field import Field, Goal
from robocup_vision.arrays import read_only
from robocup_vision.ssl.values.geometry import (
    BallModels,
    CameraCalibration,
    FieldArc,
    FieldLine,
    FieldSize,
    FloorPoint,
    Geometry,
    LineKind,
)

# by the league's rules, for what a geometry does not contain
GOAL_HEIGHT_M, BOARD_HEIGHT_M, BALL_RADIUS_M, ROBOT_RADIUS_M, LINE_WIDTH_M = 0.155, 0.10, 0.0215, 0.09, 0.010


def field_from_geometry(geometry: Geometry, name: str = "ssl_network") -> Field:
    """Return the field of a vision system's geometry.

    The height of the boards is that of the league's rules, as are the goals' height, the radii of ball and robots and
    the width of the lines if the geometry does not contain them.

    Raises
    ------
    PacketError
        If a length is not finite or not positive, or there are no lines.
    """
    size = geometry.field
    for key in ("length_m", "width_m", "goal_width_m", "goal_depth_m"):
        value = getattr(size, key)
        if not (math.isfinite(value) and value > 0):
            raise PacketError(f"a geometry's {key} must be positive, got {value}")
    if not size.lines:
        raise PacketError("a geometry must have lines, got none")
    lines = [[line.start.x_m, line.start.y_m, line.end.x_m, line.end.y_m] for line in size.lines]
    arcs = [[a.center.x_m, a.center.y_m, a.radius_m, a.start_rad, a.end_rad - a.start_rad] for a in size.arcs]
    if not (np.isfinite(lines).all() and np.isfinite(arcs).all()):
        raise PacketError("a geometry's lines and arcs must be finite")
    beyond_x_m = size.boundary_width_m if size.goal_line_boundary_width_m is None else size.goal_line_boundary_width_m
    if min(beyond_x_m, size.boundary_width_m) < 0:
        raise PacketError(f"a geometry's boundary must not be negative, got {min(beyond_x_m, size.boundary_width_m)}")
    x, y = size.length_m / 2 + beyond_x_m, size.width_m / 2 + size.boundary_width_m
    widths = [line.width_m for line in size.lines]
    return Field(
        name=name,
        source="geometry of a vision system",
        length_m=size.length_m,
        width_m=size.width_m,
        line_width_m=size.line_width_m or (widths[0] if widths else LINE_WIDTH_M),
        lines=read_only(np.reshape(lines, (-1, 4))),
        arcs=read_only(np.reshape(arcs, (-1, 5))),
        goals=(_goal(size, +1), _goal(size, -1)),
        beacons=(),
        boundary="boards",
        floor_polygon=read_only([[x, -y], [x, y], [-x, y], [-x, -y]]),
        wall_height_m=BOARD_HEIGHT_M,
        wall_color="black",
        ball_color="orange",
        robot_radius_m=size.max_robot_radius_m or ROBOT_RADIUS_M,
        ball_radius_m=size.ball_radius_m or BALL_RADIUS_M,
    )


def geometry_from_field(
    field: Field, cameras: tuple[CameraCalibration, ...] = (), models: BallModels | None = None
) -> Geometry:
    """Return the geometry that a vision system would send for a field.

    Lines have the league's names where it has one; others are numbered.

    Raises
    ------
    PacketError
        If the field has no goals.
    """
    if not field.goals:
        raise PacketError(f"the field {field.name} has no goals, which a geometry must hold")
    goal = field.goals[0]
    reach_x_m, reach_y_m = np.abs(field.floor_polygon).max(axis=0).tolist()
    lines = [_line(field, index, row) for index, row in enumerate(field.lines.tolist())]
    kinds = {line.kind: line for line in lines}
    stretch = kinds.get(LineKind.RIGHT_PENALTY_STRETCH)
    arcs = []
    for index, (x, y, radius, start, sweep) in enumerate(field.arcs.tolist()):
        circle = x == y == 0 and abs(sweep) > math.tau - 1e-6
        low, high = min(start, start + sweep), max(start, start + sweep)
        kind = LineKind.CENTER_CIRCLE if circle else LineKind.UNDEFINED
        name = "CenterCircle" if circle else f"Arc{index}"
        arcs.append(FieldArc(name, FloorPoint(x, y), radius, low, high, field.line_width_m, kind))
    circles = [arc.radius_m for arc in arcs if arc.kind == LineKind.CENTER_CIRCLE]
    return Geometry(
        FieldSize(
            length_m=field.length_m,
            width_m=field.width_m,
            goal_width_m=goal.width_m,
            goal_depth_m=goal.depth_m,
            boundary_width_m=max(reach_y_m - field.width_m / 2, 0.0),
            lines=tuple(lines),
            arcs=tuple(arcs),
            goal_line_boundary_width_m=max(reach_x_m - field.length_m / 2, 0.0),
            penalty_area_depth_m=None if stretch is None else field.length_m / 2 - abs(stretch.start.x_m),
            penalty_area_width_m=None if stretch is None else abs(stretch.end.y_m - stretch.start.y_m),
            center_circle_radius_m=circles[0] if circles else None,
            line_width_m=field.line_width_m,
            goal_height_m=goal.height_m,
            ball_radius_m=field.ball_radius_m,
            max_robot_radius_m=field.robot_radius_m,
        ),
        cameras,
        models,
    )


def _goal(size: FieldSize, side: int) -> Goal:
    height_m = size.goal_height_m or GOAL_HEIGHT_M
    line_x_m = side * size.length_m / 2
    return Goal(side, "panels", "white", line_x_m, size.goal_width_m, size.goal_depth_m, height_m, 0.0)


def _line(field: Field, index: int, row: list[float]) -> FieldLine:
    kind = _kind(field, *row)
    name = "".join(word.capitalize() for word in kind.name.split("_")) if kind else f"Line{index}"
    x0, y0, x1, y1 = row
    return FieldLine(name, FloorPoint(x0, y0), FloorPoint(x1, y1), field.line_width_m, kind)


def _kind(field: Field, x0: float, y0: float, x1: float, y1: float) -> LineKind:
    """Return the league's kind of a line; left and right of a penalty area are as seen facing its goal."""
    half_x, half_y = field.length_m / 2, field.width_m / 2
    along_x, along_y = math.isclose(y0, y1), math.isclose(x0, x1)
    if along_x and math.isclose(abs(y0), half_y):
        return LineKind.TOP_TOUCH_LINE if y0 > 0 else LineKind.BOTTOM_TOUCH_LINE
    if along_x and y0 == 0:
        return LineKind.CENTER_LINE
    if along_y and math.isclose(abs(x0), half_x):
        return LineKind.RIGHT_GOAL_LINE if x0 > 0 else LineKind.LEFT_GOAL_LINE
    if along_y and x0 == 0:
        return LineKind.HALFWAY_LINE
    side = 1 if x0 + x1 > 0 else -1
    # if there are two areas in front of a goal, the larger one is the penalty area
    fronts = [abs(row[0]) for row in field.lines.tolist() if row[0] == row[2] and 0 < abs(row[0]) < half_x - 1e-9]
    front = min(fronts, default=-1.0)
    if along_y and math.isclose(abs(x0), front):
        return LineKind.RIGHT_PENALTY_STRETCH if side > 0 else LineKind.LEFT_PENALTY_STRETCH
    if along_x and math.isclose(min(abs(x0), abs(x1)), front):
        if side > 0:
            left = LineKind.RIGHT_FIELD_LEFT_PENALTY_STRETCH
            return left if y0 > 0 else LineKind.RIGHT_FIELD_RIGHT_PENALTY_STRETCH
        return LineKind.LEFT_FIELD_LEFT_PENALTY_STRETCH if y0 < 0 else LineKind.LEFT_FIELD_RIGHT_PENALTY_STRETCH
    return LineKind.UNDEFINED
