"""The row of robots that stands across a way, and the gaps in it, out to the field's border."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.planning import Disc, Gap, gap_between

Point = tuple[float, float]
Key = tuple[int, int]

# the field's right and left border, where a robot's number stands
_RIGHT, _LEFT = -1, -2
# who stands so near to the way, besides being in it, is asked about; whose places differ by less than so many radii
# along the way stand in one row across it
_BESIDE_M, _ROW_RADII = 0.12, 4.0
# without walls, a robot may leave the field by so many radii
_OUTSIDE_RADII = 4.0
# sine of the angle below which a gap lies along the way
_ALONGSIDE = 0.2


@dataclass(frozen=True, slots=True)
class Row:
    """Gaps from right to left.

    Parameters
    ----------
    gaps : tuple of Gap
        As believed; the middle of each is where it is best crossed: near the straight way, clear of its ends.
    keys : tuple of (int, int)
        Between whom, by their numbers; negative: the field's border.
    ends : tuple of ((float, float), (float, float))
        Of each.
    straight : int
        Through which of them the straight way leads.
    """

    gaps: tuple[Gap, ...]
    keys: tuple[Key, ...]
    ends: tuple[tuple[Point, Point], ...]
    straight: int


def row_across(here: Point, target: Point, others: Mapping[int, Disc], field: Field, radius_m: float) -> Row | None:
    """Return the first row that stands across the straight way; None: nobody stands in it.

    Parameters
    ----------
    here, target : (float, float)
        The way's ends, field frame.
    others : mapping of int to Disc
        Who is around, by number.
    field : Field
        The pitch.
    radius_m : float
        Of the robot.
    """
    along = unit(here, target)
    length = math.dist(here, target)
    places = {number: in_way(disc, here, along) for number, disc in others.items()}
    near = [x for k, (x, y) in places.items() if 0 < x < length and abs(y) < radius_m + others[k].radius_m + _BESIDE_M]
    if not near:
        return None
    first = min(near)
    row = [k for k, (x, _) in places.items() if first <= x < first + _ROW_RADII * radius_m]
    row.sort(key=lambda k: places[k][1])
    right, left = _borders(here, along, first, field, radius_m)
    members = [(_RIGHT, right), *((k, others[k]) for k in row), (_LEFT, left)]
    pairs = list(itertools.pairwise(members))
    gaps = [gap_between(a, b) for (_, a), (_, b) in pairs]
    return Row(
        tuple(_crossed(gap, here, along, radius_m + _BESIDE_M) for gap in gaps),
        tuple((a, b) for (a, _), (b, _) in pairs),
        tuple(_ends(gap) for gap in gaps),
        # it has as many on its right
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


def _borders(here: Point, along: Point, at_m: float, field: Field, radius_m: float) -> tuple[Disc, Disc]:
    """Where the row ends, right and left of the way."""
    room = 0.0 if field.is_bounded else _OUTSIDE_RADII * radius_m
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
        ends.append(Disc(start[0] + way * across[0], start[1] + way * across[1], 0.0, np.zeros((2, 2))))
    return ends[0], ends[1]


def _ends(gap: Gap) -> tuple[Point, Point]:
    across_x, across_y = -math.sin(gap.across_rad), math.cos(gap.across_rad)
    half = 0.5 * max(gap.width_m, 0.0)
    x, y = gap.center_m
    return (x - half * across_x, y - half * across_y), (x + half * across_x, y + half * across_y)


def _crossed(gap: Gap, here: Point, along: Point, clear_m: float) -> Gap:
    across = (-math.sin(gap.across_rad), math.cos(gap.across_rad))
    x, y = gap.center_m[0] - here[0], gap.center_m[1] - here[1]
    slope = across[0] * along[1] - across[1] * along[0]
    # from its middle to the straight way, which may run alongside it
    shift = (along[0] * y - along[1] * x) / slope if abs(slope) > _ALONGSIDE else 0.0
    most = max(0.5 * gap.width_m - clear_m, 0.0)
    shift = max(-most, min(most, shift))
    return replace(gap, center_m=(gap.center_m[0] + shift * across[0], gap.center_m[1] + shift * across[1]))
