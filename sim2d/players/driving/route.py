"""Plans the way of a player to a target: straight, or through a gap in the row of robots across the way."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.planning import (
    Disc,
    Gap,
    GatePlanner,
    PathFollower,
    PoseNoise,
    SpeedPlanner,
    WidthSensor,
    gap_between,
)
from robocup_vision.planning.gaps.gap_choice import PassageTimes, choose_gap
from sim2d.robot_link import Point, Reason, RobotLimits

Key = tuple[int, int]

# numbers of the field's right and left border
_RIGHT, _LEFT = -1, -2
# Distance from the way within which robots count, in addition to their radii.
_BESIDE_M = 0.12
# Greatest distance along the way, in radii, of robots in one row.
_ROW_RADII = 4.0
# Distance, in radii, by which a robot may leave a field without walls.
_OUTSIDE_RADII = 4.0
# Least sine of the angle between a gap and the way; below, the gap is parallel to it.
_ALONGSIDE_SIN = 0.2
# Least time that another gap must save, because changes cost time.
_BETTER_S = 0.25
# A gap is looked at again if the probability that it is wide enough is between these bounds.
_NARROW = 0.02
_WIDE = 0.95
# Distance within which a viewpoint counts as reached.
HERE_M = 0.02
# Distance within which a gap counts as passed.
_PASSED_M = 0.06
# Time between two plans.
REPLAN_S = 0.1
# Error of the odometry, as a fraction of the way driven.
_ODOMETRY_ERROR = 0.03
# Standard deviations of a pose right after a frame.
_POSE_STD_M = 0.01
_POSE_STD_RAD = 0.01
# Standard deviation of a tracked robot's position.
_OTHERS_STD_M = 0.015


@dataclass(frozen=True, slots=True)
class Row:
    """A row of robots across a way: its gaps from right to left."""

    #: Estimated gaps; the middle of each is the best place to cross: near the straight way, clear of the gap's ends.
    gaps: tuple[Gap, ...]
    #: Numbers of the robots at its ends; negative: the field's border.
    keys: tuple[Key, ...]
    #: Ends of each gap.
    ends: tuple[tuple[Point, Point], ...]
    #: Index of the gap on the straight way.
    straight: int


@dataclass(frozen=True, slots=True)
class Route:
    """A way to a target."""

    #: Waypoints, target last.
    points: tuple[Point, ...]
    #: Ends of the chosen gap.
    ends: tuple[Point, Point] | None
    #: Reason of the choice.
    reason: Reason
    #: Whether the robot waits here for a second look.
    waits: bool = False


class RoutePlanner:
    """Plans the ways of one player, in the field frame."""

    def __init__(self, field: Field, limits: RobotLimits) -> None:
        self._field, self._limits = field, limits
        # numbers of the robots at the ends of the last chosen gap
        self._taken: Key | None = None

    def forget(self) -> None:
        """Forget the chosen gap."""
        self._taken = None

    def plan(self, here: Point, target: Point, others: Mapping[int, Disc]) -> Route:
        """Choose among the gaps of the first row across the straight way."""
        row = row_across(here, target, others, self._field, self._limits.radius_m)
        if row is None:
            self._taken = None
            return Route((target,), None, Reason("gap", "straight", "no robot stands in the way"))
        return self._gate(here, target, row) or self._choose(here, target, row)

    def _gate(self, here: Point, target: Point, row: Row) -> Route | None:
        """Use the gate planner if the gap on the straight way may be too narrow."""
        straight = row.straight
        gap, needed_m = row.gaps[straight], self._times.narrowest_m
        if min(row.keys[straight]) < 0 or not _NARROW < gap.wide_enough(needed_m) < _WIDE:
            return None
        rest = [k for k in range(len(row.gaps)) if k != straight]
        detour = rest[choose_gap(self._times, here, target, [row.gaps[k] for k in rest]).index]
        # `needed_m` is the width that can be passed at a safe speed
        gates = GatePlanner(self._limits, WidthSensor(), needed_m)
        plan = gates.plan(here, gap, target, [row.gaps[detour].center_m])
        if plan.action == "look" and plan.viewpoint_m is not None:
            self._taken = row.keys[straight]
            waits = math.dist(plan.viewpoint_m, here) < HERE_M
            there = gap.center_m if waits else plan.viewpoint_m
            why = Reason("gap", "look first", plan.reason)
            return Route((there, gap.center_m, target), row.ends[straight], why, waits)
        taken, choice = (straight, "through") if plan.action == "pass" else (detour, "detour")
        self._taken = row.keys[taken]
        return Route(self._through(here, target, row.gaps[taken]), row.ends[taken], Reason("gap", choice, plan.reason))

    def _choose(self, here: Point, target: Point, row: Row) -> Route:
        """Choose the gap with the shortest expected time, with hysteresis."""
        chosen = choose_gap(self._times, here, target, row.gaps)
        index, text = chosen.index, chosen.reason
        if self._taken in row.keys:
            kept = row.keys.index(self._taken)
            if kept != index and chosen.expected_s[kept] < chosen.expected_s[index] + _BETTER_S:
                gap = row.gaps[kept]
                index = kept
                text = f"gap {gap.width_m:.2f} m, sigma {gap.sigma_m:.2f} m: as before, no other saves {_BETTER_S} s"
        self._taken = row.keys[index]
        choice = "through" if index == row.straight else "detour"
        return Route(self._through(here, target, row.gaps[index]), row.ends[index], Reason("gap", choice, text))

    @property
    def _times(self) -> PassageTimes:
        return _passage_times(self._limits)

    def _through(self, here: Point, target: Point, gap: Gap) -> tuple[Point, ...]:
        is_ahead = math.dist(here, gap.center_m) > _PASSED_M
        return (gap.center_m, target) if is_ahead else (target,)


def speed_planner(limits: RobotLimits) -> SpeedPlanner:
    """Return the planner of safe speeds for a robot."""
    frame = np.diag([_POSE_STD_M**2, _POSE_STD_M**2, _POSE_STD_RAD**2])
    noise = PoseNoise(_ODOMETRY_ERROR, _ODOMETRY_ERROR, frame)
    return SpeedPlanner(PathFollower(limits), limits.radius_m, noise, REPLAN_S)


@functools.lru_cache(maxsize=4)
def _passage_times(limits: RobotLimits) -> PassageTimes:
    """Return one table for all robots of a kind, because it takes a second to compute."""
    return PassageTimes(speed_planner(limits), limits.radius_m, _OTHERS_STD_M)


def row_across(here: Point, target: Point, others: Mapping[int, Disc], field: Field, radius_m: float) -> Row | None:
    """Return the first row across the straight way; None if no robot is in it.

    Parameters
    ----------
    here, target : (float, float)
        The way's ends, field frame.
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
    right, left = _borders(here, along, first, field, _OUTSIDE_RADII * radius_m)
    members = [(_RIGHT, right), *((k, others[k]) for k in row), (_LEFT, left)]
    pairs = list(itertools.pairwise(members))
    gaps = [gap_between(a, b) for (_, a), (_, b) in pairs]
    return Row(
        tuple(_crossed(gap, here, along, radius_m + _BESIDE_M) for gap in gaps),
        tuple((a, b) for (a, _), (b, _) in pairs),
        tuple(_ends(gap) for gap in gaps),
        # number of robots on its right
        sum(places[k][1] < 0 for k in row),
    )


