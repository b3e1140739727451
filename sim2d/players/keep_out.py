"""Areas forbidden by the rules: around the ball, along its way during placement, in a defence area."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from sim2d.robot_link import Point

# additional distance to a zone that the robot leaves, so that noise does not bring it back
_CLEAR_M = 0.02


class KeepOut(Protocol):
    """A convex area of the floor that no part of a robot may be in. Any frame, metres."""

    def signed_distance_m(self, place: Point) -> float:
        """Return the signed distance of a place from its edge; negative inside."""

    def moved_out(self, place: Point, clearance_m: float) -> Point:
        """Return the nearest place at least `clearance_m` from its edge."""

    def edge(self) -> FloatArray:
        """Return corners (N, 2) of its outline, counter-clockwise."""


@dataclass(frozen=True, slots=True)
class Capsule:
    """All places within a radius of the segment from `start` to `end`; a disc if both are equal."""

    start: Point
    end: Point
    radius_m: float

    def _foot(self, place: Point) -> Point:
        along_x, along_y = self.end[0] - self.start[0], self.end[1] - self.start[1]
        length2 = along_x**2 + along_y**2
        if length2 <= 0.0:
            return self.start
        fraction = ((place[0] - self.start[0]) * along_x + (place[1] - self.start[1]) * along_y) / length2
        fraction = max(0.0, min(1.0, fraction))
        return self.start[0] + fraction * along_x, self.start[1] + fraction * along_y

    def signed_distance_m(self, place: Point) -> float:
        """Return the signed distance of a place from its edge; negative inside."""
        return math.dist(place, self._foot(place)) - self.radius_m

    def moved_out(self, place: Point, clearance_m: float) -> Point:
        """Return the nearest place at least `clearance_m` from its edge."""
        foot = self._foot(place)
        away = math.dist(place, foot)
        reach = self.radius_m + clearance_m
        if away >= reach:
            return place
        if away > 1e-6:
            out = (place[0] - foot[0]) / away, (place[1] - foot[1]) / away
        else:
            # from the segment itself to its side
            length = math.dist(self.start, self.end)
            along = (
                ((self.end[0] - self.start[0]) / length, (self.end[1] - self.start[1]) / length)
                if length > 0
                else (0.0, 1.0)
            )
            out = -along[1], along[0]
        return foot[0] + reach * out[0], foot[1] + reach * out[1]

    def edge(self) -> FloatArray:
        """Return corners (N, 2) of its outline, counter-clockwise."""
        heading = math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])
        halves = []
        for center, first in ((self.end, heading - math.pi / 2), (self.start, heading + math.pi / 2)):
            angles = first + np.linspace(0.0, math.pi, 13)
            halves.append(np.array(center) + self.radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        return np.concatenate(halves)


@dataclass(frozen=True, slots=True)
class Area:
    """A rectangle along the axes, from its lowest to its highest corner."""

    low: Point
    high: Point

    def signed_distance_m(self, place: Point) -> float:
        """Return the signed distance of a place from its edge; negative inside."""
        x = max(self.low[0] - place[0], place[0] - self.high[0])
        y = max(self.low[1] - place[1], place[1] - self.high[1])
        return math.hypot(max(x, 0.0), max(y, 0.0)) + min(max(x, y), 0.0)

    def moved_out(self, place: Point, clearance_m: float) -> Point:
        """Return the nearest place at least `clearance_m` from its edge."""
        if self.signed_distance_m(place) >= clearance_m:
            return place
        (x0, y0), (x1, y1) = self.low, self.high
        # at a corner it uses the corner's box, which is slightly farther than needed
        ways = (
            (x0 - clearance_m, place[1]),
            (x1 + clearance_m, place[1]),
            (place[0], y0 - clearance_m),
            (place[0], y1 + clearance_m),
        )
        return min(ways, key=lambda way: math.dist(way, place))

    def edge(self) -> FloatArray:
        """Return corners (N, 2) of its outline, counter-clockwise."""
        (x0, y0), (x1, y1) = self.low, self.high
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def allowed_target(target: Point, here: Point, zones: Sequence[KeepOut], radius_m: float) -> Point:
    """Return where to drive: out of zones that the robot is in, else to the allowed place nearest to its target."""
    inside = [zone for zone in zones if zone.signed_distance_m(here) < radius_m - 1e-9]
    if inside:
        # it first leaves the zone in which it is deepest
        worst = min(inside, key=lambda zone: zone.signed_distance_m(here))
        return worst.moved_out(here, radius_m + 2 * _CLEAR_M)
    # moving out of one zone may lead into another, so this is iterated
    for _ in range(4):
        moved = target
        for zone in zones:
            if zone.signed_distance_m(moved) < radius_m:
                moved = zone.moved_out(moved, radius_m + _CLEAR_M)
        if moved == target:
            return target
        target = moved
    return here if any(zone.signed_distance_m(target) < radius_m for zone in zones) else target


def block_zones(free_space: FreeSpace, robot: Pose2, zones: Sequence[KeepOut], radius_m: float) -> FreeSpace:
    """Return free space with zones as obstacles, except those that the robot is in, so that it can leave.

    Parameters
    ----------
    robot : Pose2
        Pose of the robot in the zones' frame.
    """
    ranges = free_space.range_m
    for zone in zones:
        if zone.signed_distance_m((robot.x_m, robot.y_m)) >= radius_m:
            corners = robot.inverse().transform(zone.edge())
            ranges = np.minimum(ranges, ranges_to_segments(free_space.bearing_rad, corners))
    return FreeSpace(free_space.bearing_rad, ranges) if zones else free_space


def ranges_to_segments(bearing_rad: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the ranges (J,) at which rays from the origin meet a closed polygon of corners (N, 2); inf if never."""
    x0, y0 = corners[:, 0], corners[:, 1]
    dx, dy = np.roll(x0, -1) - x0, np.roll(y0, -1) - y0
    c, s = np.cos(bearing_rad)[:, None], np.sin(bearing_rad)[:, None]
    # ray t (c, s) meets corner + u (dx, dy)
    cross = c * dy - s * dx
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (x0 * dy - y0 * dx) / cross
        u = (x0 * s - y0 * c) / cross
    meets = (t >= 0.0) & (u >= 0.0) & (u <= 1.0)
    return np.asarray(np.where(meets, t, np.inf).min(axis=1))
