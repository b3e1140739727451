"""Lists the landmarks of a field as points: posts, goal corners, beacons and crossings of lines."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Literal

from field_models.field import Field

Kind = Literal["post", "goal corner", "beacon", "crossing"]

# crossings nearer to each other than this count as one
_SAME_M = 0.05
# a line that ends within this distance of another one meets it
_MEETS_M = 0.02
# sine of the smallest angle between lines whose crossing counts as a point
_MIN_SINE = 0.3


@dataclass(frozen=True, slots=True)
class Landmark:
    """A point of the field that a camera can measure."""

    kind: Kind
    #: place in the field frame, and height above the floor
    x_m: float
    y_m: float
    height_m: float = 0.0


def field_landmarks(field: Field) -> tuple[Landmark, ...]:
    """Return foot and top of posts, goal corners and beacons, then the crossings and corners of lines."""
    upright: list[tuple[Kind, float, float, float]] = []
    for goal in field.goals:
        half = goal.width_m / 2
        if goal.kind == "posts":
            upright += [("post", goal.line_x_m, y, goal.height_m) for y in (half, -half)]
        else:
            x_of = (goal.line_x_m, goal.back_x_m) if goal.depth_m > 0 else (goal.line_x_m,)
            upright += [("goal corner", x, y, goal.height_m) for x in x_of for y in (half, -half)]
    upright += [("beacon", b.x_m, b.y_m, b.height_m) for b in field.beacons]
    found = [Landmark(kind, x, y, up) for kind, x, y, height in upright for up in (0.0, height)]
    return (*found, *(Landmark("crossing", x, y) for x, y in _crossings(field)))


def _crossings(field: Field) -> list[tuple[float, float]]:
    lines = [(float(a), float(b), float(c), float(d)) for a, b, c, d in field.lines]
    places = [p for one, other in itertools.combinations(lines, 2) if (p := _crossing(one, other)) is not None]
    for x, y, radius, start, sweep in field.arcs.tolist():
        for line in lines:
            places += _on_arc(line, x, y, radius, start, sweep)
    apart: list[tuple[float, float]] = []
    for place in places:
        if all(math.dist(place, other) > _SAME_M for other in apart):
            apart.append(place)
    return apart


def _crossing(
    one: tuple[float, float, float, float], other: tuple[float, float, float, float]
) -> tuple[float, float] | None:
    ax, ay, dx, dy = one[0], one[1], one[2] - one[0], one[3] - one[1]
    bx, by, ex, ey = other[0], other[1], other[2] - other[0], other[3] - other[1]
    across, first, second = dx * ey - dy * ex, math.hypot(dx, dy), math.hypot(ex, ey)
    if abs(across) < _MIN_SINE * first * second or not across:
        return None
    s = ((bx - ax) * ey - (by - ay) * ex) / across
    t = ((bx - ax) * dy - (by - ay) * dx) / across
    if not (-_MEETS_M <= s * first <= first + _MEETS_M and -_MEETS_M <= t * second <= second + _MEETS_M):
        return None
    return ax + s * dx, ay + s * dy


def _on_arc(
    line: tuple[float, float, float, float], x: float, y: float, radius: float, start: float, sweep: float
) -> list[tuple[float, float]]:
    length = math.dist(line[:2], line[2:])
    ux, uy = (line[2] - line[0]) / length, (line[3] - line[1]) / length
    nearest = (x - line[0]) * ux + (y - line[1]) * uy
    off = (x - line[0]) * uy - (y - line[1]) * ux
    if abs(off) > radius * math.sqrt(1 - _MIN_SINE**2):
        return []
    half = math.sqrt(radius**2 - off**2)
    places = []
    for along in (nearest - half, nearest + half):
        px, py = line[0] + along * ux, line[1] + along * uy
        turned = math.atan2(py - y, px - x) - start
        turned = math.remainder(turned - sweep / 2, math.tau)
        if -_MEETS_M <= along <= length + _MEETS_M and abs(turned) * radius <= abs(sweep) / 2 * radius + _MEETS_M:
            places.append((px, py))
    return places
