"""Tables of the field's edges, prepared once for the compiled loops."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from field_models import COLOR_NAMES, Field
from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.kernels.model_edges.tables import ON_FLOOR, UPRIGHT, FieldEdges

Bgr = tuple[float, float, float]

# a paint this colourful (largest minus smallest channel) differs from any grey background by its colour alone
MIN_CHROMA = 60.0
# least value of each channel of a white paint
_MIN_WHITE = 150.0
# step of white, grey and black objects before an unknown background, as a fraction of that before carpet
_PLAIN_STEP = 0.5
# sides of boxes: longer than any camera sees, and flatter than any pixel
_FAR_M, _FLAT_M = 1000.0, 1e-6


def lines_only(field: Field) -> Field:
    """Return a field without all that stands on it or bounds it."""
    return replace(field, goals=(), beacons=(), boundary="carpet")


def field_edges(field: Field, lines_end_m: float = math.inf) -> FieldEdges:
    """Gather the edges of a field that a camera may see.

    Channel 0 is that of lines: blue and red together, in which green carpet is dark. What looks like a line farther
    than `lines_end_m` beyond the outer lines is not the field's.
    """
    carpet = np.array(COLOR_NAMES["green"], dtype=np.float64)
    channels: list[list[float]] = []

    def channel(weights: FloatArray, inside: FloatArray, outside: FloatArray, step: float = 1.0) -> float:
        hue = inside - inside.mean() if np.ptp(inside) > MIN_CHROMA else np.zeros(3)
        white = float(inside.mean()) if inside.min() > _MIN_WHITE else 0.0
        row = [*weights.tolist(), step * float(weights @ (inside - outside)), *hue.tolist(), white]
        if row not in channels:
            channels.append(row)
        return float(channels.index(row))

    def color(name: str) -> FloatArray:
        return np.array(COLOR_NAMES[name], dtype=np.float64)

    def on_unknown_background(name: str) -> float:
        paint = color(name)
        weights = paint - paint.mean()
        if np.ptp(paint) > MIN_CHROMA:
            return channel(weights / np.abs(weights).max(), paint, np.zeros(3))
        return channel(np.array([1.0, 0.0, 1.0]), paint, carpet, _PLAIN_STEP)

    def between(inside: FloatArray, outside: FloatArray) -> float:
        weights = inside - outside
        return channel(weights / np.abs(weights).max(), inside, outside)

    line = channel(np.array([1.0, 0.0, 1.0]), color(field.line_color), carpet)
    features = itertools.count(0, 2)  # a line has two edges
    segments: list[list[float]] = []
    arcs = [[*arc, field.line_width_m, line, next(features)] for arc in field.arcs.tolist()]
    for x0, y0, x1, y1 in field.lines.tolist():
        length = math.hypot(x1 - x0, y1 - y0)
        across = ((y0 - y1) / length, (x1 - x0) / length, 0.0)
        segments.append([x0, y0, 0.0, x1, y1, 0.0, *across, field.line_width_m, line, next(features), ON_FLOOR, 1.0])
    cylinders: list[list[float]] = []
    corners: list[list[float]] = []
    bars: list[list[float]] = []
    rings: list[list[float]] = []

    def foot(start: list[float], end: list[float], height_m: float, paint: float) -> None:
        segments.append([*start, 0.0, *end, 0.0, 0.0, 0.0, 1.0, height_m, paint, next(features), UPRIGHT, 0.0])

    if field.is_bounded:
        wall = between(color(field.wall_color), carpet)
        floor = field.floor_polygon
        for start, end in zip(floor, np.roll(floor, -1, axis=0), strict=True):
            goal = next((g for g in field.goals if g.kind == "recess" and _in_recess(g.line_x_m, start, end)), None)
            paint = wall if goal is None else between(color(goal.color), carpet)
            foot(start.tolist(), end.tolist(), field.wall_height_m if goal is None else goal.height_m, paint)
    for goal in field.goals:
        paint = on_unknown_background(goal.color)
        if goal.kind == "panels":
            for panel in goal.panels.tolist():
                foot(panel[:2], panel[2:], goal.height_m, between(color(goal.color), carpet))
            paint, top_m = on_unknown_background(goal.color), goal.height_m
            if field.is_bounded and field.wall_color != goal.color:
                # the background above the boards is not known
                paint = between(color(goal.color), color(field.wall_color))
                top_m = min(top_m, field.wall_height_m)
            for outward in (-1.0, 1.0):
                y = outward * goal.width_m / 2
                for x, is_back, clear_m in ((goal.line_x_m, 0.0, goal.width_m), (goal.back_x_m, 1.0, goal.depth_m)):
                    corners.append([x, y, 0.0, top_m, paint, next(features), outward, is_back, clear_m])
        elif goal.kind == "posts":
            half = goal.width_m / 2
            for y in (-half, half):
                cylinders.append([goal.line_x_m, y, goal.post_radius_m, 0.0, goal.height_m, paint, next(features)])
                on_carpet = between(color(goal.color), carpet)
                rings.append([goal.line_x_m, y, goal.post_radius_m, 0.0, on_carpet, goal.height_m, next(features)])
            bars.append([goal.line_x_m, -half, half, goal.height_m, goal.post_radius_m, paint, next(features)])
    for beacon in field.beacons:
        band = beacon.height_m / len(beacon.colors)
        for k, name in enumerate(beacon.colors):
            place = [beacon.x_m, beacon.y_m, beacon.radius_m]
            cylinders.append([*place, k * band, (k + 1) * band, on_unknown_background(name), next(features)])
            if k:
                step = between(color(name), color(beacon.colors[k - 1]))
                rings.append([*place, k * band, step, band, next(features)])
    return FieldEdges(
        _table(segments, 14),
        _table(arcs, 8),
        _table(cylinders, 7),
        _table(corners, 9),
        _table(bars, 7),
        _table(rings, 7),
        _table(channels, 8),
        _table([*_nets(field), *_beyond(field, lines_end_m)], 6),
    )


def telling_features(edges: FieldEdges) -> BoolArray:
    """Return which edges (F,), by `Samples.feature`, show the field's half, because their half turns are no edges.

    Paints are compared by colour and not by brightness, as a camera distinguishes them.
    """
    looks: list[tuple[int, object, object]] = []

    def add(feature: float, here: object, turned: object) -> None:
        looks.append((int(feature), here, turned))

    def color(channel: float) -> tuple[float, ...]:
        weights, hue = edges.channels[int(channel), :3], edges.channels[int(channel), 4:7]
        return tuple(np.round([*weights, *hue], 6).tolist())

    def at(sign: float, *lengths_m: float) -> tuple[float, ...]:
        # zero has no sign
        return tuple(round(sign * length, 6) + 0.0 for length in lengths_m)

    for x0, y0, z0, x1, y1, z1, _, _, _, width, channel, feature, *kind in edges.segments.tolist():
        ends = [frozenset(((*at(sign, x0, y0), z0), (*at(sign, x1, y1), z1))) for sign in (1.0, -1.0)]
        add(feature, *((end, width, color(channel), *kind) for end in ends))
    for x, y, radius, start, sweep, width, channel, feature in edges.arcs.tolist():
        middle = start + sweep / 2
        # the start of a full circle does not matter
        top = (0.0, 0.0) if abs(sweep) > math.tau - 1e-9 else (math.cos(middle), math.sin(middle))
        rest = (round(radius, 6), round(abs(sweep), 6), width, color(channel))
        add(feature, *((at(sign, x, y, *top), *rest) for sign in (1.0, -1.0)))
    for x, y, radius, foot, top, channel, feature in edges.cylinders.tolist():
        add(feature, *(("cylinder", at(sign, x, y), radius, foot, top, color(channel)) for sign in (1.0, -1.0)))
    for x, y, foot, top, channel, feature, outward, is_back, _ in edges.corners.tolist():
        upright = (foot, top, is_back, color(channel))
        add(feature, *(("corner", at(sign, x, y), sign * outward, *upright) for sign in (1.0, -1.0)))
    for x, y0, y1, height, radius, channel, feature in edges.bars.tolist():
        beam = (height, radius, color(channel))
        add(feature, *(("bar", at(sign, x), frozenset(at(sign, y0, y1)), *beam) for sign in (1.0, -1.0)))
    for x, y, radius, height, channel, _, feature in edges.rings.tolist():
        add(feature, *(("ring", at(sign, x, y), radius, height, color(channel)) for sign in (1.0, -1.0)))
    tells = np.zeros(max((feature for feature, _, _ in looks), default=-2) + 2, dtype=np.bool_)
    there = {here for _, here, _ in looks}
    for feature, _, turned in looks:
        # a line has two edges
        tells[feature : feature + 2] = turned not in there
    tells.flags.writeable = False
    return tells


def _nets(field: Field) -> list[list[float]]:
    """Return the boxes that nets enclose: bright cords before carpet look like lines."""
    return [
        [*sorted((g.line_x_m, g.back_x_m)), -g.width_m / 2, g.width_m / 2, 0.0, g.net.height_m]
        for g in field.goals
        if g.net is not None
    ]


def _beyond(field: Field, margin_m: float) -> list[list[float]]:
    """Return the floor around the field, as four flat boxes."""
    if math.isinf(margin_m):
        return []
    x, y = field.length_m / 2 + margin_m, field.width_m / 2 + margin_m
    floor = [-_FLAT_M, _FLAT_M]
    return [
        [*along, *across, *floor]
        for along, across in (
            ([x, _FAR_M], [-_FAR_M, _FAR_M]),
            ([-_FAR_M, -x], [-_FAR_M, _FAR_M]),
            ([-_FAR_M, _FAR_M], [y, _FAR_M]),
            ([-_FAR_M, _FAR_M], [-_FAR_M, -y]),
        )
    ]


def _in_recess(line_x_m: float, start: FloatArray, end: FloatArray) -> bool:
    return max(abs(start[0]), abs(end[0])) > abs(line_x_m) + 1e-6 and float(start[0] + end[0]) * line_x_m > 0


def _table(rows: list[list[float]], columns: int) -> FloatArray:
    table = np.array(rows, dtype=np.float64).reshape(-1, columns)
    table.flags.writeable = False
    return table