def unit(start: Point, end: Point) -> Point:
    """Return the unit direction from one place to another; any, if they are equal."""
    away = math.dist(start, end)
    return ((end[0] - start[0]) / away, (end[1] - start[1]) / away) if away > 0 else (1.0, 0.0)


def in_way(disc: Disc, start: Point, along: Point) -> Point:
    """Return a disc's centre in the frame of a way: the distances along it and to the left of it."""
    dx, dy = disc.x_m - start[0], disc.y_m - start[1]
    return along[0] * dx + along[1] * dy, along[0] * dy - along[1] * dx


def _borders(here: Point, along: Point, at_m: float, field: Field, outside_m: float) -> tuple[Disc, Disc]:
    """Return the field's borders right and left of the way, at a distance `at_m` along it, as discs of radius 0."""
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


def _crossed(gap: Gap, here: Point, along: Point, clear_m: float) -> Gap:
    across = (-math.sin(gap.across_rad), math.cos(gap.across_rad))
    x, y = gap.center_m[0] - here[0], gap.center_m[1] - here[1]
    slope = across[0] * along[1] - across[1] * along[0]
    # shift the gap's middle to the straight way, unless the gap is parallel to it
    shift = (along[0] * y - along[1] * x) / slope if abs(slope) > _ALONGSIDE_SIN else 0.0
    limit = max(0.5 * gap.width_m - clear_m, 0.0)
    shift = max(-limit, min(limit, shift))
    return replace(gap, center_m=(gap.center_m[0] + shift * across[0], gap.center_m[1] + shift * across[1]))
