"""Loads field files: from a few numbers in TOML it derives a `Field` with all its lines, arcs, goals and walls."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from field_models.errors import ArgumentError, FileError
from field_models.field import COLOR_NAMES, Beacon, BoundaryKind, Field, Goal, GoalKind, Mark, MarkKind, Net, _frozen
from field_models.near_names import did_you_mean
from field_models.toml_file import StrictStruct, load_toml

Length = Annotated[float, msgspec.Meta(gt=0)]
Distance = Annotated[float, msgspec.Meta(ge=0)]


class _Boundary(StrictStruct):
    kind: BoundaryKind
    margin_m: Distance = 0.0
    height_m: Distance = 0.0
    color: str = "white"


class _Net(StrictStruct):
    height_m: Length
    mesh_m: Length
    cord_m: Length
    color: str = "white"


class _Goal(StrictStruct):
    kind: GoalKind
    width_m: Length
    height_m: Length
    depth_m: Distance = 0.0
    post_radius_m: Distance = 0.0
    color_positive_x: str = "white"
    color_negative_x: str = "white"
    net: _Net | None = None


class _Area(StrictStruct):
    depth_m: Length
    width_m: Length
    corner_radius_m: Distance = 0.0


class _PenaltyArc(StrictStruct):
    center_x_m: Length
    radius_m: Length


class _PenaltyMark(StrictStruct):
    distance_m: Length
    size_m: Length
    kind: MarkKind = "cross"


class _Beacon(StrictStruct):
    x_m: float
    y_m: float
    radius_m: Length
    height_m: Length
    colors: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]


class _FieldFile(StrictStruct):
    format: Literal[1]
    name: str
    length_m: Length
    width_m: Length
    line_width_m: Length
    boundary: _Boundary
    goal: _Goal | None = None
    center_line: bool = True
    goal_to_goal_line: bool = False
    outer_lines: bool = True
    half: bool = False
    center_circle_radius_m: Length | None = None
    goal_area: _Area | None = None
    penalty_area: _Area | None = None
    penalty_arc: _PenaltyArc | None = None
    penalty_mark: _PenaltyMark | None = None
    corner_arc_radius_m: Length | None = None
    beacons: tuple[_Beacon, ...] = ()
    source: str = ""
    ball_radius_m: Length = 0.0215
    ball_color: str = "orange"
    ball_patches: str = ""
    robot_radius_m: Length = 0.09


def field_names() -> tuple[str, ...]:
    """Names of the built-in fields, sorted."""
    folder = files("field_models") / "fields"
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def load_field(name_or_path: str | Path | Field) -> Field:
    """Load a built-in field by its name, or a field file by its path.

    Parameters
    ----------
    name_or_path : str, Path or Field
        One of `field_names`, or a path that ends in ``.toml``; a field is returned as it is.

    Raises
    ------
    ArgumentError
        If it is neither a built-in field nor a ``.toml`` path.
    FileError
        If the file is missing, has missing, unknown or wrong keys, or its numbers contradict each other.

    Examples
    --------
    >>> load_field("ssl_2001").length_m
    2.74
    """
    if isinstance(name_or_path, Field):
        return name_or_path
    if str(name_or_path).endswith(".toml"):
        path = Path(name_or_path)
    elif str(name_or_path) in field_names():
        path = Path(str(files("field_models") / "fields" / f"{name_or_path}.toml"))
    else:
        names = ", ".join(field_names())
        hint = did_you_mean(str(name_or_path), field_names())
        raise ArgumentError(f"field {str(name_or_path)!r} is neither a .toml file nor one of: {names}{hint}")
    description = load_toml(path, _FieldFile)
    _check(path, description)
    return _derive(description)


def _check(path: Path, f: _FieldFile) -> None:
    for key, area in (("goal_area", f.goal_area), ("penalty_area", f.penalty_area)):
        if area is None:
            continue
        if area.width_m > f.width_m:
            raise FileError(path, f"is wider than the field ({f.width_m} m)", key=f"{key}.width_m", value=area.width_m)
        if 2 * area.depth_m > f.length_m:
            raise FileError(path, "reaches over the centre line", key=f"{key}.depth_m", value=area.depth_m)
        if area.corner_radius_m > min(area.depth_m, area.width_m / 2):
            raise FileError(path, "is wider than the area", key=f"{key}.corner_radius_m", value=area.corner_radius_m)
    for key, radius in (
        ("center_circle_radius_m", f.center_circle_radius_m),
        ("corner_arc_radius_m", f.corner_arc_radius_m),
    ):
        if radius is not None and 2 * radius > min(f.length_m, f.width_m):
            raise FileError(path, "is wider than the field", key=key, value=radius)
    if f.penalty_arc is not None:
        if f.penalty_arc.center_x_m - f.penalty_arc.radius_m < 0:
            raise FileError(
                path, "reaches over the centre line", key="penalty_arc.radius_m", value=f.penalty_arc.radius_m
            )
        if f.penalty_arc.center_x_m - f.penalty_arc.radius_m >= _penalty_front_x_m(f):
            raise FileError(
                path, "ends inside the penalty area", key="penalty_arc.radius_m", value=f.penalty_arc.radius_m
            )
    mark = f.penalty_mark
    if mark is not None and 2 * mark.distance_m > f.length_m:
        raise FileError(path, "is beyond the centre line", key="penalty_mark.distance_m", value=mark.distance_m)
    if mark is not None and mark.size_m <= f.line_width_m:
        raise FileError(path, "is no larger than a line is wide", key="penalty_mark.size_m", value=mark.size_m)
    if f.boundary.kind != "carpet" and f.boundary.height_m <= 0:
        raise FileError(
            path, f"must be positive for kind '{f.boundary.kind}'", key="boundary.height_m", value=f.boundary.height_m
        )
    if f.goal is not None:
        if f.goal.width_m >= f.width_m:
            raise FileError(path, f"is wider than the field ({f.width_m} m)", key="goal.width_m", value=f.goal.width_m)
        if f.goal.kind == "recess" and (f.boundary.kind != "walls" or f.boundary.margin_m > 0 or f.goal.depth_m <= 0):
            raise FileError(path, "needs boundary walls without a margin and a depth", key="goal.kind", value="recess")
        if f.goal.kind == "panels" and f.boundary.kind != "carpet" and f.goal.depth_m > f.boundary.margin_m:
            raise FileError(path, f"reaches through the {f.boundary.kind}", key="goal.depth_m", value=f.goal.depth_m)
        if f.goal.kind == "posts" and f.goal.post_radius_m <= 0:
            raise FileError(path, "must be positive for posts", key="goal.post_radius_m", value=f.goal.post_radius_m)
        if f.goal.net is not None:
            _check_net(path, f.goal, f.goal.net)
    colors = [("boundary.color", f.boundary.color), ("ball_color", f.ball_color)]
    if f.ball_patches:
        colors.append(("ball_patches", f.ball_patches))
    if f.goal is not None:
        colors += [
            ("goal.color_positive_x", f.goal.color_positive_x),
            ("goal.color_negative_x", f.goal.color_negative_x),
        ]
        if f.goal.net is not None:
            colors.append(("goal.net.color", f.goal.net.color))
    colors += [(f"beacons[{i}].colors", color) for i, beacon in enumerate(f.beacons) for color in beacon.colors]
    for key, color in colors:
        if color not in COLOR_NAMES:
            raise FileError(path, f"is not one of {', '.join(COLOR_NAMES)}", key=key, value=color)


def _check_net(path: Path, goal: _Goal, net: _Net) -> None:
    if goal.kind == "recess":
        raise FileError(path, "has no net: walls are around it", key="goal.kind", value=goal.kind)
    if goal.depth_m <= 0:
        raise FileError(path, "must be positive behind a net's mouth", key="goal.depth_m", value=goal.depth_m)
    if net.height_m > goal.height_m + goal.post_radius_m:
        raise FileError(path, "is higher than the goal", key="goal.net.height_m", value=net.height_m)
    if net.cord_m >= net.mesh_m:
        raise FileError(path, "is as thick as the mesh is wide", key="goal.net.cord_m", value=net.cord_m)


def _derive(f: _FieldFile) -> Field:
    goals = () if f.goal is None else tuple(_goal(f, f.goal, side) for side in ((1,) if f.half else (1, -1)))
    return Field(
        name=f.name,
        source=f.source,
        length_m=f.length_m,
        width_m=f.width_m,
        line_width_m=f.line_width_m,
        lines=_frozen(_lines(f), 4),
        arcs=_frozen(_arcs(f), 5),
        goals=goals,
        beacons=tuple(
            Beacon(b.x_m, b.y_m, b.radius_m, b.height_m, b.colors) for b in f.beacons if b.x_m >= 0 or not f.half
        ),
        boundary=f.boundary.kind,
        floor_polygon=_frozen(_floor_polygon(f), 2),
        wall_height_m=f.boundary.height_m,
        wall_color=f.boundary.color,
        ball_color=f.ball_color,
        robot_radius_m=f.robot_radius_m,
        ball_radius_m=f.ball_radius_m,
        ball_patches=f.ball_patches,
        is_half=f.half,
        marks=_marks(f),
    )


def _marks(f: _FieldFile) -> tuple[Mark, ...]:
    mark = f.penalty_mark
    if mark is None:
        return ()
    x = f.length_m / 2 - mark.distance_m
    return tuple(Mark(side * x, 0.0, mark.kind, mark.size_m) for side in ((1,) if f.half else (1, -1)))


def _goal(f: _FieldFile, g: _Goal, side: int) -> Goal:
    return Goal(
        side=side,
        kind=g.kind,
        color=g.color_positive_x if side > 0 else g.color_negative_x,
        line_x_m=side * f.length_m / 2,
        width_m=g.width_m,
        depth_m=g.depth_m,
        height_m=g.height_m,
        post_radius_m=g.post_radius_m,
        net=None if g.net is None else Net(g.net.height_m, g.net.mesh_m, g.net.cord_m, g.net.color),
    )


def _lines(f: _FieldFile) -> list[list[float]]:
    x, y = f.length_m / 2, f.width_m / 2
    rows = []
    if f.outer_lines:
        rows += [[-x, -y, x, -y], [x, -y, x, y], [x, y, -x, y], [-x, y, -x, -y]]
    elif f.goal is not None:  # walls stand in place of the outer lines; only the goal's mouth is painted
        rows += [[side * x, -f.goal.width_m / 2, side * x, f.goal.width_m / 2] for side in (1, -1)]
    if f.center_line:
        rows.append([0.0, -y, 0.0, y])
    if f.goal_to_goal_line:
        rows.append([-x, 0.0, x, 0.0])
    for area in (f.goal_area, f.penalty_area):
        if area is not None:
            for side in (1, -1):
                front, half = side * (x - area.depth_m), area.width_m / 2
                round_x, round_y = front + side * area.corner_radius_m, half - area.corner_radius_m
                rows += [
                    [side * x, -half, round_x, -half],
                    [front, -round_y, front, round_y],
                    [round_x, half, side * x, half],
                ]
    return rows if not f.half else _lines_of_half(rows)


def _lines_of_half(rows: list[list[float]]) -> list[list[float]]:
    """Return the parts at x >= 0 of axis-parallel lines, rows x0, y0, x1, y1."""
    there = [row for row in rows if max(row[0], row[2]) > 0 or row[0] == row[2] == 0]
    return [[max(x0, 0.0), y0, max(x1, 0.0), y1] for x0, y0, x1, y1 in there]


def _arcs(f: _FieldFile) -> list[list[float]]:
    rows = []
    if f.center_circle_radius_m is not None:
        start, sweep = (-math.pi / 2, math.pi) if f.half else (0.0, math.tau)
        rows.append([0.0, 0.0, f.center_circle_radius_m, start, sweep])
    for area in (f.goal_area, f.penalty_area):
        if area is not None and area.corner_radius_m > 0:
            inside_x, inside_y = (
                f.length_m / 2 - area.depth_m + area.corner_radius_m,
                area.width_m / 2 - area.corner_radius_m,
            )
            for sx, sy, start in ((1, 1, math.pi / 2), (-1, 1, 0.0), (-1, -1, -math.pi / 2), (1, -1, math.pi)):
                rows.append([sx * inside_x, sy * inside_y, area.corner_radius_m, start, math.pi / 2])
    if f.penalty_arc is not None:
        center, radius = f.penalty_arc.center_x_m, f.penalty_arc.radius_m
        # only the part outside the penalty area is painted
        half_sweep = math.acos(max(-1.0, (center - _penalty_front_x_m(f)) / radius))
        rows += [
            [center, 0.0, radius, math.pi - half_sweep, 2 * half_sweep],
            [-center, 0.0, radius, -half_sweep, 2 * half_sweep],
        ]
    if f.corner_arc_radius_m is not None:
        for sx, sy, start in ((1, 1, math.pi), (-1, 1, -math.pi / 2), (-1, -1, 0.0), (1, -1, math.pi / 2)):
            rows.append([sx * f.length_m / 2, sy * f.width_m / 2, f.corner_arc_radius_m, start, math.pi / 2])
    # every arc except the centre circle lies on one side
    return [row for row in rows if row[0] >= 0 or not f.half]


def _penalty_front_x_m(f: _FieldFile) -> float:
    return f.length_m / 2 - (f.penalty_area.depth_m if f.penalty_area is not None else 0.0)


def _floor_polygon(f: _FieldFile) -> list[list[float]]:
    x, y = f.length_m / 2 + f.boundary.margin_m, f.width_m / 2 + f.boundary.margin_m
    closed_x = -f.boundary.margin_m if f.half else -x
    if f.goal is None or f.goal.kind != "recess":
        return [[x, -y], [x, y], [closed_x, y], [closed_x, -y]]
    back, half = x + f.goal.depth_m, f.goal.width_m / 2
    positive_side = np.array([[x, -y], [x, -half], [back, -half], [back, half], [x, half], [x, y]])
    if f.half:
        return [*positive_side.tolist(), [closed_x, y], [closed_x, -y]]
    return [*positive_side.tolist(), *(-positive_side).tolist()]
