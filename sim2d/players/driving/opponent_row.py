"""The row of robots that stands across a way, and the gaps in it, out to the field's border."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from field_models.field import Field
from robocup_vision.planning import Disc, Gap, gap_between
from sim2d.robot_link import Point

Key = tuple[int, int]

# the field's right and left border, where a robot's number stands
_RIGHT, _LEFT = -1, -2


@dataclass(frozen=True, slots=True)
class RowSettings:
    """Values of `row_across`."""

    #: A robot so near to the way counts, besides one in it.
    beside_m: float = 0.12
    #: Robots whose places differ by less than so many radii along the way stand in one row across it.
    row_radii: float = 4.0
    #: On a field without walls a robot may leave the field by so many radii.
    outside_radii: float = 4.0
    #: A gap with a smaller sine of the angle to the way lies along it.
    alongside_sin: float = 0.2


@dataclass(frozen=True, slots=True)
class Row:
    """Gaps from right to left."""

    #: Estimated gaps; the middle of each is where it is best crossed: near the straight way, clear of its ends.
    gaps: tuple[Gap, ...]
    #: Numbers of the robots at its ends; negative: the field's border.
    keys: tuple[Key, ...]
    #: Ends of each gap.
    ends: tuple[tuple[Point, Point], ...]
    #: Through which of them the straight way leads.
    straight: int


def row_across(
    here: Point,
    target: Point,
    others: Mapping[int, Disc],
    field: Field,
    radius_m: float,
    settings: RowSettings = RowSettings(),
) -> Row | None:
    """Return the first row that stands across the straight way; None if no robot stands in it.

    Parameters
    ----------
    here, target : (float, float)
        The way's ends, field frame.
    """
    along = unit(here, target)
    length, beside_m = math.dist(here, target), settings.beside_m
    places = {number: in_way(disc, here, along) for number, disc in others.items()}
    near = [x for k, (x, y) in places.items() if 0 < x < length and abs(y) < radius_m + others[k].radius_m + beside_m]
    if not near:
        return None
    first = min(near)
    row = [k for k, (x, _) in places.items() if first <= x < first + settings.row_radii * radius_m]
    row.sort(key=lambda k: places[k][1])
    right, left = _borders(here, along, first, field, settings.outside_radii * radius_m)
    members = [(_RIGHT, right), *((k, others[k]) for k in row), (_LEFT, left)]
    pairs = list(itertools.pairwise(members))
    gaps = [gap_between(a, b) for (_, a), (_, b) in pairs]
    return Row(
        tuple(_crossed(gap, here, along, radius_m + beside_m, settings.alongside_sin) for gap in gaps),
        tuple((a, b) for (a, _), (b, _) in pairs),
        tuple(_ends(gap) for gap in gaps),
        # so many robots stand on its right
        sum(places[k][1] < 0 for k in row),
    )


def unit(start: Point, end: Point) -> Point:
    """Return the direction from one place to another; any, if they are the same."""
    away = math.dist(start, end)
    return ((end[0] - start[0]) / away, (end[1] - start[1]) / away) if away > 0 else (1.0, 0.0)


def in_way(disc: Disc, start: Point, along: Point) -> Point:
    """Return where a disc's middle lies along a way and to the left of it."""
    dx, dy = disc.x_m - start[0], disc.y_m - start[1]
    return along[0] * dx + along[1] * dy, along[0] * dy - along[1] * dx


def _borders(here: Point, along: Point, at_m: float, field: Field, outside_m: float) -> tuple[Disc, Disc]:
    """Where the row ends, right and left of the way."""
    room = 0.0 if field.is_bounded else outside_m
    half = field.length_m / 2 + room, field.width_m / 2 + room
    start = here[0] + at_m * along[0], here[1] + at_m * along[1]
    ends = []
    for across in ((along[1], -along[0]), (-along[1], along[0])):
        ways = [
            max((math.copysign(h, a) - s) / a, 1e-3)
            for h, a, s in zip(half, across, start, strict=True)
            if abs(a) > 1e-9
        ]
        way = min(ways)
        ends.append(Disc(start[0] + way * across[0], start[1] + way * across[1], 0.0))
    return ends[0], ends[1]


def _ends(gap: Gap) -> tuple[Point, Point]:
    across_x, across_y = -math.sin(gap.across_rad), math.cos(gap.across_rad)
    half = 0.5 * max(gap.width_m, 0.0)
    x, y = gap.center_m
    return (x - half * across_x, y - half * across_y), (x + half * across_x, y + half * across_y)


def _crossed(gap: Gap, here: Point, along: Point, clear_m: float, alongside_sin: float) -> Gap:
    across = (-math.sin(gap.across_rad), math.cos(gap.across_rad))
    x, y = gap.center_m[0] - here[0], gap.center_m[1] - here[1]
    slope = across[0] * along[1] - across[1] * along[0]
    # from its middle to the straight way, which may run alongside it
    shift = (along[0] * y - along[1] * x) / slope if abs(slope) > alongside_sin else 0.0
    limit = max(0.5 * gap.width_m - clear_m, 0.0)
    shift = max(-limit, min(limit, shift))
    return replace(gap, center_m=(gap.center_m[0] + shift * across[0], gap.center_m[1] + shift * across[1]))
