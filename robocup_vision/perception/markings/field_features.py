"""Association of measured markings with the field's lines, crossings, circles and posts, by a pose."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.estimates import PoseEstimate
from robocup_vision.perception.markings.marking import (
    GATE_SIGMAS,
    KINDS,
    Circle,
    Crossing,
    LineSegment,
    Markings,
    PenaltyMark,
    Post,
    Spot,
)

_SAME_M = 1e-6
# greatest overhang of a measured stretch beyond its line, because corners are wide
_BEYOND_M = 0.2


class FieldFeatures:
    """The lines, crossings, circles and posts of a field.

    Attributes
    ----------
    crossings_m : (M, 2) float64
        Places where two straight lines meet at right angles, field frame, metres.
    kinds : tuple of {"L", "T", "X"}
        Kinds of these crossings.
    posts_m : (P, 2) float64
        Axes of the goal posts.
    penalty_marks_m : (K, 2) float64
        Middles of the penalty marks.
    """

    def __init__(self, field: Field) -> None:
        self._lines, self._arcs = field.lines, field.arcs
        places, kinds = [], []
        for place in _meetings(field.lines):
            arms = sum(_has_arm(field.lines, place, way) for way in ((1, 0), (-1, 0), (0, 1), (0, -1)))
            places.append(place)
            kinds.append(KINDS[arms])
        self.crossings_m, self.kinds = read_only(np.array(places).reshape(-1, 2)), tuple(kinds)
        posts = [
            (goal.line_x_m, side * goal.width_m / 2) for goal in field.goals if goal.kind == "posts" for side in (1, -1)
        ]
        self.posts_m = read_only(np.array(posts, dtype=np.float64).reshape(-1, 2))
        self.penalty_marks_m = read_only(np.array([(one.x_m, one.y_m) for one in field.marks]).reshape(-1, 2))

    def name(self, markings: Markings, pose: PoseEstimate) -> Markings:
        """Return the markings with their features by a pose, and crossings with their kinds."""
        return Markings(
            tuple(self._named_segment(one, pose) for one in markings.segments),
            tuple(self._named_crossing(one, pose) for one in markings.crossings),
            tuple(
                self._named(one, self._arcs[np.abs(self._arcs[:, 2] - one.radius_m) < _SAME_M, :2], pose)
                for one in markings.circles
            ),
            tuple(self._named(one, self.posts_m, pose) for one in markings.posts),
            tuple(self._named(one, self.penalty_marks_m, pose) for one in markings.penalty_marks),
        )

    def _named_segment(self, segment: LineSegment, estimate: PoseEstimate) -> LineSegment:
        pose, lines = estimate.pose, self._lines
        angle = segment.angle_rad + pose.theta_rad
        normal, along = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        middle = pose.transform(np.array([segment.start_m, segment.end_m])).mean(axis=0)
        way = lines[:, 2:] - lines[:, :2]
        turn = np.remainder(np.arctan2(-way[:, 0], way[:, 1]) - angle + math.pi / 2, math.pi) - math.pi / 2
        lie = np.stack([np.cos(angle + turn), np.sin(angle + turn)], axis=1)
        off = ((lines[:, :2] - middle) * lie).sum(axis=1)
        # covariance of angle and distance with the pose's errors; then with the distance at the segment's middle
        by_pose = np.array([[0.0, 0.0, 1.0], [normal[0], normal[1], 0.0]])
        covariance = segment.covariance + by_pose @ estimate.covariance @ by_pose.T
        shift = np.array([[1.0, 0.0], [-float(along @ (middle - (pose.x_m, pose.y_m))), 1.0]])
        inverse = np.linalg.inv(shift @ covariance @ shift.T)
        error = np.stack([turn, off], axis=1)
        squared = np.einsum("ni,ij,nj->n", error, inverse, error)
        length = np.hypot(*way.T)
        place = ((middle - lines[:, :2]) * way).sum(axis=1) / length
        overlaps = (place >= -_BEYOND_M) & (place <= length + _BEYOND_M)
        squared = np.where(overlaps, squared, np.inf)
        best = int(np.argmin(squared)) if len(squared) else -1
        if best < 0 or not squared[best] <= GATE_SIGMAS**2:
            return segment
        x0, y0, x1, y1 = lines[best].tolist()
        return replace(segment, feature_m=(x0, y0, x1, y1))

    def _named_crossing(self, crossing: Crossing, pose: PoseEstimate) -> Crossing:
        best = self._nearest(crossing, self.crossings_m, pose)
        if best is None:
            return crossing
        x, y = self.crossings_m[best].tolist()
        return replace(crossing, kind=self.kinds[best], feature_m=(x, y))

    def _named(self, spot: Spot, places_m: FloatArray, pose: PoseEstimate) -> Spot:
        best = self._nearest(spot, places_m, pose)
        if best is None:
            return spot
        x, y = places_m[best].tolist()
        return replace(spot, feature_m=(x, y))

    def _nearest(
        self, spot: Crossing | Circle | Post | PenaltyMark, places_m: FloatArray, estimate: PoseEstimate
    ) -> int | None:
        """Return the index of the field's place (N, 2) that a marking is; None if none is within the gate."""
        if not len(places_m):
            return None
        pose = estimate.pose
        here = pose.transform(np.array([spot.x_m, spot.y_m]))
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        turn = np.array([[c, -s], [s, c]])
        moved = here - (pose.x_m, pose.y_m)
        by_pose = np.array([[1.0, 0.0, -moved[1]], [0.0, 1.0, moved[0]]])
        covariance = turn @ spot.covariance @ turn.T + by_pose @ estimate.covariance @ by_pose.T
        off = places_m - here
        squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off)
        best = int(np.argmin(squared))
        return best if squared[best] <= GATE_SIGMAS**2 else None


def _meetings(lines: FloatArray) -> Iterable[FloatArray]:
    """Yield each place where a line along x and a line along y meet, once."""
    level = lines[np.abs(lines[:, 1] - lines[:, 3]) < _SAME_M]
    upright = lines[np.abs(lines[:, 0] - lines[:, 2]) < _SAME_M]
    seen: set[tuple[float, float]] = set()
    for x0, y, x1, _ in level.tolist():
        for x, y0, _, y1 in upright.tolist():
            inside = min(x0, x1) - _SAME_M <= x <= max(x0, x1) + _SAME_M
            inside &= min(y0, y1) - _SAME_M <= y <= max(y0, y1) + _SAME_M
            at = round(x, 6) + 0.0, round(y, 6) + 0.0
            if inside and at not in seen:
                seen.add(at)
                yield np.array(at)


def _has_arm(lines: FloatArray, place: FloatArray, way: tuple[int, int]) -> bool:
    """Whether a line continues from a place along an axis."""
    beyond = place + 0.01 * np.array(way)
    low, high = np.minimum(lines[:, :2], lines[:, 2:]) - _SAME_M, np.maximum(lines[:, :2], lines[:, 2:]) + _SAME_M
    return bool(((beyond >= low) & (beyond <= high)).all(axis=1).any())
